/* Objects that leave the store: deleted, moved to quarantine, or set aside.
 *
 * A deletion waits while a backup runs: the object is kept in a list, and objects_delete_held() deletes it later.
 */
#ifndef ORB_STORE_OBJECT_REMOVAL_H
#define ORB_STORE_OBJECT_REMOVAL_H

#include <stdint.h>

#include "store/objects.h"

/* Deletes an object that no row names; called while others are excluded. The object stays until objects_delete_held()
 * if a backup runs, S3 is unreachable, or the exclusion was lost. */
store_result objects_delete(objects *store, object_kind kind, const char *id);
/* Deletes what objects_delete() left, once no backup runs, and heals what reading from S3 found damaged. is_named:
 * whether a row names the object again; called while other threads are excluded. After a restart of the process the
 * files stay until --gc. */
void objects_delete_held(objects *store, int (*is_named)(void *user, object_kind kind, const char *id), void *user);

int objects_backup_runs(objects *store);
/* Keeps backups waiting until objects_close(), so that this process deletes at once. 0: a backup runs. */
int objects_hold_backups(objects *store);

/* Moves a wrong object, which was read through fd, out of the store. STORE_NOT_FOUND: done; STORE_OK: it has been
 * replaced meanwhile. */
store_result objects_quarantine(objects *store, object_kind kind, const char *id, int fd);
/* `heal` is called after each object that was moved to quarantine, on the thread that found it, which holds no lock. */
void objects_on_quarantine(objects *store, void (*heal)(void *user, object_kind kind, const char *id), void *user);
/* Waits until `heal` has returned for every object that is in quarantine now. A caller that finds a row without its
 * object calls this and reads the row again, because a thread may be about to delete it. Blocks; not within `heal`. */
void objects_settle(objects *store);

/* For --gc: an object without a row may be all that is left of a row that the catalogue lost, so it goes to the folder
 * lost+found first; objects_purge_lost() deletes it later. Called while others are excluded. */
store_result objects_set_aside(objects *store, object_kind kind, const char *id);
/* Deletes what was set aside before a Unix time in seconds. Returns the number of files. */
long objects_purge_lost(objects *store, int64_t before);

#endif
