/* Words for found landmarks, from the geometry of the first shape. */
#ifndef ORB_MERGE_NAME_H
#define ORB_MERGE_NAME_H

#include "orbmorph/mesh.h"

/* Names points of a surface by the part of a body at which they lie: "left front limb", "head", "tail". at: 3 per
 * point; names[i] becomes a literal, or NULL where the geometry does not say it clearly. No two points get the same
 * name. name.c describes how. O(V + F + count). */
ORB_MUST_CHECK orb_status orb_name_points(orb_context *ctx, const orb_mesh *mesh, const double *at, int32_t count,
                                          const char **names);

#endif
