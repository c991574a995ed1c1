/* Objects against their hashes: each once after a start, before it is first served, and whenever a job found one wrong.
 * An object that does not match is quarantined: moved to the folder `quarantine` of the data folder, not deleted. The
 * store then lacks it, and an upload or a job restores it as it restores a lost one. */
#ifndef ORB_STORE_VERIFY_H
#define ORB_STORE_VERIFY_H

#include "store/objects.h"

/* Whether the object has been verified since the start. Does not block. */
int verify_is_done(const objects *store, object_kind kind, const char *id);
/* Verifies an object unless that has been done. sha: of its row; "" if the row has none; not used for aligned spheres,
 * whose file has its hash. Reads the object; the caller must not hold the store (objects_hold()). STORE_NOT_FOUND: it
 * is lost, or quarantined now. */
store_result verify_once(objects *store, object_kind kind, const char *id, const char *sha);
/* The same, also if it has been done. */
store_result verify_again(objects *store, object_kind kind, const char *id, const char *sha);

#endif
