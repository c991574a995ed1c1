/* Embeddings for maps from shape to shape.
 *
 * The given embeddings keep areas. That stretches limbs on the sphere six times as much around as along: a straight
 * edge of one shape then cuts off so much of an arc of the other one that one triangle in fourteen flips even where the
 * shapes coincide. On spheres that keep angles half as many do. */
#ifndef ORB_ALIGN_SHEET_EVEN_H
#define ORB_ALIGN_SHEET_EVEN_H

#include "orbmorph/alignment.h"

typedef struct orb_even_shapes {
  orb_align_shape *shapes;
  double **points; /* of each shape */
  int32_t count;
} orb_even_shapes;

/* Embeds the shapes again with the energy of angles. A sphere that is not certified leaves the given one. Free `out` in
 * any case. */
ORB_MUST_CHECK orb_status orb_even_shapes_create(orb_context *ctx, const orb_align_shape *shapes, int32_t count,
                                                 orb_even_shapes *out);
void orb_even_shapes_free(orb_context *ctx, orb_even_shapes *even);

#endif
