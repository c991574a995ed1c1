/* Copies a whole deployment from one place to another: `orbmorphd migrate`. Each place is a data folder with a
 * catalogue in SQLite or PostgreSQL and objects in files or S3.
 *
 * Until the end, no daemon starts on the target: its catalogue has the mark of store/move_mark.h, its bucket an owner
 * that begins with PLACE_MIGRATING. Both name the source. So a move that was killed can continue, and a target that
 * holds anything else is refused before anything is written. The move only reads the source, except that it brings its
 * schema up to date. */
#ifndef ORB_STORE_MOVE_H
#define ORB_STORE_MOVE_H

#include "store/move_objects.h"
#include "store/place.h"

typedef struct move move;

/* Opens both and marks the target. The caller holds the locks of both data folders. STORE_UNFIT: the two do not fit;
 * STORE_ERROR, STORE_AWAY: see the log. */
store_result move_open(const store_place *from, const store_place *to, move **out);
void move_close(move *m);

/* Reports on the move. All functions run on the caller's thread. */
typedef struct move_listener {
  void (*rows)(void *user, int64_t rows); /* copied so far */
  void (*objects)(void *user, const object_counts *counts);
  void (*wrong)(void *user, const resource *row, const char *what, const char *why);
  void *user;
} move_listener;

/* Whether this continues an earlier move of the same deployment. */
int move_goes_on(const move *m);
/* Copies everything and then removes the mark. STORE_CONFLICT: counts->wrong objects of the source are damaged or
 * missing; the move copies all others, and the mark stays. */
store_result move_run(move *m, const move_listener *listener, object_counts *counts);

#endif
