/* What one call of orb_compose(), or a draft, holds while it runs; compose.c, starts/ and twist/ share it. */
#ifndef ORB_ALIGN_MAP_ENGINE_RUN_H
#define ORB_ALIGN_MAP_ENGINE_RUN_H

#include "align/map/engine/guide.h"
#include "align/map/engine/packed.h"
#include "embed/newton/hierarchy.h"
#include "embed/newton/multires.h"

/* Where a start puts the vertices of its first level. */
typedef enum orb_map_start {
  ORB_MAP_GIVEN,   /* where run->start has them: the alignment as given, or a landmark walk from it */
  ORB_MAP_SPATIAL, /* at their spatial targets */
  ORB_MAP_DRAWN    /* where the best map has them; they are then drawn to their spatial targets */
} orb_map_start;

/* Vertices of the two shapes that correspond: first the landmarks, each once, then mirror landmarks. */
typedef struct orb_map_pairs {
  int32_t count, landmarks, capacity;
  int32_t *moving, *fixed;
} orb_map_pairs;

/* Vertices that correspond roughly. */
typedef struct orb_map_samples {
  int32_t count, moving[ORB_MAP_SPECTRAL_SAMPLES], fixed[ORB_MAP_SPECTRAL_SAMPLES];
} orb_map_samples;

/* A finished map. */
typedef struct orb_map_candidate {
  double *points; /* of the moving shape, mesh order; NULL: none */
  double *fixed;  /* the fixed shape's; NULL: as given */
  double energy;
} orb_map_candidate;

/* Whether a vertex should be where its target is, or why not. The first level of a start smooths doubted vertices. */
typedef enum orb_map_doubt {
  ORB_MAP_TRUSTED,
  ORB_MAP_FACES_AWAY, /* the fixed shape faces another way there */
  ORB_MAP_FOLDED,     /* it belongs to a fold that had to be unfolded; it no longer pulls */
  ORB_MAP_NO_TARGET   /* the vertex has none */
} orb_map_doubt;

enum { ORB_MAP_PINNED = 1, ORB_MAP_FREE = 2 }; /* values of run->keep */

typedef struct orb_map_run {
  orb_context *ctx;
  orb_map_params params;
  orb_map_surface b;     /* the fixed shape */
  orb_map_packed packed; /* b, for sweeps */
  const orb_aligned_shape *fixed;
  orb_aligned_shape *moving;
  int32_t vertex_count, landmark_count;
  orb_map_pairs pairs;
  orb_map_samples samples;        /* by eigenfunctions */
  orb_map_springs springs;        /* the caller's */
  int both;                       /* the fixed shape's points on the sphere may change too */
  double *fixed_points;           /* what they are now; NULL: as given */
  orb_map_candidate kept;         /* the best map from before they changed */
  double *x, *normal;             /* moving shape, area 4π */
  int keeps_angles;               /* see orb_map_guide */
  orb_map_beat beat;              /* see orb_map_guide */
  orb_map_rival rival;            /* see orb_map_guide */
  int walks_first, walks_early;   /* see orb_map_guide */
  struct orb_map_walked *drafted; /* NULL, or the best walk towards the targets, made beforehand (targets.h) */
  orb_map_course course;          /* see orb_map_guide; its bulks are measured only if asked for */
  int wants_course;               /* whether they are asked for */
  const double *given_target;     /* for registrations without samples, in the fixed shape's space; NULL: computed */
  int samples_follow_target;      /* samples of a registration have their targets from there, not from the best map */
  int starts_smooth;              /* the first start from given targets has followed smoothed ones */
  double *target;                 /* spatial targets, once the moving shape is registered */
  double *target_normal;
  orb_place *target_place; /* of every vertex of the moving shape, on the fixed one */
  unsigned char *doubted;  /* of each vertex, mesh order: an orb_map_doubt of its target */
  unsigned char *keep;     /* vertices that stay on every level: those of pairs, pinned, and those of springs, free */
  unsigned char *usable;   /* vertices whose target_place is from a start that was nearly a map, mesh order */
  int has_usable;
  orb_hierarchy *hierarchy;
  double *position; /* x in the order of the surface */
  int32_t *local;
  orb_place *place; /* by vertex of the surface: where it was on the last level */
  double *start;    /* points of a map in which all pairs meet, mesh order: as given, later as walked */
  double *best;     /* points of the best start, mesh order; at first the alignment as given */
  double best_energy;
  int slides;        /* see orb_map_guide */
  int may_fit_parts; /* see orb_map_guide */
  double hopeless;   /* a start whose first map has more energy is given up */
  double crumpled;   /* a start whose energy rises by more than this factor while flips are cleared is given up, */
  int is_crumpled;   /* and this is 1 */
  struct {
    double energy, share; /* that it has left, and the share of the energy before; 0: nothing was drawn */
  } last_draw;
  int32_t hopeless_flips; /* a start with more than one flip in this many triangles is given up */
  double twisted_energy;  /* of the last map that was to be untwisted */
  int passes;             /* registrations through samples of the best map that are left */
  double settled;         /* energy of the map that the last pass brought no further: another pass would not either */
  int64_t work;           /* vertex steps left for clearing flips and for further starts */
} orb_map_run;

/* Leaves the run at least `steps` steps a vertex, so that a step that was given up does not starve the next one. */
void orb_map_allow(orb_map_run *run, int64_t steps);

/* The energy of the map with these points (mesh order), in which a triangle counts `cap` at most. O(n). */
ORB_MUST_CHECK orb_status orb_map_energy_of(orb_map_run *run, const double *points, double cap, double *energy);

/* A level of all vertices at these points (mesh order), with the landmarks pinned. s: the order of the vertices; it
 * stays the caller's. */
ORB_MUST_CHECK orb_status orb_map_full_level(orb_map_run *run, const double *points, const orb_corner_table *s,
                                             orb_map_level *level);

/* Gives the fixed shape other points, 3 per vertex; the run takes *points over and sets it to NULL. Places on the shape
 * stay what they are. The best map so far is set aside as run->kept, which must be empty; run->best becomes run->start,
 * whose energy is not known yet. */
ORB_MUST_CHECK orb_status orb_map_take_sphere(orb_map_run *run, double **points);

/* Makes the better of run->best and run->kept run->best, with its points of the fixed shape. */
ORB_MUST_CHECK orb_status orb_map_take_best(orb_map_run *run);

#endif
