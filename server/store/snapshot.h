/* For backups: copies the catalogue of a data folder, as it is at one moment, to one file. A daemon may serve the
 * folder meanwhile. */
#ifndef ORB_STORE_SNAPSHOT_H
#define ORB_STORE_SNAPSHOT_H

#include "store/catalogue.h"

typedef struct snapshot snapshot;

/* Copies the catalogue of `data` to the file `path`, whose bytes are replaced, and whose name stays throughout; checks
 * the copy (PRAGMA quick_check), and brings its schema up to date. The file is on the disk when this returns; the
 * caller syncs its folder. On failure it is empty. */
store_result snapshot_take(const char *data, const char *path);
/* Queues the jobs that were running, as if they had not begun. */
store_result snapshot_requeue(const char *path);

store_result snapshot_open(const char *path, snapshot **out);
void snapshot_close(snapshot *s);
/* Calls `each` for every row of a resource. */
store_result snapshot_each(snapshot *s, void (*each)(void *user, const resource *row), void *user);
/* Whether a row names the object. Also 1 if the rows cannot be read. */
int snapshot_names(snapshot *s, object_kind kind, const char *id);

#endif
