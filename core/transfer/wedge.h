/* Wedges: an attribute of one shape at the corners of a supermesh.
 *
 * Where the attribute is smooth a supermesh vertex has one value; where the input has a seam or a hard edge through the
 * vertex's place, the corners on either side have different values, and the asset must split the vertex. Most
 * vertices have one value, so values are stored once and corners point at them.
 */
#ifndef ORB_TRANSFER_WEDGE_H
#define ORB_TRANSFER_WEDGE_H

#include "mesh/normals.h"
#include "orbmorph/transfer.h"

typedef struct orb_wedges {
  int32_t width; /* floats a value */
  int32_t value_count;
  float *values;      /* the first vertex_count values are those of the vertices */
  int32_t *of_corner; /* 3·triangle_count; NULL: corner h has the value of its vertex */
} orb_wedges;

static inline int32_t orb_wedge_of(const orb_wedges *wedges, const int32_t *triangles, int64_t corner) {
  return wedges->of_corner ? wedges->of_corner[corner] : triangles[corner];
}

/* The attributes of shape s. Normals are unit; the file's where it has them, else smooth. Colours only where the mesh
 * has them, texture coordinates only of shapes that have them (width 0, values NULL else). */
ORB_MUST_CHECK orb_status orb_wedge_normals(orb_context *ctx, const orb_supermesh *supermesh,
                                            const orb_aligned_shape *shape, int32_t s, orb_wedges *out);
ORB_MUST_CHECK orb_status orb_wedge_colors(orb_context *ctx, const orb_supermesh *supermesh,
                                           const orb_aligned_shape *shape, int32_t s, orb_wedges *out);
/* Sets corners one after another: a corner gets the value of an earlier corner at its vertex that is within tolerance,
 * else a new one. Zero-initialise `chain` and free its `next`; out->values has room for value_count = vertex_count. */
typedef struct orb_wedge_chain {
  int32_t capacity;
  int32_t *next; /* a value: the next one of its vertex, −1 none; of a vertex without a value yet −2 */
} orb_wedge_chain;
ORB_MUST_CHECK orb_status orb_wedges_set(orb_context *ctx, orb_wedges *out, int32_t vertex, int64_t corner,
                                         const float *value, float tolerance, orb_wedge_chain *chain);
ORB_MUST_CHECK orb_status orb_wedge_chain_begin(orb_context *ctx, int32_t vertex_count, orb_wedge_chain *chain);

void orb_wedges_free(orb_context *ctx, orb_wedges *wedges);

#endif
