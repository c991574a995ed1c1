/* The symmetry of a creature whose mirror plane is known, and trials that do not keep it. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "align/find/crossed.h"
#include "align/find/extended.h"
#include "align/find/mirrored.h"
#include "align/find/raised.h"
#include "base/check.h"
#include "support_align.h"
#include "support_context.h"
#include "support_shapes.h"
#include "support_trials.h"

enum { LIMBS = 5, TWIN = 1, MIDDLE = 4 };

/* Two pairs of limbs and one in the middle: the plane x = 0 is that of the symmetry. */
static const double limb[LIMBS][3] = {
    {0.8, -0.6, 0}, {-0.8, -0.6, 0}, {0.6, 0.64, 0.48}, {-0.6, 0.64, 0.48}, {0, 0, -1}};
static const double reach[LIMBS] = {3.5, 3.5, 2.5, 2.5, 3};
/* Limbs without a symmetry: of unlike lengths. */
static const double odd_limb[LIMBS][3] = {
    {1, 0, 0}, {-0.6, 0.8, 0}, {0, -0.8, 0.6}, {-0.48, -0.6, -0.64}, {0, 0.28, 0.96}};
static const double odd_reach[LIMBS] = {6, 5, 4, 3, 3.5};

static orb_status prepare(scene *s, orb_context *of) {
  ORB_TRY(scene_survey(s, of));
  ORB_TRY(orb_trials_make(&s->small));
  return orb_trials_find_symmetries(&s->small);
}

/* Trials between the creature and a coarser mesh of it, and their symmetries. */
static void scene_open(scene *s) {
  memset(s, 0, sizeof *s);
  s->mesh[0] = shape_creature(ctx, LIMBS, limb, reach, 4);
  s->mesh[1] = shape_creature(ctx, LIMBS, limb, reach, 3);
  assert_int_equal(prepare(s, ctx), ORB_OK);
}

static double distance(const double *p, const double *q) {
  return hypot(hypot(p[0] - q[0], p[1] - q[1]), p[2] - q[2]);
}

/* The limb nearest to a point, or −1: none is within the distance of the end of one. */
static int limb_at(const orb_mesh *mesh, const double p[3], double within) {
  int best = -1;
  for (int i = 0; i < LIMBS; i++) {
    const double d = distance(mesh->positions + 3 * (size_t)shape_farthest(mesh, limb[i]), p);
    best = d < within ? i : best;
    within = fmin(d, within);
  }
  return best;
}

/* The mirror image of each vertex is nearest to x → −x, within the length of an edge or two in the mean. */
static void symmetry_is_found(void **state) {
  (void)state;
  scene s;
  scene_open(&s);
  for (int k = 0; k < 2; k++) {
    const orb_mesh *mesh = &s.small.copy[k].mesh;
    double sum = 0;
    assert_true(s.small.symmetry[k].count > 0);
    for (int32_t v = 0; v < mesh->vertex_count; v++) {
      const double *p = mesh->positions + 3 * (size_t)v;
      const double mirrored[3] = {-p[0], p[1], p[2]};
      sum += distance(mirrored, mesh->positions + 3 * (size_t)s.small.symmetry[k].image[0][v]) / mesh->vertex_count;
    }
    assert_true(sum < 0.2); /* the copy has the area of the unit sphere; its limbs lie apart by more than 1 */
  }
  scene_close(&s);
}

/* Replaces all trials by one that leaves every vertex in place, or exchanges two limbs. */
static orb_trial *only_trial(scene *s, int from, int to) {
  orb_trials *t = &s->small;
  for (int32_t i = 0; i < t->count; i++) {
    orb_trial_free(ctx, &t->trial[i]);
  }
  t->count = 1;
  orb_trial *one = &t->trial[0];
  assert_int_equal(orb_trial_create(ctx, t, one), ORB_OK);
  for (int k = 0; k < 2; k++) {
    const orb_mesh *mesh = &t->copy[k].mesh;
    memcpy(one->pose[k].position, mesh->positions, 3 * (size_t)mesh->vertex_count * sizeof(double));
    one->bend[k] = 0.3;
    for (int32_t v = 0; v < mesh->vertex_count && from != to; v++) {
      double *p = one->pose[k].position + 3 * (size_t)v;
      const int at = limb_at(mesh, p, 1);
      if (at == from || at == to) {
        memcpy(p, mesh->positions + 3 * (size_t)shape_farthest(mesh, limb[at == from ? to : from]), sizeof(double[3]));
      }
    }
  }
  one->cost = one->rough = 0.3;
  return one;
}

