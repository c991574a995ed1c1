/* Wedges: an attribute of one shape at the corners of a supermesh.
 *
 * Where the attribute is smooth, a supermesh vertex has one value. Where a seam or a hard edge of the input runs
 * through the vertex's place, the corners on either side have different values, and the asset must split the vertex.
 * Most vertices have one value, so values are stored once and corners refer to them. */
#ifndef ORB_TRANSFER_WEDGE_H
#define ORB_TRANSFER_WEDGE_H

#include "mesh/normals.h"
#include "orbmorph/transfer.h"

typedef struct orb_wedges {
  int32_t width; /* floats per value */
  int32_t value_count;
  float *values;      /* the first vertex_count values are those of the vertices */
  int32_t *of_corner; /* 3·triangle_count; NULL: corner h has the value of its vertex */
} orb_wedges;

static inline int32_t orb_wedge_of(const orb_wedges *wedges, const int32_t *triangles, int64_t corner) {
  return wedges->of_corner ? wedges->of_corner[corner] : triangles[corner];
}

/* The attributes of shape s. Normals have unit length: those of the file if it has any, else smooth ones. Colours only
 * if the mesh has any, else width is 0 and values is NULL. */
ORB_MUST_CHECK orb_status orb_wedge_normals(orb_context *ctx, const orb_supermesh *supermesh,
                                            const orb_aligned_shape *shape, int32_t s, orb_wedges *out);
ORB_MUST_CHECK orb_status orb_wedge_colors(orb_context *ctx, const orb_supermesh *supermesh,
                                           const orb_aligned_shape *shape, int32_t s, orb_wedges *out);
/* Likewise for colours that the mesh does not hold: 4 per corner of it. */
ORB_MUST_CHECK orb_status orb_wedge_colored(orb_context *ctx, const orb_supermesh *supermesh,
                                            const orb_aligned_shape *shape, int32_t s, const float *colors,
                                            orb_wedges *out);
/* For setting the corners one after another: the values of each vertex as linked lists. */
typedef struct orb_wedge_chain {
  int32_t capacity;
  int32_t *next; /* per value: the next one of its vertex, −1: none; −2: the vertex has no value yet */
} orb_wedge_chain;
/* Allocates next; the caller frees it. */
ORB_MUST_CHECK orb_status orb_wedge_chain_begin(orb_context *ctx, int32_t vertex_count, orb_wedge_chain *chain);
/* Sets a corner to an earlier value of its vertex that is within the tolerance, else to a new one. out->values grows;
 * it starts with room for vertex_count values, and out->value_count at vertex_count. */
ORB_MUST_CHECK orb_status orb_wedges_set(orb_context *ctx, orb_wedges *out, int32_t vertex, int64_t corner,
                                         const float *value, float tolerance, orb_wedge_chain *chain);

void orb_wedges_free(orb_context *ctx, orb_wedges *wedges);

#endif
