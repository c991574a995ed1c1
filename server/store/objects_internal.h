/* The fields of `objects` (objects.h), for the sources that implement the store: objects.c and object_removal.c. */
#ifndef ORB_STORE_OBJECTS_INTERNAL_H
#define ORB_STORE_OBJECTS_INTERNAL_H

#include <limits.h>
#include <pthread.h>

#include "store/marks.h"
#include "store/object_files.h"
#include "store/object_lock.h"
#include "store/objects_remote.h"
#include "store/vault.h"

/* An object whose file is to be deleted when no backup runs. */
typedef struct held_object {
  struct held_object *next;
  object_kind kind;
  char id[80];
} held_object;

struct objects {
  pthread_rwlock_t publishing;
  object_lock *nodes;     /* that share the bucket; NULL: there are none */
  int excludes, excluded; /* of the thread that holds `publishing` alone */
  pthread_mutex_t deleting;
  int backup_lock; /* −1: none */
  int holds_backups;
  held_object *held;
  marks *verified;
  char root[PATH_MAX - 256];
  objects_remote remote;    /* publish NULL: the store has files */
  vault *vault;             /* NULL: the objects are files */
  pthread_rwlock_t healing; /* shared from a move to quarantine until the result that had the object is deleted */
  void (*heal)(void *user, object_kind kind, const char *id);
  void *heal_user;
};

#endif
