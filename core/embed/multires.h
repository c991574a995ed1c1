/* The inside of a hierarchy and its refiner: what decimation, undo, placement and sweeps share. Vertex numbers here are
 * those of the surface (Morton order). */
#ifndef ORB_EMBED_MULTIRES_H
#define ORB_EMBED_MULTIRES_H

#include "embed/corner_table.h"
#include "embed/hierarchy.h"
#include "embed/kernel.h"
#include "embed/level.h"
#include "embed/star.h"

/* One half-edge collapse: vertex `vertex` into the vertex next to corner `first`. Its star was the corners first …
 * last counter-clockwise, `valence` of them; the triangles of first and last are gone while it is collapsed. */
typedef struct orb_collapse {
  int32_t vertex, first, last, valence;
  int64_t areas; /* where the target areas of the star's other triangles lie in area_log */
} orb_collapse;

struct orb_hierarchy {
  const orb_kernels *kernels;
  orb_corner_table surface;
  orb_collapse *log; /* in the order of decimation */
  int32_t log_count; /* vertex_count − 4 in all */
  int32_t undone;    /* how many of them, from the end, are undone at present */
  float *area_log;
  int64_t area_count, area_capacity;
  int32_t *round_start; /* first collapse of each independent round; round_count + 1 */
  int32_t round_count, round_capacity;
  int32_t base[4]; /* the tetrahedron */
};

/* Decimates a fresh hierarchy to its tetrahedron: decimate.c. */
ORB_MUST_CHECK orb_status orb_decimate(orb_context *ctx, orb_hierarchy *hierarchy, const unsigned char *keep,
                                       int32_t keep_until);

/* Collapse and undo of one logged collapse: collapse.c. Both take O(valence). */
ORB_MUST_CHECK orb_status orb_collapse_reserve(orb_context *ctx, orb_hierarchy *h, int32_t valence);
void orb_collapse_apply(orb_corner_table *s, int32_t first, int32_t valence, orb_collapse *out, float *areas);
void orb_collapse_redo(orb_hierarchy *h, int32_t index);
void orb_collapse_undo(orb_hierarchy *h, int32_t index);

/* The constants of a preset. */
typedef struct orb_newton_settings {
  double growth, growth_fine; /* of the vertices from level to level, below and above fine_from */
  int32_t fine_from;
  int32_t coarse_until; /* levels of fewer vertices get coarse_sweeps */
  int32_t coarse_sweeps, level_sweeps, final_sweeps;
  int32_t most_sweeps; /* on one level, while a sweep lowers the energy by more than the share `converged` */
  double converged, converged_last;
  double settled, settled_last; /* a sweep that gains less than this share ends the level */
  double weight;                /* w of the energy */
  double blend;                 /* of coarse triangles' shapes towards equilateral */
  double finest;                /* the same at full resolution */
  double crowded;               /* energy per area of a new star above which its neighbourhood is relaxed at once */
} orb_newton_settings;
void orb_newton_settings_of(const orb_embed_options *options, orb_newton_settings *out);

struct orb_refiner {
  orb_hierarchy *hierarchy;
  orb_newton_settings settings;
  double *point;                  /* 4 a vertex, the last unused */
  unsigned char *alive;           /* flags of vertices */
  unsigned char *pinned;          /* flags: these do not move */
  unsigned char *queued;          /* flags of the relaxation queue */
  int32_t *queue, queue_capacity; /* a power of two */
  float *crowding;                /* energy per area of each new star */
  orb_star *star;                 /* one a thread */
  orb_kernel_room *room;
  int32_t star_count;
  int32_t live;
  int one_way;
  orb_level level; /* batches of the present level; level.valid */
};

/* Frees a refiner whose hierarchy is not used again: does not go back to the tetrahedron. NULL is fine. */
void orb_refiner_abandon(orb_context *ctx, orb_refiner *refiner);

/* The w that holds at the present level. */
double orb_refiner_weight(const orb_refiner *refiner);

/* Undoes the collapses of one round (or all of it that is left) and places its vertices: place.c. */
ORB_MUST_CHECK orb_status orb_refiner_undo_round(orb_context *ctx, orb_refiner *refiner, double blend);

/* Undoes rounds until at least so many vertices live, on the surface only: no new vertex has a point. For those who set
 * all points then: place.c */
ORB_MUST_CHECK orb_status orb_refiner_skip(orb_context *ctx, orb_refiner *refiner, int32_t vertices);

/* One damped Newton step of a vertex in its star, accepted only where every triangle stays exactly positive. Returns
 * the relative fall; *crowding (may be NULL) the star's energy over twice its target area. place.c */
ORB_MUST_CHECK orb_status orb_refiner_relax(orb_context *ctx, orb_refiner *refiner, int32_t vertex, double blend,
                                            double *gain, double *crowding);

#endif
