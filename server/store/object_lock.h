/* The lock of objects over all nodes that share a bucket: an advisory lock of PostgreSQL, on a connection of its own.
 * Within the node, the lock of objects.c comes first.
 *
 * The database drops the lock with its connection, and others may then delete what was published meanwhile. So a node
 * that shares the lock also holds a number: a second lock of the same connection, which no other connection takes. A
 * transaction that names objects commits only while that number is held (object_lock_check()). A node that excludes the
 * others waits for the running transaction, because that transaction may have checked its lock before the lock was
 * lost.
 *
 * A node that deletes may also lose the lock between its last check and the moment at which S3 carries out its request.
 * So it announces each deletion in the catalogue for OBJECT_LOCK_DELETES_MS, by the database's clock, and signs the
 * request before, so that S3 refuses it long before that time is over (bucket_delete()). A node that shares the lock
 * while an announcement stands waits until it is withdrawn or over. */
#ifndef ORB_STORE_OBJECT_LOCK_H
#define ORB_STORE_OBJECT_LOCK_H

#include "store/database.h"

typedef struct object_lock object_lock;

object_lock *object_lock_open(const char *url); /* NULL: it cannot be opened */
void object_lock_close(object_lock *l);         /* NULL: nothing */
/* Waits; any number of threads of any number of nodes may share. 0: not taken, because the database is unreachable; the
 * caller gives it back all the same. */
int object_lock_share(object_lock *l);
void object_lock_unshare(object_lock *l);
/* The number that this thread's sharing began with; 0: this thread shares no lock. */
int64_t object_lock_number(void);
/* Within a transaction, on the connection that writes: SQL_OK if the lock has been held without a gap since a thread
 * began to share it with this number (0: SQL_OK); no node deletes before the end of the transaction. SQL_LOST: it has
 * not been held. */
int object_lock_check(database *db, int64_t number);
/* 0: not taken, because others hold it for long, or the database is unreachable. */
int object_lock_exclude(object_lock *l);
void object_lock_let_go(object_lock *l);
/* Announces a deletion. The caller holds the lock exclusively. 0: the lock was lost, nothing may be deleted.
 * object_lock_let_go() withdraws the announcement, unless object_lock_keep_announced() was called less than
 * OBJECT_LOCK_DELETES_MS ago: then S3 has not answered a request and may still carry it out. */
enum { OBJECT_LOCK_DELETES_MS = 15000 }; /* three times BUCKET_DELETE_S: the clocks of S3's machines may differ */
int object_lock_announce(object_lock *l);
void object_lock_keep_announced(object_lock *l);

#endif
