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
  float *at;       /* six rows of columns: positions and weighted normals. The last ones lie at infinity */
  float *box;      /* twelve rows of boxes: the least, then the greatest coordinates. The last ones lie at infinity */
} orb_searched;

/* Room for as many vertices, in blocks of those that are near in position and normal (3 each). Free `out` in any case.
 * O(n log n) expected. */
ORB_MUST_CHECK orb_status orb_searched_create(orb_context *ctx, const double *position, const double *normal,
                                              int32_t count, orb_searched *out);
void orb_searched_free(orb_context *ctx, orb_searched *searched);

/* Lays out the vertices, where they are now and as they face. O(n). */
void orb_searched_fill(const double *position, const double *normal, orb_searched *out);

/* The vertex nearest in position and half-weighted normal. Measures the box of every block, a sixteenth of n, by
 * vectors; few blocks are near. O(n). */
int32_t orb_searched_nearest(const orb_searched *searched, const double position[3], const double normal[3]);

#endif
