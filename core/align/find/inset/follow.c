#include "align/find/inset/follow.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/context.h"
#include "base/memory.h"
#include "numeric/vec3.h"

/* A place of the small shape on the large one. */
typedef struct tried {
  orb_similarity at;
  double score; /* mean weight of its closest points; 0: left */
} tried;

/* Follows closest points once, with the first `count` samples. near: NULL, then feet on the planes of the grid stand
 * for the nearest places; or a place for each sample, see orb_inset_nearest(). moves 0: measures only. Returns the mean
 * weight before, or 0 if there is no way on. */
static double follow(const orb_inset_pair *c, int32_t count, double width, int moves, orb_place *near,
                     orb_similarity *s) {
  orb_similarity_sums sum;
  memset(&sum, 0, sizeof sum);
  for (int32_t i = 0; i < count; i++) {
    const orb_inset_sample *x = &c->sample[i];
    double p[3], at[3], own[3], other[3];
    orb_similarity_apply(s, x->position, p);
    orb_rotate_point(s->rotation, x->normal, own);
    const double off = near ? orb_inset_nearest(c->large, c->tree, p, &near[i], at, other)
                            : orb_inset_grid_foot(c->grid, p, at, other);
    const double facing = off < INFINITY ? orb_dot(own, other) : 0;
    if (facing > 0) {
      orb_similarity_add(&sum, facing * exp(-off * off / (2 * width * width)), x->position, at);
    }
  }
  const double score = sum.weight / count;
  if (!moves) {
    return score;
  }
  return orb_similarity_solve(&sum, s) && s->scale > ORB_FIND_INSET_LOST_BELOW && s->scale < 1 ? score : 0;
}

/* How far two places of the part are apart. */
static double apart(const orb_similarity *a, const orb_similarity *b) {
  double trace = 0;
  for (int i = 0; i < 9; i++) {
    trace += a->rotation[i] * b->rotation[i];
  }
  return sqrt(orb_distance2(a->shift, b->shift)) / fmin(a->scale, b->scale) + acos(fmax(-1, fmin(1, (trace - 1) / 2)));
}

/* Moves the best places that differ to the front, at most `most`. Returns how many. */
static int32_t take_best(tried *all, int32_t count, int32_t most) {
  int32_t taken = 0;
  while (taken < most) {
    int32_t best = -1;
    for (int32_t i = taken; i < count; i++) {
      best = all[i].score > (best < 0 ? 0 : all[best].score) ? i : best;
    }
    if (best < 0) {
      break;
    }
    int is_new = 1;
    for (int32_t k = 0; k < taken && is_new; k++) {
      is_new = apart(&all[k].at, &all[best].at) > ORB_FIND_INSET_SAME;
    }
    const tried one = all[best];
    all[best] = is_new ? all[taken] : all[--count];
    if (is_new) {
      all[taken++] = one;
    }
  }
  return taken;
}

/* Turns the best places about their middles. A head that lies at the right place at a wrong turn would stay there by
 * closest points. Returns how many places there are then. */
static int32_t turn_again(const orb_inset_pair *c, double width, tried *all, int32_t count) {
  double turn[ORB_INSET_FINE_TURNS][9];
  const int32_t of = take_best(all, count, ORB_FIND_INSET_TURNED);
  orb_inset_fine_turns(turn);
  count = of;
  for (int32_t i = 0; i < of; i++) {
    for (int t = 0; t < ORB_INSET_FINE_TURNS; t++) {
      tried *one = &all[count++];
      *one = all[i];
      for (int k = 0; k < 9; k++) {
        const double *row = all[i].at.rotation + k / 3 * 3, *column = turn[t] + k % 3;
        one->at.rotation[k] = row[0] * column[0] + row[1] * column[3] + row[2] * column[6];
      }
      one->score = follow(c, ORB_FIND_INSET_LOOKUPS, width, 0, NULL, &one->at);
    }
  }
  return count;
}

