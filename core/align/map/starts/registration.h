/* Non-rigid registration in space: spatial targets for the moving shape. */
#ifndef ORB_ALIGN_MAP_STARTS_REGISTRATION_H
#define ORB_ALIGN_MAP_STARTS_REGISTRATION_H

#include "align/map/engine/params.h"
#include "align/map/engine/surface.h"

/* What holds the registration: vertices of the moving shape and their targets, 3 doubles each. The first `exact` are
 * landmarks and hold exactly; the others are samples of a map that is known roughly. */
typedef struct orb_map_anchors {
  int32_t count, exact;
  const int32_t *vertex;
  const double *target;
} orb_map_anchors;

/* Spatial targets: where each vertex of the moving shape lies once the shape is registered to the fixed one in space,
 * by a thin-plate spline through the anchors and annealed non-rigid ICP. With fewer than four anchors, rigid ICP from
 * 24 rotations comes first. x, normal: of the moving shape, scaled like orb_map_surface; out: 3 per vertex. *fit: mean
 * distance from the fixed shape at the end. */
ORB_MUST_CHECK orb_status orb_map_register_in_space(orb_context *ctx, const orb_map_params *params,
                                                    const orb_map_surface *b, const double *x, const double *normal,
                                                    int32_t vertex_count, const orb_map_anchors *anchors, double *out,
                                                    double *fit);

#endif
