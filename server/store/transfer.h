/* Copies objects from one store to another. */
#ifndef ORB_STORE_TRANSFER_H
#define ORB_STORE_TRANSFER_H

#include "store/catalogue.h"

/* Copies an object from `from` to `to`, unless `to` has the same file, or one of the same size and time. Its bytes
 * are compared with the hash first, so a damaged object never replaces another. links: by hard link where the file
 * systems allow it, else by a copy that is on the disk when this returns; the caller syncs the folders.
 * *made: whether the object was copied.
 * STORE_NOT_FOUND: `from` lacks it. STORE_CONFLICT: it does not match its hash. */
store_result transfer_object(const objects *from, objects *to, const char *id, const named_object *object, int links,
                             int *made);

#endif