/* Does every landmark end near its partner? */
static int keeps_landmarks(const orb_inset_pair *c, const orb_similarity *at) {
  for (size_t i = 0; i < (size_t)c->landmark_count; i++) {
    double p[3];
    orb_similarity_apply(at, c->landmark[0] + 3 * i, p);
    if (sqrt(orb_distance2(p, c->landmark[1] + 3 * i)) > ORB_FIND_INSET_OFF * at->scale) {
      return 0;
    }
  }
  return 1;
}

/* Are points far apart, and not in a row? */
static int fix_turn(const double *at, int32_t count) {
  double far[3] = {0}, most = 0, beside = 0;
  for (int32_t i = 1; i < count; i++) { /* from the first of them: a half of what is farthest, or more */
    double way[3];
    orb_sub(at + 3 * (size_t)i, at, way);
    if (orb_length(way) > most) {
      most = orb_length(way);
      memcpy(far, way, sizeof far);
    }
  }
  for (int32_t i = 1; i < count && most > 0; i++) {
    double way[3], across[3];
    orb_sub(at + 3 * (size_t)i, at, way);
    orb_cross(far, way, across);
    beside = fmax(beside, orb_length(across) / most);
  }
  return most > ORB_FIND_INSET_SPREAD && beside > ORB_FIND_INSET_BESIDE * most;
}

int orb_inset_is_fixed(const orb_inset_pair *c) {
  return fix_turn(c->landmark[0], c->landmark_count) && fix_turn(c->landmark[1], c->landmark_count);
}

int orb_inset_fit(const orb_inset_pair *c, orb_similarity *out) {
  orb_similarity_sums sums = {0};
  for (size_t i = 0; i < (size_t)c->landmark_count; i++) {
    orb_similarity_add(&sums, 1, c->landmark[0] + 3 * i, c->landmark[1] + 3 * i);
  }
  return orb_similarity_solve(&sums, out) && out->scale > ORB_FIND_INSET_LOST_BELOW && out->scale < 1 &&
         keeps_landmarks(c, out);
}

orb_status orb_inset_follow(orb_context *ctx, const orb_inset_pair *c, const orb_similarity *start, int32_t count,
                            orb_similarity *out, double *score) {
  enum { ROOM = ORB_INSET_STARTS_MOST + ORB_FIND_INSET_TURNED * (1 + ORB_INSET_FINE_TURNS) };
  orb_place near[ORB_FIND_INSET_SAMPLES];
  orb_status status = ORB_OK;
  tried *all = ORB_NEW(ctx, tried, ROOM);
  *score = 0;
  if (!all) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t i = 0; i < count; i++) {
    all[i] = (tried){start[i], 1};
  }
  for (int n = 0; n < ORB_FIND_INSET_STAGES; n++) {
    const orb_find_inset_stage *stage = &ORB_FIND_INSET_STAGE[n];
    const int32_t samples = stage->samples < c->sample_count ? stage->samples : c->sample_count;
    const int is_last = n + 1 == ORB_FIND_INSET_STAGES;
    count = stage->turns ? turn_again(c, stage->width, all, count) : count;
    count = stage->places > 0 ? take_best(all, count, stage->places) : count;
    for (int32_t i = 0; i < count; i++) {
      for (int32_t k = 0; k < samples && is_last; k++) {
        near[k].triangle = -1;
      }
      for (int r = 0; r < stage->rounds && all[i].score > 0; r++) {
        all[i].score = follow(c, samples, stage->width, 1, is_last ? near : NULL, &all[i].at);
      }
      all[i].score = n == 0 || keeps_landmarks(c, &all[i].at) ? all[i].score : 0;
      ORB_GO(status, orb_context_check(ctx), end);
    }
  }
  if (take_best(all, count, 1) == 1) {
    *out = all[0].at;
    *score = all[0].score;
  }
end:
  orb_free(ctx, all);
  return status;
}
