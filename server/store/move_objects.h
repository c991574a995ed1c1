/* Copies all objects that a catalogue names from one place to another. Each place is a folder of files or a bucket.
 *
 * Each object is compared with the hash in its row before it is written. One that is there with the right hash is not
 * sent again. Nothing in the source changes, not even damaged objects. */
#ifndef ORB_STORE_MOVE_OBJECTS_H
#define ORB_STORE_MOVE_OBJECTS_H

#include "store/catalogue.h"
#include "store/database.h"

/* Where objects are; one of the two is set. */
typedef struct depot {
  objects *files;
  object_bucket *bucket;
} depot;

typedef struct object_counts {
  int64_t rows, objects; /* of the source so far */
  int64_t sent, there;   /* copied now, and before */
  int64_t bytes;         /* copied now */
  int64_t wrong;         /* damaged or missing in the source */
  int64_t left_out;      /* the same, of alignments: the daemon computes them again */
  int64_t removed;       /* deleted from `to`, because no row names them */
} object_counts;

typedef struct object_move {
  depot from, to;
  database *rows;    /* of the target, which is complete; the move deletes the row of an alignment that it leaves out */
  const char *spare; /* a folder for temporary files */
  int again;         /* an earlier run may have sent some */
  void (*tell)(void *user, const object_counts *counts);
  /* An object of the source that is damaged or missing. */
  void (*wrong)(void *user, const resource *row, const char *what, const char *why);
  void *user;
} object_move;

/* STORE_AWAY: S3 did not come back in time. STORE_OK also if objects were damaged: see counts. */
store_result move_objects(const object_move *m, object_counts *counts);

#endif
