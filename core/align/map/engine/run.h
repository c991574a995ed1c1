/* What one run of orb_compose() holds, shared by compose.c and compose_guess, _rounds, _walk. */
#ifndef ORB_ALIGN_MAP_ENGINE_RUN_H
#define ORB_ALIGN_MAP_ENGINE_RUN_H

#include "align/map/engine/packed.h"
#include "embed/hierarchy.h"
#include "embed/multires.h"

enum {
  ORB_MAP_SAMPLES = 150,    /* of a map, from which the moving shape is bent anew */
  ORB_MAP_STEPS = 25,       /* most samples of the spatial targets that a walk goes by */
  ORB_MAP_SOUND_STEPS = 100 /* and of a start that was nearly a map */
};

/* Where a start puts the vertices of its first level. */
typedef enum orb_map_start {
  ORB_MAP_GIVEN,   /* where the alignment has them */
  ORB_MAP_SPATIAL, /* at their spatial targets */
  ORB_MAP_DRAWN    /* where the best map has them; they are then drawn to their targets */
} orb_map_start;

/* Vertices of the two shapes that belong together: first the landmarks, each once, then guesses of more. */
typedef struct orb_map_pairs {
  int32_t count, landmarks, capacity;
  int32_t *moving, *fixed;
} orb_map_pairs;

/* A map that the starts have come to. */
typedef struct orb_map_candidate {
  double *points; /* of the moving shape, mesh order; NULL: none */
  double *fixed;  /* the fixed shape's; NULL: as given */
  double energy;
} orb_map_candidate;

typedef struct orb_map_effort {
  double growth; /* of the vertices from level to level */
  int first_sweeps, coarse_sweeps, level_sweeps, final_sweeps;
} orb_map_effort;

typedef struct orb_map_run {
  orb_context *ctx;
  orb_map_surface b;
  orb_map_packed packed; /* b, for sweeps */
  const orb_aligned_shape *fixed;
  orb_aligned_shape *moving;
  int32_t vertex_count, landmark_count;
  orb_map_pairs pairs;
  int both;               /* the fixed shape's points on the sphere may change too */
  double *fixed_points;   /* what they are now; NULL: as given */
  orb_map_candidate kept; /* the best map from before they changed */
  double *x, *normal;     /* moving shape, area 4π */
  double *goal;           /* spatial targets, once it was bent */
  double *goal_normal;
  orb_place *goal_place; /* on the fixed shape, of every vertex of the moving one */
  unsigned char *keep;
  unsigned char *sound; /* vertices whose goal_place is from a start that was nearly a map, mesh order */
  int has_sound;
  orb_hierarchy *hierarchy;
  double *position; /* x in the order of the surface */
  int32_t *local;
  orb_place *place; /* by vertex of the surface: where it was on the last level */
  double *start;    /* points of a map in which all pairs meet, mesh order: as given, later as walked */
  double *best;     /* points of the best start, mesh order; at first the alignment as given */
  double best_energy;
  double hopeless;       /* a start whose guess is above this energy is given up */
  double twisted_energy; /* of the last map whose limbs were to be turned back */
  int rough;             /* the alignment as given is only refined to be sampled */
  int passes;            /* bends through samples of the best map */
  int64_t work;          /* vertex steps that may still be spent on clearing flips and further starts */
  orb_map_effort effort;
} orb_map_run;

#endif
