/* The progressive mesh of `kernel-sampling`: half-edge collapses in place, undone last in, first out.
 *
 * Half-edge h = 3t + k runs from tri[h] to tri[orb_next(h)]. A collapse of v1 into v2 removes two triangles and
 * connects the rest of v1's star to v2. Dead triangles keep their pointers, so the log needs only v1, the half-edge
 * v1→v2 and the areas that the star stood for.
 */
#ifndef ORB_EMBED_KERNEL_SAMPLING_MESH_H
#define ORB_EMBED_KERNEL_SAMPLING_MESH_H

#include "orbmorph/embed.h"

typedef struct orb_ks_mesh {
  int32_t vertex_count, triangle_count, live;
  const double *x;   /* positions on the mesh, total area 4π */
  double area_floor; /* least area of a triangle in Eq. 3 */
  double *area;      /* of the part of the input that each live triangle stands for; 4π in all */
  int32_t *tri, *twin;
  int32_t *out;     /* a half-edge out of each live vertex */
  int32_t *valence; /* of live vertices; 0: collapsed */
  int32_t log_count;
  struct orb_ks_collapse {
    int32_t vertex, edge; /* v1, and the half-edge v1→v2 */
  } * log;
  double *saved; /* the areas of each collapsed star, last in, first out */
  size_t saved_count, saved_capacity;
} orb_ks_mesh;

/* The next half-edge out of the same vertex, counter-clockwise. */
static inline int32_t orb_ks_rotate(const orb_ks_mesh *m, int32_t h) {
  return m->twin[orb_prev(h)];
}
static inline int32_t orb_ks_head(const orb_ks_mesh *m, int32_t h) {
  return m->tri[orb_next(h)];
}

/* x: scaled positions, 3 per vertex; borrowed. O(n). */
ORB_MUST_CHECK orb_status orb_ks_mesh_create(orb_context *ctx, const orb_mesh *mesh, const double *x, orb_ks_mesh *out);
void orb_ks_mesh_free(orb_context *ctx, orb_ks_mesh *m);

/* Whether collapsing half-edge h = v1→v2 keeps a closed manifold: v1 and v2 have exactly two common neighbours (link
 * condition), and more than four vertices live. mark: vertex_count numbers, stamp: a number not among them. */
int orb_ks_link_holds(const orb_ks_mesh *m, int32_t h, int32_t *mark, int32_t stamp);

/* Collapses half-edge h, for which orb_ks_link_holds(). ORB_E_NO_MEMORY leaves the mesh as it was. */
ORB_MUST_CHECK orb_status orb_ks_collapse_edge(orb_context *ctx, orb_ks_mesh *m, int32_t h);

/* Undoes the last collapse; returns its vertex. */
int32_t orb_ks_split_last(orb_ks_mesh *m);

#endif
