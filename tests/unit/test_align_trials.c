/* Trials of creatures whose limbs are known: their tips, and what each step from small copies to coarse ones does. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#include "align/find/crossed.h"
#include "align/find/extended.h"
#include "align/find/hinted.h"
#include "align/find/open_limbs.h"
#include "align/find/raised.h"
#include "align/find/tips.h"
#include "align/rotate/procrustes.h"
#include "support_context.h"
#include "support_shapes.h"
#include "support_trials.h"

enum { LIMBS = 5 };

/* Five asymmetric directions, and the lengths of the limbs of two creatures each: some longer, some shorter; and of a
 * lean one and a stout one. */
static const double limb[LIMBS][3] = {{1, 0, 0}, {-0.6, 0.8, 0}, {0, -0.8, 0.6}, {-0.48, -0.6, -0.64}, {0, 0.28, 0.96}};
static const double alike[2][LIMBS] = {{4, 3.4, 2.9, 2.5, 2.2}, {3.2, 3.6, 2.3, 3, 2.6}};
static const double unlike[2][LIMBS] = {{6, 5, 4, 3, 3.5}, {1.6, 1.8, 1.4, 1.3, 1.5}};

static void scene_open(scene *s, const double reach[2][LIMBS]) {
  memset(s, 0, sizeof *s);
  for (int k = 0; k < 2; k++) {
    s->mesh[k] = shape_creature(ctx, LIMBS, limb, reach[k], 4);
  }
  assert_int_equal(scene_survey(s, ctx), ORB_OK);
}

/* The limb at whose end a point of a copy lies. */
static int limb_at(const orb_mesh *mesh, const double p[3]) {
  int best = 0;
  double least = INFINITY;
  for (int i = 0; i < LIMBS; i++) {
    const double *tip = mesh->positions + 3 * (size_t)shape_farthest(mesh, limb[i]);
    const double d = hypot(hypot(tip[0] - p[0], tip[1] - p[1]), tip[2] - p[2]);
    best = d < least ? i : best;
    least = fmin(d, least);
  }
  return best;
}

/* The ends of the limbs are the tips, each once. */
static void limbs_end_in_tips(void **state) {
  (void)state;
  scene s;
  scene_open(&s, alike);
  for (int k = 0; k < 2; k++) {
    orb_tips tips;
    int found[LIMBS] = {0};
    assert_int_equal(orb_tips_find(ctx, &s.small.copy[k], &s.small.survey[k], &tips), ORB_OK);
    assert_int_equal(tips.count, LIMBS);
    for (int32_t i = 0; i < tips.count; i++) {
      found[limb_at(&s.small.copy[k].mesh, s.small.copy[k].mesh.positions + 3 * (size_t)tips.vertex[i])]++;
    }
    for (int i = 0; i < LIMBS; i++) {
      assert_int_equal(found[i], 1);
    }
  }
  scene_close(&s);
}

/* The number of open limbs if so many of each shape have a landmark at their end. */
static int32_t open_with(const int told[2]) {
  scene s;
  int32_t open;
  scene_open(&s, alike);
  orb_hint_places *hint = &s.small.hint;
  hint->count = LIMBS;
  for (int k = 0; k < 2; k++) {
    hint->vertex[k] = orb_alloc(ctx, LIMBS, sizeof(int32_t));
    assert_non_null(hint->vertex[k]);
    for (int i = 0; i < LIMBS; i++) { /* the others lie at the end of the first limb, too */
      hint->vertex[k][i] = shape_farthest(&s.small.copy[k].mesh, limb[i < told[k] ? i : 0]);
    }
  }
  assert_int_equal(orb_open_limbs_count(&s.small, &open), ORB_OK);
  scene_close(&s);
  return open;
}

/* A limb is open if its end has no landmark on one of the shapes. */
static void limbs_without_landmarks_are_open(void **state) {
  (void)state;
  assert_int_equal(open_with((const int[2]){LIMBS, LIMBS}), 0);
  assert_int_equal(open_with((const int[2]){3, 3}), LIMBS - 3);
  assert_int_equal(open_with((const int[2]){LIMBS, 1}), LIMBS - 1);
  assert_int_equal(open_with((const int[2]){2, LIMBS}), LIMBS - 2);
}

