/* Compares objects with their hashes: once after each start, before an object is first served; whenever a job finds one
 * wrong; and in each scrub. An object that does not match is quarantined: moved to the folder `quarantine` of the data
 * folder, not deleted. The store then lacks it: a new upload restores a mesh; a result loses its row (evict_damaged()),
 * so the next request makes it again. */
#ifndef ORB_STORE_VERIFY_H
#define ORB_STORE_VERIFY_H

#include "api/ids.h"
#include "store/objects.h"

/* The hash of a file, which is read in parts, so that the memory does not depend on its size. 0: it cannot be read. */
int verify_hash(int fd, char sha[API_ID_SIZE]);
/* Whether the object has been verified since the start. Does not block. */
int verify_is_done(const objects *store, object_kind kind, const char *id);
/* Verifies an object unless that has been done. sha: of its row; "" if the row has none; not used for aligned spheres,
 * whose file has its hash. Reads the object; the caller must not hold the store (objects_hold()). STORE_NOT_FOUND: it
 * is lost, or quarantined now. */
store_result verify_once(objects *store, object_kind kind, const char *id, const char *sha);
/* The same, even if that has been done. */
store_result verify_again(objects *store, object_kind kind, const char *id, const char *sha);

/* wait: called after each part that was read, with its bytes; 0 stops. */
typedef struct verify_pace {
  int (*wait)(void *user, int64_t bytes);
  void *user;
} verify_pace;
/* The same at a pace; pace NULL: at once. STORE_ERROR: stopped, or the object could not be read. */
store_result verify_slowly(objects *store, object_kind kind, const char *id, const char *sha, const verify_pace *pace);

#endif
