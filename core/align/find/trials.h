/* Trials: rough maps between decimated copies of two shapes, registered and ranked by how much they bend the copies and
 * by what else their poses tell (evidence.h).
 *
 * In: two meshes, and perhaps places of landmarks on their copies. Out: the trials with their poses and costs, and the
 * best of those that differ. match.h describes the method and writes the result.
 *
 * The time of a trial grows with the square of the vertices. So trials are made and registered on small copies, and the
 * best of them are raised to coarse ones, where they are ranked again (raised.h). Where shapes bend little, trials are
 * made of the coarse copies too. */
#ifndef ORB_ALIGN_FIND_TRIALS_H
#define ORB_ALIGN_FIND_TRIALS_H

#include "align/find/hint.h"
#include "align/find/params.h"
#include "align/find/survey.h"
#include "align/find/symmetry.h"
#include "spectral/spectral.h"

enum {
  ORB_TRIALS_MAX = ORB_FIND_SPECTRAL + ORB_FIND_ROTATIONS + ORB_FIND_TIPS + ORB_FIND_BRANCHED,
  ORB_TRIALS_LISTED = 5 /* trials that are listed at most: the best one, and others that differ */
};

/* A rough map and what registering along it has given. Pose s is of copy s on the other one. */
typedef struct orb_trial {
  orb_rough_map map[2];
  orb_elastic_pose pose[2];
  double bend[2];
  double resized[2], scattered[2]; /* of the poses: see evidence.h */
  double rough;                    /* cost in the first direction alone */
  double asymmetry;                /* see mirrored.h; 0: not known */
  int32_t *own[2];                 /* the rough map, if it is neither spectral nor a rotation; else NULL */
  double cost; /* INFINITY: dropped, because its rough cost is too far behind or landmarks contradict it. If `rough` is
                  INFINITY as well, its poses may not be set */
} orb_trial;

/* How a shape is scaled: to area 4π, around the middle of its box. */
typedef struct orb_trial_scaling {
  double middle[3], scale;
} orb_trial_scaling;

typedef struct orb_trials {
  orb_context *ctx;
  const orb_mesh *mesh[2]; /* borrowed */
  orb_trial_scaling scaling[2];
  orb_coarse_copy copy[2];        /* scaled */
  orb_survey survey[2];           /* of them */
  orb_spectral_shape spectral[2]; /* likewise; set by orb_trials_make() */
  orb_symmetry symmetry[2];       /* likewise; none before orb_trials_find_symmetries() */
  orb_coarse_copy fine[2];        /* the same with more vertices, on which matches are settled; empty before
                                     orb_trials_refine() */
  int32_t fine_size;              /* vertices of these */
  int32_t small_size;             /* vertices of small copies; 0: ORB_FIND_SMALL */
  orb_hint_places hint;           /* on the copies; the caller's to fill before orb_trials_rank(); empty: none */
  orb_spectral_dense dense;       /* the spectral maps */
  int32_t *rotated[2];            /* the maps of the rotations, one after the other, laid out as in `dense` */
  orb_trial trial[ORB_TRIALS_MAX];
  int32_t count;
  int32_t list[ORB_TRIALS_LISTED]; /* see orb_trials_list() */
  int32_t listed;
} orb_trials;

/* Scales the shapes and makes their coarse copies. Zero the struct before; free it in any case. */
ORB_MUST_CHECK orb_status orb_trials_open(orb_context *ctx, const orb_mesh *first, const orb_mesh *second,
                                          orb_trials *trials);
/* The same with small copies of the coarse ones, which must outlive `small`. Its landmarks are those of `coarse`. */
ORB_MUST_CHECK orb_status orb_trials_open_small(const orb_trials *coarse, orb_trials *small);
void orb_trials_close(orb_trials *trials);

/* Makes the fine copies, with `size` vertices, once a match is found. */
ORB_MUST_CHECK orb_status orb_trials_refine(orb_trials *trials, int32_t size);

