/* Vertices laid out for searches of the nearest one in position and normal. */
#ifndef ORB_ELASTIC_SEARCHED_H
#define ORB_ELASTIC_SEARCHED_H

#include "orbmorph/mesh.h"

/* The vertices in blocks of near ones, so that a search skips the blocks whose boxes are too far away. */
typedef struct orb_searched {
  int32_t count;
  int32_t columns; /* the vertices, up to full blocks */
  int32_t boxes;   /* one per block, up to a full row of them */
  int32_t *order;  /* the vertex of each column */
  int32_t *column; /* of each vertex */
  float *at;       /* six rows of columns: positions and weighted normals. The last ones lie at infinity */
  float *box;      /* twelve rows of boxes: the least, then the greatest coordinates. The last ones lie at infinity */
  float *whole;    /* likewise, of the box around each row of boxes */
} orb_searched;

/* Room for as many vertices, in blocks of those that are near in position and normal (3 each). Free `out` in any case.
 * O(n log n) expected. */
ORB_MUST_CHECK orb_status orb_searched_create(orb_context *ctx, const double *position, const double *normal,
                                              int32_t count, orb_searched *out);
void orb_searched_free(orb_context *ctx, orb_searched *searched);

/* Lays out the vertices, where they are now and as they face. O(n). */
void orb_searched_fill(const double *position, const double *normal, orb_searched *out);

/* The vertex nearest in position and half-weighted normal. hint: a vertex that is near, for example the result for a
 * point beside this one, or −1. It makes the search short, and is the result if no other vertex is nearer. Measures the
 * boxes around 64 blocks each, a thousandth of n; few of them are near. O(n). */
int32_t orb_searched_nearest(const orb_searched *searched, const double position[3], const double normal[3],
                             int32_t hint);

#endif
