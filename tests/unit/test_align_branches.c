/* Matches of tips by how limbs branch: on trees whose paths are known, and on creatures. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#include "align/find/branched.h"
#include "align/find/branches.h"
#include "align/find/params.h"
#include "base/memory.h"
#include "support_context.h"
#include "support_shapes.h"
#include "support_trials.h"

enum { LIMBS = 5, WAYS = 120 };

/* Five directions of no symmetry. */
static const double limb[LIMBS][3] = {{1, 0, 0}, {-0.6, 0.8, 0}, {0, -0.8, 0.6}, {-0.48, -0.6, -0.64}, {0, 0.28, 0.96}};

/* Tips of a tree: limbs 0 and 1 branch off together, then limb 2, then limbs 3 and 4; the trunk is 1.5 and 0.8 long
 * between. The limbs have these lengths, and the tips these numbers. */
static orb_tips tree(const double length[LIMBS], const int number[LIMBS]) {
  static const double trunk[LIMBS] = {0, 0, 1.5, 2.3, 2.3};
  orb_tips tips = {.count = LIMBS};
  for (int i = 0; i < LIMBS; i++) {
    memcpy(tips.point[number[i]], limb[i], sizeof limb[i]);
    for (int k = 0; k < LIMBS; k++) {
      tips.apart[number[i]][number[k]] = i == k ? 0 : length[i] + length[k] + fabs(trunk[i] - trunk[k]);
    }
  }
  return tips;
}

static const double long_arms[LIMBS] = {3, 2.9, 0.7, 1.2, 1.1}, long_legs[LIMBS] = {1.4, 1.3, 0.6, 2.7, 2.8};
static const int in_order[LIMBS] = {0, 1, 2, 3, 4}, mixed[LIMBS] = {3, 0, 4, 2, 1};

/* The long arms of one go to the short arms of the other, and not to its legs, which are as long. Both arms branch off
 * alike, and so do both legs: that makes four matches whose trunks agree. The spheres tell which comes first. */
static void branches_do_not_depend_on_lengths(void **state) {
  (void)state;
  const orb_tips first = tree(long_arms, in_order), second = tree(long_legs, mixed);
  orb_tip_match match[5];
  assert_int_equal(orb_branches_match(&first, &second, 5, match), 5);
  for (int i = 0; i < LIMBS; i++) {
    assert_int_equal(match[0].to[i], mixed[i]);
  }
  assert_true(match[0].cost < 1e-6);
  for (int n = 0; n < 4; n++) {
    const int32_t *to = match[n].to;
    assert_true(to[2] == mixed[2] && (to[0] == mixed[0] || to[0] == mixed[1]) &&
                (to[3] == mixed[3] || to[3] == mixed[4]));
    assert_true(n == 0 || match[n].cost >= match[n - 1].cost);
  }
  const double angle = ORB_FIND_BRANCH_ANGLE * orb_tip_match_angle(&first, &second, &match[4]);
  assert_true(match[4].cost - angle > 0.1); /* its trunks differ by a tenth and more in the mean */
}

/* All ways are tried, each once. */
static void all_ways_are_tried(void **state) {
  (void)state;
  const orb_tips first = tree(long_arms, in_order), second = tree(long_legs, mixed);
  static orb_tip_match match[WAYS + 1];
  assert_int_equal(orb_branches_match(&first, &second, WAYS + 1, match), WAYS);
  for (int n = 0; n < WAYS; n++) {
    int taken[LIMBS] = {0};
    for (int i = 0; i < LIMBS; i++) {
      assert_in_range(match[n].to[i], 0, LIMBS - 1);
      assert_int_equal(taken[match[n].to[i]]++, 0);
    }
  }
}

/* Where one shape has a tip more, it is the one that is left over, on either side: a tail. With fewer than four tips
 * nothing branches. */
