/* The file of aligned spheres: all spheres of a supermesh, one for each shape, in one object.
 *
 * Each is the PLY of orb_sphere_ply_write(): the shape's surface after alignment (vertices that the alignment added
 * have source −1) and its points on the common sphere. After the last PLY, little-endian:
 *
 *   uint64[shapes + 1]  where each begins, and where the last ends
 *   uint8[32]           SHA-256 of all bytes so far
 *   uint32 shapes, char[8] "ORBSPHER"
 *
 * In a bucket, where each object costs a request, the file has the places as well: they follow the last PLY, the table
 * has one more entry, and the file ends in "ORBSPHPL". The row says so: RESOURCE_PLACES_JOINED. A bucket may have
 * supermeshes of both forms.
 */
#ifndef ORB_STORE_SPHERES_H
#define ORB_STORE_SPHERES_H

#include "orbmorph/alignment.h"
#include "store/objects.h"

/* Writes and publishes the object; *bytes: its size. places: the bytes of the places; NULL: they are an object. Holds
 * one sphere in memory at a time. If *status is not ORB_OK, the context holds the error and the result is STORE_ERROR.
 */
store_result spheres_put(objects *store, orb_context *ctx, const char *id, const orb_alignment *alignment,
                         const orb_buffer *places, int64_t *bytes, orb_status *status);

/* The byte range of a shape's sphere in the object, or of the places (SPHERES_PLACES). STORE_NOT_FOUND: no object, or
 * no such part. Blocks. */
enum { SPHERES_PLACES = -1 };
store_result spheres_find(const objects *store, const char *id, int shape, uint64_t *start, uint64_t *length);

/* Verifies the object's hash. STORE_NOT_FOUND: no object. */
store_result spheres_check(const objects *store, const char *id);
/* The same of a file with the object's bytes. */
store_result spheres_check_file(int fd, uint64_t size);

#endif
