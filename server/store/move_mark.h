/* The mark of a catalogue that `orbmorphd migrate` has begun to fill: a table, so that no daemon of any data folder
 * takes the half of a deployment for the whole. It names whose half it is (place_hash()). */
#ifndef ORB_STORE_MOVE_MARK_H
#define ORB_STORE_MOVE_MARK_H

#include "store/database.h"

enum { MOVE_MARK = 65 };

/* out: "" where there is no mark. SQL_OK or the error. */
int move_mark_read(database *db, char out[MOVE_MARK]);
int move_mark_set(database *db, const char *mark);
int move_mark_clear(database *db);

#endif
