/* The aligned spheres of a supermesh, one a shape, in one object.
 *
 * Each is the PLY of orb_sphere_ply_write(): the surface of the shape as the alignment left it (perhaps with further
 * vertices, whose source is −1) and its points on the common sphere. After the last one, little-endian:
 *
 *   uint64[shapes + 1]  where each begins, and where the last ends
 *   uint8[32]           SHA-256 of all bytes so far
 *   uint32 shapes, char[8] "ORBSPHER"
 */
#ifndef ORB_WORKER_SPHERES_H
#define ORB_WORKER_SPHERES_H

#include "orbmorph/align.h"
#include "store/objects.h"

/* Writes and publishes the object; *bytes: its size. Holds one sphere in memory at a time. STORE_ERROR where the
 * context holds the error (*status says so), else what the store says. */
store_result spheres_put(objects *store, orb_context *ctx, const char *id, const orb_alignment *alignment,
                         int64_t *bytes, orb_status *status);

/* The part of the object that is the sphere of a shape. STORE_NOT_FOUND also for a shape that it has not. Blocks. */
store_result spheres_find(const objects *store, const char *id, int shape, uint64_t *start, uint64_t *length);

/* Whether the object is whole, by its hash. STORE_NOT_FOUND: there is none. */
store_result spheres_check(const objects *store, const char *id);

#endif
