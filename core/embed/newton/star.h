/* The star of one vertex on the sphere: its ring, the shapes of its triangles, their energy as a function of the
 * centre, and a damped Newton step. In plain doubles, for any valence: for placement, relaxation and the vertices that
 * the vector sweeps leave over.
 *
 * With p the centre and q, r neighbours on the ring, D = ½ Σ cot·|edge|² of the image is affine and d = det(p, q, r)
 * linear in p, so the energy Σ D (w + angle · a/d + area · a²/d²) has a cheap gradient and Hessian in the tangent
 * plane, and it is its own barrier at the edge of the kernel. */
#ifndef ORB_EMBED_NEWTON_STAR_H
#define ORB_EMBED_NEWTON_STAR_H

#include "embed/common/corner_table.h"
#include "embed/newton/settings.h"

typedef struct orb_star {
  int32_t count, capacity;
  int32_t *vertex, *corner; /* ring, counter-clockwise, and the corners of the centre */
  double (*ring)[3];        /* points of the ring */
  double *ca, *cb, *cc;     /* D_i = ca|p − r_i|² + cb|p − r_{i+1}|² + cc */
  double *a2;               /* (doubled target area)² */
  double *x, *y, *z;        /* ring in the frame of the centre, differences to it */
  double *nx, *ny, *nz;     /* d_i as a function of the tangent coordinates: s·nx + t·ny + nz */
  double area;              /* sum of doubled target areas */
  double *block;
} orb_star;

void orb_star_free(orb_context *ctx, orb_star *star);

/* Loads the ring of v, from its vertex_corner on. point: 4 per vertex. */
ORB_MUST_CHECK orb_status orb_star_walk(orb_context *ctx, orb_star *star, const orb_corner_table *s, int32_t v,
                                        const double *point);

/* Sets the shapes and target areas. blend (0 to 1) moves the shapes towards equilateral. */
void orb_star_shape(orb_star *star, const orb_corner_table *s, int32_t v, double blend);

/* Moves p by at most one damped Newton step that lowers the energy and keeps every triangle exactly positive. Returns
 * the energy after the step; *before: the energy before it. Both are infinite where p is too near the edge of the
 * kernel to tell. */
double orb_star_newton(orb_star *star, orb_newton_energy energy, double p[3], double *before);

#endif