/* A map that keeps the symmetry is off by what copies differ. One that exchanges a paired limb with the one in the
 * middle is off by far more, and costs more. */
static void wrong_limbs_are_asymmetric(void **state) {
  (void)state;
  scene s;
  scene_open(&s);
  const orb_trial *one = only_trial(&s, 0, 0);
  assert_int_equal(orb_trials_weigh_asymmetry(&s.small, &s.small), ORB_OK);
  const double right = one->asymmetry, cost = one->cost;
  one = only_trial(&s, TWIN, MIDDLE);
  assert_int_equal(orb_trials_weigh_asymmetry(&s.small, &s.small), ORB_OK);
  assert_true(right < 0.2);
  assert_true(one->asymmetry > 2 * right && one->asymmetry > 0.3);
  assert_true(one->cost > 1.2 * cost); /* neither bends the copies more, nor rotates them by as much */
  one = only_trial(&s, 0, TWIN);       /* left and right exchanged keeps the symmetry */
  assert_int_equal(orb_trials_weigh_asymmetry(&s.small, &s.small), ORB_OK);
  assert_true(one->asymmetry < 0.3);
  scene_close(&s);
}

/* Mirrored from the side that is right, a trial with a paired limb and the middle one exchanged becomes right. */
static void right_side_mends_the_wrong_one(void **state) {
  (void)state;
  scene s;
  scene_open(&s);
  only_trial(&s, TWIN, MIDDLE);
  assert_int_equal(orb_trials_weigh_asymmetry(&s.small, &s.small), ORB_OK);
  assert_int_equal(orb_trials_mirror(&s.small), ORB_OK);
  const orb_trial *one = &s.small.trial[0];
  for (int k = 0; k < 2; k++) {
    const orb_mesh *mesh = &s.small.copy[k].mesh, *other = &s.small.copy[1 - k].mesh;
    for (int i = 0; i < LIMBS; i++) {
      const double *end = one->pose[k].position + 3 * (size_t)shape_farthest(mesh, limb[i]);
      assert_int_equal(limb_at(other, end, 1), i);
    }
  }
  assert_true(one->asymmetry < 0.2 && (one->bend[0] + one->bend[1]) / 2 < 0.1);
  scene_close(&s);
}

/* Where one of the shapes has no symmetry, nothing is weighed or mirrored. */
static void nothing_happens_without_symmetry(void **state) {
  (void)state;
  scene s;
  scene_open(&s);
  orb_symmetry_free(ctx, &s.small.symmetry[1]);
  const orb_trial *one = only_trial(&s, TWIN, MIDDLE);
  assert_int_equal(orb_trials_weigh_asymmetry(&s.small, &s.small), ORB_OK);
  assert_int_equal(orb_trials_mirror(&s.small), ORB_OK);
  assert_true(one->asymmetry == 0 && one->cost == 0.3);
  scene_close(&s);
}

/* A creature without a symmetry has none, though it has maps to itself that reverse orientation. */
static void odd_creature_has_none(void **state) {
  (void)state;
  scene s = {0};
  s.mesh[0] = shape_creature(ctx, LIMBS, odd_limb, odd_reach, 4);
  s.mesh[1] = shape_creature(ctx, LIMBS, limb, reach, 4);
  assert_int_equal(prepare(&s, ctx), ORB_OK);
  assert_int_equal(s.small.symmetry[0].count, 0);
  assert_true(s.small.symmetry[1].count > 0);
  assert_false(orb_trials_are_symmetric(&s.small));
  scene_close(&s);
}

/* All that makes, mirrors and raises trials. */
static orb_status search(scene *s, orb_context *of) {
  ORB_TRY(prepare(s, of));
  ORB_TRY(orb_trials_rank(&s->small));
  ORB_TRY(orb_trials_extend(&s->small));
  ORB_TRY(orb_trials_cross(&s->small));
  ORB_TRY(orb_trials_weigh_asymmetry(&s->small, &s->small));
  ORB_TRY(orb_trials_mirror(&s->small));
  ORB_TRY(orb_trials_raise(&s->small, &s->coarse));
  ORB_TRY(orb_trials_rank(&s->coarse));
  return orb_trials_weigh_asymmetry(&s->small, &s->coarse);
}