/* Surveys the copies. Call it before trials are made or registered. measured: see orb_survey_create(). */
ORB_MUST_CHECK orb_status orb_trials_survey(orb_trials *trials, int measured);

/* Adds trials: spectral maps, rotations of the spheres, and, if the surveys are measured, matches of tips. */
ORB_MUST_CHECK orb_status orb_trials_make(orb_trials *trials);

/* Finds the symmetries of the copies, after orb_trials_make() and with surveys that are measured. */
ORB_MUST_CHECK orb_status orb_trials_find_symmetries(orb_trials *trials);

/* Whether both copies have a symmetry that was found. */
int orb_trials_are_symmetric(const orb_trials *trials);

/* A trial without a cost, with room for poses and for maps of its own. On failure, free it. */
ORB_MUST_CHECK orb_status orb_trial_create(orb_context *ctx, const orb_trials *trials, orb_trial *out);

/* Drops the trials whose rough maps take the landmarks far away, registers the others in one direction, drops those
 * that are too far behind to win, and registers the others in the other direction. Trials that take the landmarks
 * elsewhere are dropped after the first direction. If all do, they are dropped after the second one instead: arms that
 * lie against a body are registered to it in one direction, but correctly in the other. May be called again after
 * trials were added: dropped ones stay dropped, and the others are registered again. */
ORB_MUST_CHECK orb_status orb_trials_rank(orb_trials *trials);

/* The number of the trial of least cost. */
int32_t orb_trials_best(const orb_trials *trials);

/* How much the best trial bends the shapes: the mean of both directions. */
double orb_trials_bend(const orb_trials *trials);

/* Whether that is more than ORB_FIND_EXTENDS, so that trials are improved. */
int orb_trials_bend_much(const orb_trials *trials);

/* Lists the best trial and, in order, those that take the first copy elsewhere than it and than each other by more than
 * a share of the diagonal, and that no landmarks contradict. list: room for `most`. Returns how many. */
int32_t orb_trials_differing(const orb_trials *trials, double apart, int32_t most, int32_t *list);

/* Fills list by orb_trials_differing(). */
void orb_trials_list(orb_trials *trials);

/* Registers trial `number` in the second direction, and sets its cost by both. */
ORB_MUST_CHECK orb_status orb_trials_complete(orb_context *ctx, orb_trials *trials, int32_t number);

/* Registers a trial of these copies in direction s, along its maps: fills its pose, its bend, and what else that
 * tells. Both copies must have been surveyed. May run beside others.
 */
ORB_MUST_CHECK orb_status orb_trial_register(orb_context *ctx, const orb_trials *trials, orb_trial *one, int s);

/* The same in both directions, one after the other. */
ORB_MUST_CHECK orb_status orb_trial_register_both(orb_context *ctx, const orb_trials *trials, orb_trial *one);

/* The vertices of the other copy on which pose s takes those of copy s. */
void orb_trial_images(const orb_trials *trials, const orb_trial *one, int s, int32_t *out);

/* Whether pose s of a trial takes the first few landmarks to their partners. */
int orb_trial_keeps_hint(const orb_trials *trials, const orb_trial *one, int s);

/* Sets the cost of a trial by the first direction or by both, which must have been registered. By both, it drops a
 * trial neither of whose poses takes the landmarks to their partners. */
void orb_trial_fill_cost(const orb_trials *trials, orb_trial *one, int directions);

/* Room for a pose of a mesh; free it in any case. */
ORB_MUST_CHECK orb_status orb_trial_pose_create(orb_context *ctx, const orb_mesh *mesh, orb_elastic_pose *out);
void orb_trial_pose_free(orb_context *ctx, orb_elastic_pose *pose);

/* Frees the poses of a trial and its own maps, and empties it. */
void orb_trial_free(orb_context *ctx, orb_trial *one);

#endif
