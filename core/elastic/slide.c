/* A slide differs from other registrations in three things. An edge should be what rotations and smoothed stretches
 * make of it (stretch.h): bodies that differ in girth otherwise drift along each other until their lengths agree. And
 * it looks for places ahead of where the mesh is, on the way that it took in the last round (momentum; Nesterov 1983).
 * A place is where the vertex is already, except for its distance from the surface, so a pull moves it along the
 * surface by little in each round. What else moves it along the surface is the relief (relief.h): normals of a limb
 * hardly tell how far along the limb and around it a vertex belongs, but its muscles do. A limb that begins far away
 * takes more rounds than others, so a slide goes on while it moves.
 *
 * Rejected: most rounds on copies of 2,000 vertices, and the last two on the meshes. On 54 pairs with 8 landmarks that
 * takes 3 % less time, and places are 2 % farther from the truth. */
#include "elastic/slide.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "base/tasks.h"
#include "elastic/rounds.h"
#include "numeric/vec3.h"

/* Lengths are those of surfaces of area 4π. Chosen by trial on the pairs of the half `choose` of
 * tests/bench/correspond.py, unless a line gives another reason. */
enum {
  ROUNDS = 10,     /* in which the reach shrinks. More bring others no nearer to the truth, */
  ROUNDS_MOST = 40 /* but one that still moves goes on: a leg that began a tenth of the body away took 31 */
};
/* Distance at which a pull is as strong as the edges. A slide follows the relief as far as the last reach lets it: with
 * 0.06 people stay a twentieth farther from the truth. First ones of 0.2 to 0.6 are as good. */
static const double FIRST_REACH = 0.3, LAST_REACH = 0.12;
/* A slide moves while more than this share of the surface has gone farther than this in the last round. With 0.1, a leg
 * of emmy-armsup to emmy-sidebend stops half-way. With 0.02, most slides take a few rounds more, in vain. */
static const double MOVING_SHARE = 0.05, MOVING = 0.01;
/* Shapes that a slide bends more than this do not fit each other, and it ends. If it does so only after ROUNDS, the
 * shapes fit, and where it has come to counts: a horse that runs came to 0.101 after 14 rounds. Of 57 slides of
 * animals, the 40 that led to a map came to 0.08 at most. Of the others, 12 had more than this after the first round
 * and 15 after ten; they went on for 30 rounds more, in vain. The map itself may bend them more: the slide of a giraffe
 * that sits down then still takes a third off its error. */
static const double BEND_MOST = 0.1;

/* Shapes whose reliefs differ by more than this (orb_relief_noise()) at the start do not fit each other either: the
 * bumps and hollows of one say nothing of the other's. Of 255 slides of people and animals, of both halves, those that
 * led to a map began with 0.36 at most. Of five other pairs, which began with 0.41 to 0.48, one came nearer to its true
 * landmarks, with 0.41. A cube with bumps on a round one began with 0.45, and went twice as far from them. */
static const double NOISE_MOST = 0.43;

/* What a slide needs besides a registration. */
typedef struct slide {
  orb_registration r;
  orb_stretch stretch;
  orb_relief relief[2]; /* of a and b */
  double grain;
} slide;

static orb_status create_relief(orb_context *ctx, void *arg, int32_t i) {
  slide *s = arg;
  return orb_relief_create(ctx, i == 0 ? &s->r.a : &s->r.b, s->grain, &s->relief[i]);
}

static orb_status prepare_slide(slide *s) {
  orb_registration *r = &s->r;
  const size_t n = 3 * (size_t)r->a.count;
  ORB_TRY(orb_stretch_create(r->ctx, &r->a, &s->stretch));
  r->stretch = &s->stretch;
  r->ahead = ORB_NEW(r->ctx, double, n);
  r->last = ORB_NEW(r->ctx, double, n);
  if (!r->ahead || !r->last) {
    return ORB_E_NO_MEMORY;
  }
  memcpy(r->last, r->pose->position, n * sizeof *r->last);
  s->grain = orb_relief_grain(&r->a, &r->b);
  r->relief = s->relief;
  return orb_tasks_run(r->ctx, 2, create_relief, s);
}

/* Has the last round of a slide moved much of it? */
static int is_moving(const orb_registration *r) {
  double all = 0, moving = 0;
  for (int32_t v = 0; v < r->a.count; v++) {
    const double far2 = orb_distance2(r->last + 3 * (size_t)v, r->pose->position + 3 * (size_t)v);
    all += r->a.mass[v];
    moving += far2 > MOVING * MOVING ? r->a.mass[v] : 0;
  }
  return moving > MOVING_SHARE * all;
}

static orb_status run_slide(orb_registration *r, int *fits) {
  int goes_on = 1;
  orb_registration_fit(r);
  for (int i = 0; i < ROUNDS_MOST && goes_on; i++) {
    const double done = fmin(1, (double)i / (ROUNDS - 1));
    ORB_TRY(orb_registration_round(r, done, FIRST_REACH * pow(LAST_REACH / FIRST_REACH, done)));
    const int bends_little = orb_registration_bend(r) <= BEND_MOST, is_alike = i > 0 || r->noise <= NOISE_MOST;
    *fits = is_alike && (bends_little || i >= ROUNDS);
    goes_on = is_alike && bends_little && (i < ROUNDS - 1 || is_moving(r));
  }
  return ORB_OK;
}

orb_status orb_elastic_slide(orb_context *ctx, const orb_mesh *a, const orb_mesh *b, const orb_elastic_anchors *anchors,
                             double *position, int *fits) {
  orb_elastic_pose pose = {.position = position, .rotation = ORB_NEW(ctx, double, 9 * (size_t)a->vertex_count)};
  slide s = {.r = {.ctx = ctx, .anchors = anchors, .pose = &pose, .is_alone = 1}};
  orb_status status = pose.rotation ? ORB_OK : ORB_E_NO_MEMORY;
  if (status != ORB_OK) {
    return status;
  }
  ORB_GO(status, orb_registration_create(ctx, a, b, &s.r), end);
  ORB_GO(status, prepare_slide(&s), end);
  status = run_slide(&s.r, fits);
end:
  orb_registration_free(&s.r);
  orb_stretch_free(ctx, &s.stretch);
  orb_relief_free(ctx, s.relief);
  orb_relief_free(ctx, s.relief + 1);
  orb_free(ctx, pose.rotation);
  return status;
}
