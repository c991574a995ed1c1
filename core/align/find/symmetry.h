/* The mirror symmetry of a body, also in a pose: which of its vertices is the mirror image of which.
 *
 * In: a decimated copy of a shape, surveyed with distances. Out: the symmetries that it may have, each as the mirror
 * image of every vertex. A pose changes neither distances along the surface nor orientation, so a running dog has the
 * symmetry of a standing one. Each candidate comes from eigenfunctions; the mirror image of the copy is registered to
 * the copy along it, and a symmetry is one that bends it little.
 *
 * A map from one such body to another takes mirror images to mirror images: paired limbs to paired limbs, and what lies
 * in the middle, such as a tail or a trunk, to what lies in the middle (mirrored.h). */
#ifndef ORB_ALIGN_FIND_SYMMETRY_H
#define ORB_ALIGN_FIND_SYMMETRY_H

#include "align/find/params.h"
#include "align/find/survey.h"
#include "spectral/spectral.h"

typedef struct orb_symmetry {
  int32_t count;                       /* 0: the shape has none */
  int32_t *image[ORB_FIND_SYMMETRIES]; /* of each vertex; the symmetry that bends least first */
} orb_symmetry;

/* survey and shape: of the same mesh, with distances. Free `out` in any case. O(n²) for n vertices: about 0.05 s of one
 * thread for 350. */
ORB_MUST_CHECK orb_status orb_symmetry_find(orb_context *ctx, const orb_survey *survey, const orb_spectral_shape *shape,
                                            orb_symmetry *out);
void orb_symmetry_free(orb_context *ctx, orb_symmetry *symmetry);

#endif
