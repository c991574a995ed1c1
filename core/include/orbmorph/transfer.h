/* Transfer: the positions of every shape on the supermesh, and how far each reconstructed shape is from its input. */
#ifndef ORBMORPH_TRANSFER_H
#define ORBMORPH_TRANSFER_H

#include "orbmorph/remesh.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The positions of `count` places of the shape: 3 per place. */
ORB_API ORB_MUST_CHECK orb_status orb_transfer_positions(orb_context *ctx, const orb_aligned_shape *shape,
                                                         const orb_place *places, int32_t count, double *out);

/* Converts a place on an aligned shape to one on the mesh that was aligned. */
ORB_API void orb_place_before(const orb_mesh *mesh, const orb_aligned_shape *shape, const orb_place *from,
                              orb_place *out);

/* Converts a place on a repaired mesh to one in its file; triangle −1 if the file has no such triangle. corners: the
 * vertices of the triangles of the file, 3 per triangle, in the numbers of the file. */
ORB_API void orb_place_in_file(const orb_mesh *mesh, const int32_t *corners, const orb_place *from, orb_place *out);

/* How well shape s is reproduced; lengths in its own units. Samples are face centres, edge midpoints and vertices.
 * Without a proved bound all of them are measured. With one, at most 4096 of each kind on each surface are; they give
 * rms and angles to about 2 %. */
typedef struct orb_shape_report {
  double hausdorff;               /* the supermesh's proved bound, both ways; NaN: none is proved */
  double hausdorff_sampled;       /* both ways, at the samples; apart from rounding, never above the true distance */
  double rms;                     /* of the distance, over both surfaces with equal weight */
  double normal_mean, normal_p99; /* degrees between the surfaces' normals at nearest points */
  double diagonal;
  double min_area_ratio; /* the smallest supermesh triangle on this shape over the mean one */
} orb_shape_report;
/* Samples both ways, in parallel; the result does not depend on the number of threads. O(F log F) for F triangles of
 * both surfaces. */
ORB_API ORB_MUST_CHECK orb_status orb_shape_measure(orb_context *ctx, const orb_aligned_shape *shape,
                                                    const orb_supermesh *supermesh, int32_t shape_index,
                                                    orb_shape_report *out);

#ifdef __cplusplus
}
#endif
#endif