/* The best match pairs the tips of each limb, whatever their lengths, and takes tips to tips, there and back. */
static void tips_meet_their_partners(void **state) {
  (void)state;
  scene s;
  orb_tips tips[2];
  orb_tip_match match[3];
  const orb_tips *const both[2] = {&tips[0], &tips[1]};
  scene_open(&s, alike);
  for (int k = 0; k < 2; k++) {
    assert_int_equal(orb_tips_find(ctx, &s.small.copy[k], &s.small.survey[k], &tips[k]), ORB_OK);
  }
  const int32_t count = orb_tips_match(&tips[0], &tips[1], 3, match);
  assert_in_range(count, 1, 3);
  assert_int_equal(match[0].count, LIMBS);
  for (int32_t i = 0; i < LIMBS; i++) {
    const int32_t to = match[0].to[i];
    const double *from = s.small.copy[0].mesh.positions + 3 * (size_t)tips[0].vertex[i];
    const double *there = s.small.copy[1].mesh.positions + 3 * (size_t)tips[1].vertex[to];
    double p[3];
    assert_int_equal(limb_at(&s.small.copy[0].mesh, from), limb_at(&s.small.copy[1].mesh, there));
    orb_tip_match_carry(both, &match[0], 0, tips[0].point[i], p);
    assert_true(hypot(hypot(p[0] - tips[1].point[to][0], p[1] - tips[1].point[to][1]), p[2] - tips[1].point[to][2]) <
                0.02);
    orb_tip_match_carry(both, &match[0], 1, tips[1].point[to], p);
    assert_true(hypot(hypot(p[0] - tips[0].point[i][0], p[1] - tips[0].point[i][1]), p[2] - tips[0].point[i][2]) <
                0.02);
  }
  for (int32_t i = 1; i < count; i++) {
    assert_true(match[i - 1].cost <= match[i].cost);
    assert_memory_not_equal(match[i - 1].to, match[i].to, sizeof(int32_t) * LIMBS);
  }
  scene_close(&s);
}

/* Puts a tip at the vertex of its copy that is nearest to it among those that are 0.02 of the diagonal away or more,
 * and a turn further for each `turn`. */
static void shift_tip(const orb_coarse_copy *copy, const orb_survey *survey, orb_tips *tips, int32_t i, int turn) {
  const orb_mesh *mesh = &copy->mesh;
  int32_t nearest = -1, before = -1;
  orb_extent extent;
  orb_mesh_extent(mesh, &extent);
  for (int n = 0; n <= turn; n++) {
    const double least =
        nearest < 0 ? 0.02 * extent.diagonal : orb_survey_apart(survey, mesh, tips->vertex[i], nearest);
    before = nearest;
    nearest = -1;
    for (int32_t v = 0; v < mesh->vertex_count; v++) {
      const double apart = orb_survey_apart(survey, mesh, tips->vertex[i], v);
      const int is_next = v != before && apart >= least;
      nearest =
          is_next && (nearest < 0 || apart < orb_survey_apart(survey, mesh, tips->vertex[i], nearest)) ? v : nearest;
    }
  }
  tips->vertex[i] = nearest;
  memcpy(tips->point[i], copy->points + 3 * (size_t)nearest, sizeof tips->point[i]);
}

/* The tips that a copy has are off by up to an edge, so the match must not depend on that: with each tip of both
 * creatures moved by 0.02 of the diagonal or more, to several sides, each still meets its partner. */
static void shifted_tips_meet_their_partners(void **state) {
  (void)state;
  scene s;
  scene_open(&s, alike);
  for (int turn = 0; turn < 4; turn++) {
    orb_tips tips[2];
    orb_tip_match match;
    int of[2][LIMBS];
    for (int k = 0; k < 2; k++) {
      const orb_coarse_copy *copy = &s.small.copy[k];
      assert_int_equal(orb_tips_find(ctx, copy, &s.small.survey[k], &tips[k]), ORB_OK);
      for (int32_t i = 0; i < tips[k].count; i++) {
        of[k][i] = limb_at(&copy->mesh, copy->mesh.positions + 3 * (size_t)tips[k].vertex[i]);
        shift_tip(copy, &s.small.survey[k], &tips[k], i, (turn + i + k) % 4);
      }
      for (int32_t i = 0; i < tips[k].count; i++) {
        for (int32_t n = 0; n < i; n++) {
          const double apart = orb_survey_apart(&s.small.survey[k], &copy->mesh, tips[k].vertex[i], tips[k].vertex[n]);
          tips[k].log_apart[i][n] = tips[k].log_apart[n][i] = log(apart + ORB_FIND_AGREED_EDGE);
        }
      }
    }
    assert_int_equal(orb_tips_match(&tips[0], &tips[1], 1, &match), 1);
    assert_int_equal(match.count, LIMBS);
    for (int32_t i = 0; i < LIMBS; i++) {
      assert_int_equal(of[0][i], of[1][match.to[i]]);
    }
  }
  scene_close(&s);
}

/* Both poses of the best trial take each limb to its own. */
static void assert_limbs(const orb_trials *t) {
  const orb_trial *best = &t->trial[orb_trials_best(t)];
  for (int s = 0; s < 2; s++) {
    const orb_mesh *mesh = &t->copy[s].mesh, *other = &t->copy[1 - s].mesh;
    for (int i = 0; i < LIMBS; i++) {
      assert_int_equal(limb_at(other, best->pose[s].position + 3 * (size_t)shape_farthest(mesh, limb[i])), i);
    }
  }
}