static void a_tip_is_left_over(void **state) {
  (void)state;
  const orb_tips whole = tree(long_arms, in_order);
  orb_tips fewer = tree(long_legs, in_order);
  orb_tip_match match;
  fewer.count = LIMBS - 1;
  for (int swapped = 0; swapped < 2; swapped++) {
    const orb_tips *first = swapped ? &fewer : &whole, *second = swapped ? &whole : &fewer;
    assert_int_equal(orb_branches_match(first, second, 1, &match), 1);
    assert_int_equal(match.count, LIMBS - 1);
    for (int i = 0; i < ORB_TIPS_MAX; i++) {
      assert_int_equal(match.to[i], i < LIMBS - 1 ? i : -1);
    }
  }
  fewer.count = 3;
  assert_int_equal(orb_branches_match(&whole, &fewer, 1, &match), 0);
}

/* A knee branches off where its foot does. Here the knee lies at the place of the other shape's foot, and still the
 * foot gets the partner: its limb is longer. */
static void a_knee_is_left_over(void **state) {
  (void)state;
  enum { KNEE = LIMBS, FOOT = 3 };
  const double from_foot = 0.6, sticks_out = 0.15;
  const orb_tips whole = tree(long_arms, in_order);
  orb_tips sits = tree(long_legs, in_order);
  sits.count = LIMBS + 1;
  for (int i = 0; i < LIMBS; i++) {
    const double apart = sits.apart[FOOT][i] - from_foot + sticks_out;
    sits.apart[KNEE][i] = sits.apart[i][KNEE] = i == FOOT ? from_foot + sticks_out : apart;
  }
  memcpy(sits.point[KNEE], sits.point[FOOT], sizeof sits.point[KNEE]);
  memcpy(sits.point[FOOT], (double[3]){0.48, -0.6, -0.64}, sizeof sits.point[FOOT]);
  for (int swapped = 0; swapped < 2; swapped++) {
    orb_tip_match match;
    assert_int_equal(orb_branches_match(swapped ? &sits : &whole, swapped ? &whole : &sits, 1, &match), 1);
    assert_int_equal(match.count, LIMBS);
    for (int i = 0; i < LIMBS; i++) {
      assert_int_equal(match.to[i], i);
    }
    assert_int_equal(match.to[KNEE], -1);
  }
}

/* A map with less is right: with two limbs swapped it is off by 0.9, and upside down by 2. */
static const double RIGHT = 0.6;

/* Two creatures with a trunk. Two arms and a head are at one end of it, two legs at the other one. One has long arms
 * and short legs, the other one the reverse. */
static void scene_open(scene *s) {
  static const double body[LIMBS][3] = {
      {0.8, 0.15, 0.58}, {-0.78, 0.2, 0.59}, {0, -0.1, 0.995}, {0.6, 0.1, -0.79}, {-0.6, 0.15, -0.785}};
  static const double reach[2][LIMBS] = {{3, 2.9, 2.6, 1.7, 1.8}, {2, 1.9, 2.7, 2.6, 2.7}}, trunk = 2.5;
  memset(s, 0, sizeof *s);
  for (int k = 0; k < 2; k++) {
    s->mesh[k] = shape_creature(ctx, LIMBS, body, reach[k], 4);
    for (int32_t v = 0; v < s->mesh[k].vertex_count; v++) {
      s->mesh[k].positions[3 * (size_t)v + 2] *= trunk;
    }
  }
  assert_int_equal(scene_survey(s, ctx), ORB_OK);
}

/* The mean distance of where a map takes the vertices of the small copy of shape k from their true places, in radii of
 * a ball of the shapes' area. Both creatures have vertices of the same numbers. */
