/* The inside of a hierarchy and of its refiner: what decimation, undo, placement and sweeps share. Vertex numbers here
 * are those of the surface (Morton order). */
#ifndef ORB_EMBED_NEWTON_MULTIRES_H
#define ORB_EMBED_NEWTON_MULTIRES_H

#include "embed/common/corner_table.h"
#include "embed/common/kernel.h"
#include "embed/newton/level.h"
#include "embed/newton/settings.h"
#include "embed/newton/star.h"
#include "embed/newton/vector/jobs.h"

/* One half-edge collapse: `vertex` goes into the vertex next to corner `first`. Its star was the corners first … last,
 * counter-clockwise, `valence` of them; the triangles of first and last are gone while it is collapsed. */
typedef struct orb_collapse {
  int32_t vertex, first, last, valence;
  int64_t areas; /* index in area_log of the target areas of the star's other triangles */
} orb_collapse;

typedef struct orb_hierarchy orb_hierarchy; /* as in hierarchy.h */
struct orb_hierarchy {
  const orb_vector_loops *loops;
  orb_corner_table surface;
  orb_collapse *log; /* in the order of decimation */
  int32_t log_count; /* vertex_count − 4 in all */
  int32_t undone;    /* how many of them, from the end, are currently undone */
  float *area_log;
  int64_t area_count, area_capacity;
  int32_t *round_start; /* first collapse of each independent round; round_count + 1 */
  int32_t round_count, round_capacity;
  int32_t base[4]; /* the tetrahedron */
};

struct orb_refiner {
  orb_hierarchy *hierarchy;
  orb_newton_settings settings;
  double *point;                  /* 4 per vertex, the last unused */
  unsigned char *alive;           /* flags of vertices */
  unsigned char *pinned;          /* flags: these do not move */
  unsigned char *queued;          /* flags of the relaxation queue */
  int32_t *queue, queue_capacity; /* a power of two */
  float *crowding;                /* energy per area of each new star */
  orb_star *star;                 /* one per thread */
  orb_kernel_room *room;          /* one per thread */
  int32_t star_count;
  int32_t live;
  int one_way;
  orb_level level; /* batches of the current level, if level.valid */
};

#endif