/* Landmarks at the tips of two limbs, each of which goes to the place of the other one. */
static void give_wrong_landmarks(orb_trials *t) {
  enum { GIVEN = 2 };
  double *at[2];
  for (int s = 0; s < 2; s++) {
    at[s] = orb_alloc(ctx, 3 * GIVEN, sizeof(double));
    assert_non_null(at[s]);
    for (int i = 0; i < GIVEN; i++) {
      const orb_mesh *mesh = &t->copy[s].mesh;
      const int32_t tip = shape_farthest(mesh, limb[s == 0 ? i : 1 - i]);
      memcpy(at[s] + 3 * (size_t)i, mesh->positions + 3 * (size_t)tip, 3 * sizeof(double));
    }
  }
  assert_int_equal(orb_hint_places_create(ctx, GIVEN, GIVEN, GIVEN, at, t->copy, &t->hint), ORB_OK);
}

/* A trial that takes landmarks elsewhere both ways is dropped, and not raised: coarse copies then get trials of their
 * own. */
static void wrong_trials_are_dropped(void **state) {
  (void)state;
  scene s;
  int32_t list[ORB_TRIALS_MAX];
  scene_open(&s, alike);
  assert_int_equal(orb_trials_make(&s.small), ORB_OK);
  assert_int_equal(orb_trials_rank(&s.small), ORB_OK);
  const int32_t best = orb_trials_best(&s.small);
  assert_limbs(&s.small);
  give_wrong_landmarks(&s.small);
  assert_false(orb_trial_keeps_hint(&s.small, &s.small.trial[best], 0));
  orb_trial_fill_cost(&s.small, &s.small.trial[best], 1); /* one way says too little */
  assert_true(s.small.trial[best].cost < INFINITY);
  orb_trial_fill_cost(&s.small, &s.small.trial[best], 2);
  assert_false(s.small.trial[best].cost < INFINITY);
  const int32_t count = orb_trials_differing(&s.small, 0, ORB_TRIALS_MAX, list);
  for (int32_t i = 0; i < count; i++) {
    assert_int_not_equal(list[i], best);
  }
  scene_close(&s);
}

/* From small copies to coarse ones: crossing bends no trial more, and the best trial keeps every limb. */
static void best_trial_keeps_limbs(void **state) {
  (void)state;
  scene s;
  double before[ORB_TRIALS_MAX][2];
  int is_far[ORB_TRIALS_MAX], far = 0;
  scene_open(&s, unlike);
  assert_int_equal(orb_trials_make(&s.small), ORB_OK);
  assert_int_equal(orb_trials_rank(&s.small), ORB_OK);
  assert_int_equal(orb_trials_extend(&s.small), ORB_OK);
  for (int32_t i = 0; i < s.small.count; i++) {
    memcpy(before[i], s.small.trial[i].bend, sizeof before[i]);
    is_far[i] = s.small.trial[i].cost > ORB_FIND_CROSSED_BEHIND * s.small.trial[orb_trials_best(&s.small)].cost;
  }
  assert_true(orb_trials_bend(&s.small) > ORB_FIND_EXTENDS);
  assert_int_equal(orb_trials_cross(&s.small), ORB_OK);
  int less = 0;
  for (int32_t i = 0; i < s.small.count; i++) {
    far += is_far[i];
    for (int k = 0; k < 2; k++) {
      assert_true(s.small.trial[i].bend[k] <= before[i][k]);
      assert_true(!is_far[i] || s.small.trial[i].bend[k] == before[i][k]);
      less += s.small.trial[i].bend[k] < before[i][k];
    }
  }
  assert_true(less > 0 && far > 0);
  assert_limbs(&s.small);
  assert_int_equal(orb_trials_raise(&s.small, &s.coarse), ORB_OK);
  assert_in_range(s.coarse.count, 1, ORB_FIND_RAISED);
  assert_int_equal(orb_trials_rank(&s.coarse), ORB_OK);
  assert_limbs(&s.coarse);
  scene_close(&s);
}

/* Gives the copies landmarks: the ends of the limbs, and where they leave the ball. Both creatures have vertices of the
 * same numbers, so their landmarks are true. wrong: swaps the partners of the first two. */
