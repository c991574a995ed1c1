/* The fixed shape of a composed map. */
#ifndef ORB_ALIGN_MAP_ENGINE_SURFACE_H
#define ORB_ALIGN_MAP_ENGINE_SURFACE_H

#include "orbmorph/alignment.h"
#include "orbmorph/locate.h"

/* Squared sine of a triangle's angle below which no path leads over it. */
#define ORB_MAP_FLAT 1e-14

/* A surface on which places move. Scaled to area 4π around its centre. */
typedef struct orb_map_surface {
  int32_t vertex_count, triangle_count;
  double *x;       /* positions, 3 per vertex */
  double *normal;  /* unit, angle-weighted, 3 per vertex */
  const double *s; /* on the sphere, borrowed */
  const int32_t *triangles;
  int32_t *twin;
  double *frame;   /* 6 per triangle: two orthonormal tangents */
  double *density; /* a triangle: sphere determinant over twice its area */
  double centre[3], scale;
  orb_locator *locator;
} orb_map_surface;

ORB_MUST_CHECK orb_status orb_map_surface_create(orb_context *ctx, const orb_aligned_shape *shape,
                                                 orb_map_surface *out);

/* The same surface with other points on the sphere, 3 per vertex, which are borrowed. O(n). */
ORB_MUST_CHECK orb_status orb_map_surface_move(orb_context *ctx, orb_map_surface *b, const double *s);

void orb_map_surface_free(orb_context *ctx, orb_map_surface *b);

/* Position on the surface, on the sphere, and the interpolated normal of a place. Any output may be NULL. */
void orb_map_surface_at(const orb_map_surface *b, const orb_place *place, double y[3], double x[3], double n[3]);

/* The corner of a place's triangle that is nearest to it. */
int32_t orb_map_nearest_corner(const int32_t *triangles, const orb_place *place);

/* Walks straight from a place by `step` (in the frame of its triangle), unfolding over edges. 0 if it does not end. */
int orb_map_surface_trace(const orb_map_surface *b, const orb_place *from, const double step[2], orb_place *out);

/* Angle-weighted unit vertex normals. */
void orb_map_normals(const double *x, int32_t vertex_count, const int32_t *triangles, int32_t triangle_count,
                     double *out);

#endif