static double off_truth(const scene *s, int k, const int32_t *map) {
  const orb_trial_scaling *scaling = &s->coarse.scaling[1 - k];
  const orb_coarse_copy *copy = &s->small.copy[k];
  double sum = 0;
  for (int32_t v = 0; v < copy->mesh.vertex_count; v++) {
    const int32_t vertex = s->coarse.copy[k].vertex[copy->vertex[v]];
    const double *image = s->small.copy[1 - k].mesh.positions + 3 * (size_t)map[v];
    double d = 0;
    for (int c = 0; c < 3; c++) {
      const double truth = s->mesh[1 - k].positions[3 * (size_t)vertex + (size_t)c];
      d += pow(image[c] - (truth - scaling->middle[c]) * scaling->scale, 2);
    }
    sum += sqrt(d) / copy->mesh.vertex_count;
  }
  return sum;
}

/* The rough map of the best match takes each place to the same share of its limb, in both directions. */
static void places_along_limbs_correspond(void **state) {
  (void)state;
  scene s;
  orb_tips tips[2];
  orb_branches both[2];
  orb_tip_match match;
  int32_t *map[2];
  scene_open(&s);
  for (int k = 0; k < 2; k++) {
    assert_int_equal(orb_tips_find(ctx, &s.small.copy[k], &s.small.survey[k], &tips[k]), ORB_OK);
    both[k] = (orb_branches){&s.small.copy[k], &s.small.survey[k], &tips[k]};
    map[k] = orb_alloc(ctx, (size_t)s.small.copy[k].mesh.vertex_count, sizeof(int32_t));
    assert_non_null(map[k]);
  }
  assert_int_equal(orb_branches_match(&tips[0], &tips[1], 1, &match), 1);
  assert_int_equal(orb_branches_map(ctx, both, &match, map), ORB_OK);
  for (int k = 0; k < 2; k++) {
    assert_true(off_truth(&s, k, map[k]) < RIGHT);
    for (int32_t i = 0; i < tips[k].count; i++) {
      const int32_t own = k == 0 ? i : match.to[i], its = k == 0 ? match.to[i] : i;
      assert_int_equal(map[k][tips[k].vertex[own]], tips[1 - k].vertex[its]);
    }
    orb_free(ctx, map[k]);
  }
  scene_close(&s);
}

/* Trials of such matches are added to the others, registered. The best of them has every limb right. One that costs far
 * more than the best trial is not added, nor one that takes landmarks elsewhere. */
static void trials_are_added(void **state) {
  (void)state;
  scene s;
  scene_open(&s);
  orb_trials *t = &s.small;
  assert_int_equal(orb_trials_make(t), ORB_OK);
  assert_int_equal(orb_trials_rank(t), ORB_OK);
  const int32_t before = t->count;
  assert_int_equal(orb_trials_branch(t), ORB_OK);
  assert_in_range(t->count, before + 1, before + ORB_FIND_BRANCHED);
  int32_t best = before;
  for (int32_t i = before; i < t->count; i++) {
    assert_true(t->trial[i].cost < INFINITY && t->trial[i].own[0] && t->trial[i].pose[1].position);
    best = t->trial[i].cost < t->trial[best].cost ? i : best;
  }
  assert_true(off_truth(&s, 0, t->trial[best].own[0]) < RIGHT && off_truth(&s, 1, t->trial[best].own[1]) < RIGHT);
  t->trial[0].cost = t->trial[best].cost / 10;
  t->count = before;
  for (int32_t i = before; i < ORB_TRIALS_MAX; i++) {
    orb_trial_free(ctx, &t->trial[i]);
  }
  assert_int_equal(orb_trials_branch(t), ORB_OK);
  assert_int_equal(t->count, before);
  scene_close(&s);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(branches_do_not_depend_on_lengths),
                                     cmocka_unit_test(all_ways_are_tried),
                                     cmocka_unit_test(a_tip_is_left_over),
                                     cmocka_unit_test(a_knee_is_left_over),
                                     cmocka_unit_test(places_along_limbs_correspond),
                                     cmocka_unit_test(trials_are_added)};
  return cmocka_run_group_tests(tests, context_one_thread, context_end);
}
