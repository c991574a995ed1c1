/* The mark of a catalogue that `orbmorphd migrate` has begun to fill. It is a table, so every daemon, on whichever data
 * folder, recognises an incomplete deployment. It names the source (place_hash()). */
#ifndef ORB_STORE_MOVE_MARK_H
#define ORB_STORE_MOVE_MARK_H

#include "store/database.h"

enum { MOVE_MARK = 65 };

/* out: "" where there is no mark. SQL_OK or the error. */
int move_mark_read(database *db, char out[MOVE_MARK]);
int move_mark_set(database *db, const char *mark);
int move_mark_clear(database *db);

#endif
