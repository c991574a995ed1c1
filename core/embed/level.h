/* One level of the refinement as batches for the sweeps: its vertices coloured so that neighbours differ, grouped by
 * colour and valence, `lanes` to a batch; a batch holds its rings and the shapes of its triangles lane by lane. */
#ifndef ORB_EMBED_LEVEL_H
#define ORB_EMBED_LEVEL_H

#include "embed/kernels.h"

enum { ORB_LEVEL_COLOURS = 64, ORB_LEVEL_RING_MAX = 62 };

typedef struct orb_level {
  int valid;
  const orb_kernels *kernels;
  int32_t *vertex; /* of the level, live and not pinned, ascending */
  int32_t count;
  int colours;
  int32_t batch_start[ORB_LEVEL_COLOURS + 1]; /* first batch of each colour */
  int32_t *batch_vertex, *batch_valence;
  unsigned char *batch_fill, *batch_stiff;
  int64_t *batch_offset;
  double *batch_energy, *batch_fall;
  int32_t *ring;
  float *shape;
  signed char *colour; /* of each vertex of the surface */
  int32_t *heavy;      /* vertices beyond ORB_LEVEL_RING_MAX or the colours: relaxed one by one */
  int32_t heavy_count;
} orb_level;

/* Gathers the level of the vertices whose `alive` flag is set and `pinned` (or NULL) is not. */
ORB_MUST_CHECK orb_status orb_level_build(orb_context *ctx, orb_level *level, const orb_kernels *kernels,
                                          const orb_corner_table *surface, const unsigned char *alive,
                                          const unsigned char *pinned, int32_t live, double blend);
void orb_level_free(orb_context *ctx, orb_level *level);

#endif