/* A creature of other proportions, so that nothing is left out. */
static void stretched_open(scene *s) {
  static const double stretched[LIMBS] = {8, 8, 1.4, 1.4, 1.5};
  memset(s, 0, sizeof *s);
  s->mesh[0] = shape_creature(ctx, LIMBS, limb, reach, 3);
  s->mesh[1] = shape_creature(ctx, LIMBS, limb, stretched, 3);
}

/* One thread and three find the same trials. */
static void threads_change_nothing(void **state) {
  (void)state;
  if (IS_SLOW) {
    skip(); /* the release build compares numbers of threads */
  }
  const orb_context_options options = {.threads = 3};
  scene one, other;
  orb_context *three;
  stretched_open(&one);
  other = one;
  assert_int_equal(orb_context_create(&options, &three), ORB_OK);
  assert_int_equal(search(&one, ctx), ORB_OK);
  assert_int_equal(search(&other, three), ORB_OK);
  assert_true(orb_trials_are_symmetric(&one.small));
  assert_true(orb_trials_bend(&one.small) > ORB_FIND_EXTENDS);
  assert_int_equal(one.coarse.count, other.coarse.count);
  for (int32_t i = 0; i < one.coarse.count; i++) {
    const orb_trial *x = &one.coarse.trial[i], *y = &other.coarse.trial[i];
    assert_memory_equal(&x->cost, &y->cost, sizeof x->cost);
    assert_memory_equal(&x->asymmetry, &y->asymmetry, sizeof x->asymmetry);
    assert_memory_equal(x->pose[0].position, y->pose[0].position,
                        3 * (size_t)one.coarse.copy[0].mesh.vertex_count * sizeof(double));
  }
  scene_close_trials(&other);
  orb_context_destroy(three);
  scene_close(&one);
}

typedef struct rationed {
  int64_t left, calls; /* until an allocation fails, and made */
} rationed;

static void *alloc_or_fail(void *arg, size_t size) {
  rationed *r = arg;
  r->calls++;
  return r->left-- == 0 ? NULL : malloc(size);
}

static void free_it(void *arg, void *block) {
  (void)arg;
  free(block);
}

/* Searches with an allocator that fails at call `at`. Returns how many calls there were. */
static int64_t search_rationed(scene *s, int64_t at, orb_status *status) {
  rationed ration = {at, 0};
  const orb_context_options options = {.threads = 1, .allocator = {alloc_or_fail, free_it, &ration}};
  orb_context *of;
  assert_int_equal(orb_context_create(&options, &of), ORB_OK);
  *status = search(s, of);
  scene_close_trials(s);
  memset(&s->coarse, 0, sizeof s->coarse);
  memset(&s->small, 0, sizeof s->small);
  orb_context_destroy(of); /* it checks that nothing is left */
  return ration.calls;
}

/* An allocation fails somewhere: that is reported, and nothing is left behind. Every 1499th of the calls, since there
 * are thousands. */
static void memory_runs_out(void **state) {
  (void)state;
  enum { STEP = 1499 };
  scene s;
  orb_status status;
  stretched_open(&s);
  const int64_t calls = search_rationed(&s, INT64_MAX, &status);
  assert_int_equal(status, ORB_OK);
  assert_true(calls > 3 * STEP);
  for (int64_t at = 1; at < calls; at += STEP) { /* the allocation of the context comes before these */
    (void)search_rationed(&s, at, &status);
    assert_int_equal(status, ORB_E_NO_MEMORY);
  }
  scene_close(&s);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(symmetry_is_found),
                                     cmocka_unit_test(nothing_happens_without_symmetry),
                                     cmocka_unit_test(odd_creature_has_none),
                                     cmocka_unit_test(threads_change_nothing),
                                     cmocka_unit_test(memory_runs_out),
                                     cmocka_unit_test(wrong_limbs_are_asymmetric),
                                     cmocka_unit_test(right_side_mends_the_wrong_one)};
  return cmocka_run_group_tests(tests, context_one_thread, context_end);
}
