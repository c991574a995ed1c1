/* Copies all rows of a catalogue to another one, in whichever databases the two are.
 *
 * What triggers compute is not copied: sums of bytes, and the keys of lists of supermeshes. Rows come in an order that
 * foreign keys permit, in batches, each a transaction. Then the rows of each table are read again and compared by hash
 * with those that were copied. */
#ifndef ORB_STORE_MOVE_ROWS_H
#define ORB_STORE_MOVE_ROWS_H

#include "store/database.h"
#include "store/result.h"

/* Empties `to` first. The schemas of both are up to date. tell: called after each batch with the rows so
 * far. STORE_UNFIT: the two programs' tables differ. Logs what went wrong. */
store_result move_rows(database *from, database *to, void (*tell)(void *user, int64_t rows), void *user);

#endif
