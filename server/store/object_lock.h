/* The lock of objects over all nodes that share a bucket: an advisory lock of PostgreSQL, on a connection of its own.
 * Within the node, the lock of objects.c comes first. */
#ifndef ORB_STORE_OBJECT_LOCK_H
#define ORB_STORE_OBJECT_LOCK_H

typedef struct object_lock object_lock;

object_lock *object_lock_open(const char *url); /* NULL: it cannot be opened */
void object_lock_close(object_lock *l);         /* NULL: nothing */
/* Waits; any number of threads of any number of nodes may share. 0: not taken, because the database is away. */
int object_lock_share(object_lock *l);
void object_lock_unshare(object_lock *l);
/* 0: not taken, because others hold it for long, or the database is away. */
int object_lock_exclude(object_lock *l);
void object_lock_let_go(object_lock *l);
/* Whether what was taken is still held: not, if the connection was lost meanwhile. */
int object_lock_holds(object_lock *l);

#endif
