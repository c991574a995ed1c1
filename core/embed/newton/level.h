/* One level of the refinement, laid out as batches for the vector sweeps. Its vertices are coloured so that neighbours
 * differ, and sorted by colour and valence. A batch has `lanes` vertices of one colour, and holds their rings and the
 * shapes of their triangles lane by lane. */
#ifndef ORB_EMBED_NEWTON_LEVEL_H
#define ORB_EMBED_NEWTON_LEVEL_H

#include "embed/newton/vector/jobs.h"

enum { ORB_LEVEL_COLOURS = 64 }; /* bits of the word that collects the colours around a vertex */

typedef struct orb_level {
  int valid;
  const orb_vector_loops *loops;
  int32_t *vertex; /* live and not pinned, ascending */
  int32_t count;
  int colours;
  int32_t batch_start[ORB_LEVEL_COLOURS + 1]; /* first batch of each colour */
  int32_t *batch_vertex, *batch_valence;
  unsigned char *batch_fill, *lane_valence;
  uint16_t *batch_stiff;
  int64_t *batch_offset;
  double *batch_energy, *batch_fall;
  int32_t *ring;
  float *shape;
  signed char *colour; /* of each vertex of the surface */
  int32_t *heavy;      /* vertices of more than ORB_SWEEP_RING_MAX neighbours, or left without a colour: relaxed one by
                          one */
  int32_t heavy_count;
} orb_level;

/* Lays out the vertices whose `alive` flag is set and whose `pinned` flag (NULL: none) is not. live: how many flags of
 * alive are set. O(vertex_count). */
ORB_MUST_CHECK orb_status orb_level_build(orb_context *ctx, orb_level *level, const orb_vector_loops *loops,
                                          const orb_corner_table *surface, const unsigned char *alive,
                                          const unsigned char *pinned, int32_t live, double blend);
void orb_level_free(orb_context *ctx, orb_level *level);

#endif
