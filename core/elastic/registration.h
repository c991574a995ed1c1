/* What a registration holds, and the linear system of its rounds. elastic.c says how it works. */
#ifndef ORB_ELASTIC_REGISTRATION_H
#define ORB_ELASTIC_REGISTRATION_H

#include "base/parallel.h"
#include "elastic/body.h"
#include "elastic/pose.h"
#include "elastic/relief.h"
#include "elastic/searched.h"
#include "elastic/stretch.h"
#include "elastic/surroundings.h"
#include "numeric/factor.h"

typedef struct orb_registration {
  orb_context *ctx;
  orb_body a, b;
  const orb_rough_map *map;             /* NULL: none */
  const orb_elastic_anchors *anchors;   /* NULL: none */
  const orb_surroundings *surroundings; /* of a; NULL: they are listed when they are needed */
  orb_factor *factor;
  orb_elastic_pose *pose;
  double *normal; /* of a in its pose */
  orb_searched searched;
  double *diagonal, *right; /* the system */
  double *pull, *target;    /* on each vertex of a: the weight, and the weighted target (3) */
  int32_t *place, *visit; /* of each vertex of a: the nearest one of b; of each vertex of b: the nearest one of a; −1:
                             not yet searched */
  orb_stretch *stretch;   /* NULL: edges are only rotated */
  const orb_relief *relief; /* of a and b; NULL: not known */
  double noise;             /* of the relief, at the places as they are */
  double *ahead, *last;     /* of a slide: where it looks, and where it was in the last round; NULL: none */
  int is_alone; /* its loops are shared with the threads that are free: it is not one of many that run side by side */
} orb_registration;

/* Room for mesh a to be registered to mesh b. The other members of *r are the caller's, from before. Free it in any
 * case.
 */
ORB_MUST_CHECK orb_status orb_registration_create(orb_context *ctx, const orb_mesh *a, const orb_mesh *b,
                                                  orb_registration *r);
void orb_registration_free(orb_registration *r);

/* Runs body over the vertices [0, count): on all threads, if no other registration runs beside this one. */
void orb_registration_loop(orb_registration *r, int32_t count, orb_loop_fn body);

/* Rotations, and stretches where they count, for the positions as they are. */
void orb_registration_fit(orb_registration *r);

/* Pulls of a round: none at first; a vertex of a to a target; all anchors. */
void orb_registration_clear(orb_registration *r);
void orb_registration_pull(orb_registration *r, int32_t v, const double target[3], double weight);
void orb_registration_pull_by_anchors(orb_registration *r);

/* Positions for the rotations and pulls as they are. again: the pulls have other weights than last time. */
ORB_MUST_CHECK orb_status orb_registration_solve(orb_registration *r, int again);

/* Mean squared change of the edges of a against the rotations of their ends, relative to their squared lengths. */
double orb_registration_bend(const orb_registration *r);
/* The same for the edges of one vertex. */
double orb_registration_bend_at(const orb_registration *r, int32_t v);

#endif
