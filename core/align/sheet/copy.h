/* Decimated copies of shapes, on which a search costs little. */
#ifndef ORB_ALIGN_SHEET_COPY_H
#define ORB_ALIGN_SHEET_COPY_H

#include "embed/newton/hierarchy.h"
#include "orbmorph/embed.h"

/* A level of a shape as a mesh of its own, compact, with its own embedding. */
typedef struct orb_coarse_copy {
  orb_mesh mesh;
  double *points;  /* on the sphere, 3 per vertex of the copy */
  int32_t *vertex; /* of each vertex of the copy, its number in the given mesh */
} orb_coarse_copy;

/* Decimates to `size` vertices, or few more. Free `out` in any case. O(n log n). */
ORB_MUST_CHECK orb_status orb_coarse_copy_create(orb_context *ctx, const orb_mesh *mesh, int32_t size,
                                                 orb_coarse_copy *out);

/* The same of a mesh whose flagged vertices stay: they are in the copy if it has more than keep_until vertices. keep: a
 * flag per vertex, or NULL. The copy is a level of *hierarchy, which the caller destroys. Its embedding is that of a
 * preset. */
ORB_MUST_CHECK orb_status orb_coarse_copy_level(orb_context *ctx, const orb_mesh *mesh, const unsigned char *keep,
                                                int32_t keep_until, int32_t size, orb_preset preset,
                                                orb_hierarchy **hierarchy, orb_coarse_copy *out);
void orb_coarse_copy_free(orb_context *ctx, orb_coarse_copy *copy);

#endif