static void give_landmarks(scene *s, int wrong) {
  enum { GIVEN = 2 * LIMBS };
  orb_trials *t = &s->coarse;
  int32_t vertex[GIVEN];
  double *at[2];
  for (int i = 0; i < LIMBS; i++) {
    vertex[i] = shape_farthest(&s->mesh[0], limb[i]);
    const double *p = s->mesh[0].positions + 3 * (size_t)vertex[i];
    double least = INFINITY;
    for (int32_t v = 0; v < s->mesh[0].vertex_count; v++) {
      const double *q = s->mesh[0].positions + 3 * (size_t)v;
      const double off = hypot(hypot(q[0] - p[0] / 2, q[1] - p[1] / 2), q[2] - p[2] / 2);
      vertex[LIMBS + i] = off < least ? v : vertex[LIMBS + i];
      least = fmin(off, least);
    }
  }
  for (int k = 0; k < 2; k++) {
    at[k] = orb_alloc(ctx, 3 * (size_t)GIVEN, sizeof(double));
    assert_non_null(at[k]);
    for (int i = 0; i < 3 * GIVEN; i++) {
      const int own = wrong && k == 1 && i < 6 ? (i + 3) % 6 : i;
      const double x = s->mesh[k].positions[3 * (size_t)vertex[own / 3] + (size_t)(own % 3)];
      at[k][i] = (x - t->scaling[k].middle[i % 3]) * t->scaling[k].scale;
    }
  }
  assert_int_equal(orb_hint_places_create(ctx, GIVEN, GIVEN, GIVEN, at, t->copy, &t->hint), ORB_OK);
}

/* The mean distance of the images of the first copy's vertices from their true places. */
static double off_truth(const scene *s) {
  const orb_trials *t = &s->coarse;
  const orb_coarse_copy *copy = t->copy;
  double sum = 0;
  for (int32_t v = 0; v < copy[0].mesh.vertex_count; v++) {
    const double *image = copy[1].mesh.positions + 3 * (size_t)t->trial[0].map[0].forth[v];
    const double *truth = s->mesh[1].positions + 3 * (size_t)copy[0].vertex[v];
    double d = 0;
    for (int k = 0; k < 3; k++) {
      d += pow(image[k] - (truth[k] - t->scaling[1].middle[k]) * t->scaling[1].scale, 2);
    }
    sum += sqrt(d) / copy[0].mesh.vertex_count;
  }
  return sum;
}

/* Landmarks tell where every place goes, even if two are swapped. */
static void landmarks_make_a_trial(void **state) {
  (void)state;
  for (int wrong = 0; wrong < 2; wrong++) {
    scene s;
    scene_open(&s, alike);
    give_landmarks(&s, wrong);
    assert_int_equal(orb_trials_survey(&s.coarse, 0), ORB_OK);
    assert_int_equal(orb_trials_make_hinted(&s.coarse), ORB_OK);
    assert_int_equal(s.coarse.count, 1);
    assert_true(off_truth(&s) < (wrong ? 0.4 : 0.2)); /* edges are 0.1 long; anywhere else it is 1 and more */
    scene_close(&s);
  }
}

/* True landmarks make the match without a search, and each limb goes to its own. If the partners are one limb further,
 * the trial bends the shapes much: it is dropped with all that was made for it, and a search may begin. */
static void landmarks_are_tried(void **state) {
  (void)state;
  for (int wrong = 0; wrong < 2; wrong++) {
    scene s;
    double bend;
    scene_open(&s, alike);
    give_landmarks(&s, 0);
    orb_hint_places *hint = &s.coarse.hint;
    for (int32_t i = 0; wrong && i + 1 < hint->count; i++) {
      int32_t *vertex = hint->vertex[1] + i;
      const int32_t first = vertex[0];
      vertex[0] = vertex[1];
      vertex[1] = first;
      for (int k = 0; k < 3; k++) {
        double *at = hint->at[1] + 3 * (size_t)i + k;
        const double x = at[0];
        at[0] = at[3];
        at[3] = x;
      }
    }
    assert_int_equal(orb_trials_try_hinted(&s.coarse, &bend), ORB_OK);
    assert_int_equal(s.coarse.count, !wrong);
    assert_int_equal(bend <= ORB_FIND_HINTED_BEND, !wrong);
    if (wrong) {
      assert_null(s.coarse.survey[0].tree);
      assert_null(s.coarse.survey[1].tree);
      assert_int_equal(orb_trials_make(&s.coarse), ORB_OK); /* takes its place */
      assert_true(s.coarse.count > 0);
      assert_null(s.coarse.trial[0].own[0]);
      assert_true(s.coarse.trial[0].cost < INFINITY); /* not dropped */
    } else {
      assert_limbs(&s.coarse);
    }
    scene_close(&s);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(limbs_end_in_tips),        cmocka_unit_test(limbs_without_landmarks_are_open),
      cmocka_unit_test(tips_meet_their_partners), cmocka_unit_test(shifted_tips_meet_their_partners),
      cmocka_unit_test(wrong_trials_are_dropped), cmocka_unit_test(best_trial_keeps_limbs),
      cmocka_unit_test(landmarks_make_a_trial),   cmocka_unit_test(landmarks_are_tried)};
  return cmocka_run_group_tests(tests, context_one_thread, context_end);
}
