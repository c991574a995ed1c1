/* Copies objects from one store to another. */
#ifndef ORB_STORE_TRANSFER_H
#define ORB_STORE_TRANSFER_H

#include "store/catalogue.h"

typedef enum transfer_deed {
  TRANSFER_NONE,  /* no copy was made: `to` has the object, or it failed */
  TRANSFER_NEW,   /* `to` lacked the object, or had one of another size or time */
  TRANSFER_MENDED /* `to` had a copy that did not match its hash */
} transfer_deed;

/* Copies an object from `from` to `to`, unless `to` has a copy of the same size and time. All bytes are compared with
 * the hash first: those of the source before they are published, so a damaged object never replaces another, and else
 * those of the copy that stays. A hard link to the source is no copy. A copy is on the disk when this returns; the
 * caller syncs the folders.
 * STORE_NOT_FOUND: `from` lacks it. STORE_CONFLICT: it does not match its hash. STORE_FULL: the disk of `to` would have
 * less than `reserve` bytes free. */
store_result transfer_object(const objects *from, objects *to, const char *id, const named_object *object,
                             int64_t reserve, transfer_deed *deed);

#endif
