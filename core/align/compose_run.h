/* What one run of orb_compose() holds, shared by compose.c and compose_guess, _rounds, _walk. */
#ifndef ORB_ALIGN_COMPOSE_RUN_H
#define ORB_ALIGN_COMPOSE_RUN_H

#include "align/compose_packed.h"
#include "embed/multires.h"

enum {
  CM_SAMPLES = 150,    /* of a map, from which the moving shape is bent anew */
  CM_STEPS = 25,       /* most samples of the spatial targets that a walk goes by */
  CM_SOUND_STEPS = 100 /* and of a start that was nearly a map */
};

/* Where a start puts the vertices of its first level. */
typedef enum cm_start {
  CM_GIVEN,   /* where the alignment has them */
  CM_SPATIAL, /* at their spatial targets */
  CM_DRAWN    /* where the best map has them; they are then drawn to their targets */
} cm_start;

/* Vertices of the two shapes that belong together: first the landmarks, each once, then guesses of more. */
typedef struct cm_pairs {
  int32_t count, landmarks, capacity;
  int32_t *moving, *fixed;
} cm_pairs;

/* A map that the starts have come to. */
typedef struct cm_map {
  double *points; /* of the moving shape, mesh order; NULL: none */
  double *fixed;  /* the fixed shape's; NULL: as given */
  double energy;
} cm_map;

typedef struct cm_effort {
  double growth; /* of the vertices from level to level */
  int first_sweeps, coarse_sweeps, level_sweeps, final_sweeps;
} cm_effort;

typedef struct cm_run {
  orb_context *ctx;
  cm_surface b;
  cm_packed packed; /* b, for sweeps */
  const orb_aligned_shape *fixed;
  orb_aligned_shape *moving;
  int32_t vertex_count, landmark_count;
  cm_pairs pairs;
  int both;             /* the fixed shape's points on the sphere may change too */
  double *fixed_points; /* what they are now; NULL: as given */
  cm_map kept;          /* the best map from before they changed */
  double *x, *normal;   /* moving shape, area 4π */
  double *goal;         /* spatial targets, once it was bent */
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
  cm_effort effort;
} cm_run;

/* compose_guess.c: spatial targets from the landmarks and so many samples of the best map, with the normals that the
 * bent shape has, and the nearest places to them. */
ORB_MUST_CHECK orb_status cm_bend(cm_run *run, int samples);
/* Puts the vertices of a level where the start has them. to_mesh: of the surface's vertices. */
void cm_guess(cm_run *run, cm_level *level, const int32_t *to_mesh, cm_start start);

/* compose_near.c. Whether a level with so many flips is nearly a map. */
int cm_is_near(const cm_level *level, int32_t flips);
/* Lets held vertices near the flips go, clears these, and holds them again at their points. *flips: that are left, and
 * vertices that did not come home. */
ORB_MUST_CHECK orb_status cm_release(cm_run *run, cm_level *level, const int32_t *to_mesh, int32_t *flips);
/* Notes where the vertices away from the flips are: run->sound, run->goal_place. */
ORB_MUST_CHECK orb_status cm_keep_sound(cm_run *run, const cm_level *level, const int32_t *to_mesh);

/* compose_walk.c. The landmarks, and guesses from them. */
ORB_MUST_CHECK orb_status cm_pairs_create(cm_run *run);
/* Embeds both shapes anew so that all pairs meet, and with them at most so many samples of the spatial targets, or of
 * what is sound of a start. run->start is what comes of it, and if run->both is set the fixed shape's sphere is
 * replaced, else the map is carried to it. *stuck: nothing came of it, and all is as it was. */
ORB_MUST_CHECK orb_status cm_walk(cm_run *run, int32_t samples, int *stuck);

/* compose.c. All vertices at these points, the landmarks pinned; s: their order, of the caller. */
ORB_MUST_CHECK orb_status cm_full_level(cm_run *run, const double *points, const orb_surface *s, cm_level *level);

/* compose_unwind.c. Twisted limbs of the best map are turned back, whole, by steps, or one by one, and what comes of it
 * takes the best map's place if it is better. Nothing is done where more than so much of the area is left halfway. */
ORB_MUST_CHECK orb_status cm_unwind(cm_run *run, double most_kept);

/* compose_rounds.c. Sweeps until hardly a vertex moves any more, `count` at most. */
ORB_MUST_CHECK orb_status cm_sweeps(cm_run *run, cm_level *level, cm_rules rules, int count);
/* Rules of sweeps: flips allowed against a barrier of that strength, or none. */
cm_rules cm_soft(double barrier);
cm_rules cm_hard(void);
void cm_set_pull(const cm_run *run, cm_level *level, const int32_t *to_mesh, double strength);
/* What a level holds of its map, to go back to. Sweeps set the density anew; single steps need it refreshed. */
typedef struct cm_map_copy {
  orb_place *place;
  double *y; /* y, n and x, as they lie in the level */
} cm_map_copy;
ORB_MUST_CHECK orb_status cm_map_copy_take(cm_run *run, const cm_level *level, cm_map_copy *out);
void cm_map_copy_restore(const cm_map_copy *copy, cm_level *level);
void cm_map_copy_free(cm_run *run, cm_map_copy *copy);
/* Flips are driven out: sweeps against a growing barrier, then untangling of a copy, until that succeeds. */
ORB_MUST_CHECK orb_status cm_clear_flips(cm_run *run, cm_level *level, int rounds, int32_t *flips);
/* Vertices that barriers have locked in get free where flips are allowed for a while. What comes of it is kept if it
 * can be untangled and is better. */
ORB_MUST_CHECK orb_status cm_loosen(cm_run *run, cm_level *level, int soft_sweeps, int hard_sweeps);
/* Draws a level without flips to its spatial targets, round by round less strongly. */
ORB_MUST_CHECK orb_status cm_draw(cm_run *run, cm_level *level, const int32_t *to_mesh);

#endif
