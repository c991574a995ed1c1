/* The contest of the matches of shapes that bend much: on creatures whose limbs are known, for any number of threads.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#include "align/find/contest.h"
#include "align/find/params.h"
#include "align/sheet/even.h"
#include "base/memory.h"
#include "orbmorph/align.h"
#include "orbmorph/embed.h"
#include "support_align.h"
#include "support_shapes.h"

enum { LIMBS = 4 };

static const double limb[LIMBS][3] = {{1, 0, 0}, {-0.6, 0.8, 0}, {0, -0.8, 0.6}, {-0.48, -0.6, -0.64}};

typedef struct outcome {
  orb_alignment alignment;
  orb_contest_result won;
  orb_match match;
} outcome;

/* Makes and embeds two creatures. lean: the number of the one with long limbs. levels: subdivisions of each. */
static void make_creatures(orb_context *ctx, int lean, const int levels[2], orb_mesh mesh[2],
                           orb_embedding embedding[2], orb_align_shape shapes[2]) {
  static const double reach[2][LIMBS] = {{6, 5, 4, 3}, {1.6, 1.8, 1.4, 1.3}};
  orb_embed_options embed;
  orb_embed_defaults(&embed);
  for (int s = 0; s < 2; s++) {
    mesh[s] = shape_creature(ctx, LIMBS, limb, reach[s == lean ? 0 : 1], levels[s]);
    assert_int_equal(orb_embed(ctx, &mesh[s], &embed, &embedding[s]), ORB_OK);
    shapes[s] = (orb_align_shape){&mesh[s], embedding[s].points};
  }
}

static void free_creatures(orb_context *ctx, orb_mesh mesh[2], orb_embedding embedding[2]) {
  for (int s = 0; s < 2; s++) {
    orb_embedding_free(ctx, &embedding[s]);
    shape_free(ctx, &mesh[s]);
  }
}

/* Holds a contest between two embedded shapes. */
static void hold(orb_context *ctx, const orb_align_shape shapes[2], outcome *out) {
  orb_even_shapes even;
  orb_align_options options;
  orb_align_defaults(&options);
  options.method = ORB_ALIGN_AUTO;
  options.preset = ORB_PRESET_FAST; /* rotations only */
  assert_int_equal(orb_even_shapes_create(ctx, shapes, 2, &even), ORB_OK);
  assert_int_equal(orb_align(ctx, even.shapes, 2, NULL, 0, &options, &out->alignment), ORB_OK);
  assert_int_equal(orb_match_find(ctx, shapes[0].mesh, shapes[1].mesh, NULL, 1, &out->match), ORB_OK);
  assert_true(orb_contest_is_open(&out->match, 1));
  assert_false(orb_contest_is_open(&out->match, 0));
  assert_int_equal(orb_contest_run(ctx, &out->match, 0, INFINITY, ORB_PRESET_DEFAULT, &out->alignment, &out->won),
                   ORB_OK);
  orb_even_shapes_free(ctx, &even);
}

/* Each tip of the first shape is nearest on the sphere to that of the same limb. */
static void assert_tips(const orb_mesh mesh[2], const orb_alignment *alignment) {
  for (int i = 0; i < LIMBS; i++) {
    const double *p = alignment->shapes[0].points + 3 * (size_t)shape_farthest(&mesh[0], limb[i]);
    int best = 0;
    double most = -2;
    for (int k = 0; k < LIMBS; k++) {
      const double *q = alignment->shapes[1].points + 3 * (size_t)shape_farthest(&mesh[1], limb[k]);
      const double near = p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
      best = near > most ? k : best;
      most = fmax(most, near);
    }
    assert_int_equal(best, i);
  }
}

/* Limbs of other lengths go to their counterparts, and the sphere has the same bytes for any number of threads. lean:
 * the number of the shape with long limbs. */
static void assert_contest(int lean) {
  double *first[2] = {NULL, NULL};
  double energy = 0;
  for (size_t t = 0; t < THREAD_COUNTS; t++) {
    const orb_context_options options = {.threads = thread_counts[t]};
    orb_context *ctx;
    orb_mesh mesh[2];
    orb_embedding embedding[2];
    orb_align_shape shapes[2];
    outcome out = {0};
    assert_int_equal(orb_context_create(&options, &ctx), ORB_OK);
    make_creatures(ctx, lean, (const int[2]){4, 4}, mesh, embedding, shapes);
    hold(ctx, shapes, &out);
    assert_int_equal(out.match.moves, lean); /* the one with long limbs */
    check_alignment(&out.alignment, 0);
    assert_tips(mesh, &out.alignment);
    for (int s = 0; s < 2; s++) {
      const size_t size = 3 * (size_t)mesh[s].vertex_count * sizeof(double);
      if (t == 0) {
        first[s] = test_malloc(size);
        memcpy(first[s], out.alignment.shapes[s].points, size);
        energy = out.alignment.energy;
      }
      assert_memory_equal(out.alignment.shapes[s].points, first[s], size);
    }
    assert_true(out.alignment.energy == energy);
    orb_alignment_free(ctx, &out.alignment);
    orb_match_free(ctx, &out.match);
    free_creatures(ctx, mesh, embedding);
    orb_context_destroy(ctx);
  }
  test_free(first[0]);
  test_free(first[1]);
}

static void limbs_go_to_limbs(void **unused) {
  (void)unused;
  assert_contest(0);
  assert_contest(1);
}

/* Two creatures, of which one has long limbs, on rotated spheres, with the tips of their limbs as landmarks. */
typedef struct marked {
  orb_mesh mesh[2];
  orb_embedding embedding[2];
  orb_even_shapes even;
  orb_alignment alignment;
  orb_match match;
} marked;

/* Landmarks at the tips of the limbs of two creatures. tip: their vertices. */
static void mark_tips(orb_context *ctx, const orb_align_shape shapes[2], int32_t tip[2][LIMBS], orb_place at[LIMBS][2],
                      orb_landmark landmarks[LIMBS]) {
  for (int i = 0; i < LIMBS; i++) {
    for (int s = 0; s < 2; s++) {
      tip[s][i] = shape_farthest(shapes[s].mesh, limb[i]);
      assert_int_equal(orb_place_of_vertex(ctx, shapes[s].mesh, tip[s][i], &at[i][s]), ORB_OK);
    }
    landmarks[i] = (orb_landmark){.at = at[i], .confidence = 1, .weight = 1};
  }
}

static void marked_open(orb_context *ctx, int lean, marked *m) {
  orb_landmark landmarks[LIMBS];
  orb_place at[LIMBS][2];
  int32_t tip[2][LIMBS];
  orb_align_shape shapes[2];
  orb_align_options options;
  orb_align_defaults(&options);
  options.method = ORB_ALIGN_ROTATE;
  memset(m, 0, sizeof *m);
  make_creatures(ctx, lean, (const int[2]){4, 4}, m->mesh, m->embedding, shapes);
  mark_tips(ctx, shapes, tip, at, landmarks);
  assert_int_equal(orb_even_shapes_create(ctx, shapes, 2, &m->even), ORB_OK);
  assert_int_equal(orb_align(ctx, m->even.shapes, 2, landmarks, LIMBS, &options, &m->alignment), ORB_OK);
  const orb_match_hint hint = {.count = LIMBS,
                               .few = LIMBS,
                               .trusted = LIMBS,
                               .first = tip[0],
                               .second = tip[1],
                               .stretch = INFINITY,
                               .sure = INFINITY};
  assert_int_equal(orb_match_find(ctx, &m->mesh[0], &m->mesh[1], &hint, 1, &m->match), ORB_OK);
  assert_true(orb_contest_is_open(&m->match, 1));
}

static void marked_close(orb_context *ctx, marked *m) {
  orb_alignment_free(ctx, &m->alignment);
  orb_match_free(ctx, &m->match);
  orb_even_shapes_free(ctx, &m->even);
  free_creatures(ctx, m->mesh, m->embedding);
}

/* Holds a contest of two creatures in which a map of no energy is known, and a contest in which none is. */
static void hold_marked(orb_context *ctx, int lean, marked *m) {
  orb_contest_result won;
  double *given[2];
  marked_open(ctx, lean, m);
  assert_int_equal(m->match.moves, lean);
  for (int s = 0; s < 2; s++) {
    const size_t size = 3 * (size_t)m->mesh[s].vertex_count * sizeof(double);
    given[s] = test_malloc(size);
    memcpy(given[s], m->alignment.shapes[s].points, size);
  }
  assert_int_equal(orb_contest_run(ctx, &m->match, LIMBS, 1, ORB_PRESET_DEFAULT, &m->alignment, &won), ORB_OK);
  assert_true(isinf(m->alignment.energy) && isinf(won.loose));
  for (int s = 0; s < 2; s++) {
    assert_memory_equal(m->alignment.shapes[s].points, given[s], 3 * (size_t)m->mesh[s].vertex_count * sizeof(double));
    test_free(given[s]);
  }
  assert_int_equal(orb_contest_run(ctx, &m->match, LIMBS, INFINITY, ORB_PRESET_DEFAULT, &m->alignment, &won), ORB_OK);
  assert_true(won.loose >= 1 && isfinite(won.loose) && isfinite(m->alignment.energy));
  check_alignment(&m->alignment, 1);
  assert_tips(m->mesh, &m->alignment);
}

/* Landmarks meet, whichever shape has the long limbs. A map that is known to have less energy than any walk wins: the
 * spheres stay. Both spheres have the same bytes for any number of threads. */
static void landmarks_meet(void **unused) {
  (void)unused;
  for (int lean = 0; lean < 2; lean++) {
    double *first[2] = {NULL, NULL};
    for (int t = 0; t < THREAD_COUNTS; t++) {
      const orb_context_options options = {.threads = thread_counts[t]};
      orb_context *ctx;
      marked m;
      assert_int_equal(orb_context_create(&options, &ctx), ORB_OK);
      hold_marked(ctx, lean, &m);
      for (int s = 0; s < 2; s++) {
        const size_t size = 3 * (size_t)m.mesh[s].vertex_count * sizeof(double);
        if (t == 0) {
          first[s] = test_malloc(size);
          memcpy(first[s], m.alignment.shapes[s].points, size);
        }
        assert_memory_equal(m.alignment.shapes[s].points, first[s], size);
      }
      marked_close(ctx, &m);
      orb_context_destroy(ctx);
    }
    test_free(first[0]);
    test_free(first[1]);
  }
}

/* Aligns two creatures in this order of the shapes, without landmarks. */
static void align_in_order(orb_context *ctx, const orb_align_shape shapes[2], int first, orb_alignment *out) {
  const orb_align_shape ordered[2] = {shapes[first], shapes[1 - first]};
  orb_align_options options;
  orb_align_defaults(&options);
  options.method = ORB_ALIGN_AUTO;
  options.preset = ORB_PRESET_DEFAULT;
  align_and_check(ctx, ordered, 2, NULL, 0, &options, out);
}

static void assert_same_places(const orb_place *a, const orb_place *swapped, int32_t pairs) {
  for (int32_t k = 0; k < 2 * pairs; k++) {
    assert_int_equal(a[k].triangle, swapped[k ^ 1].triangle);
    assert_memory_equal(a[k].at, swapped[k ^ 1].at, sizeof a[k].at);
  }
}

static void assert_same_map(const orb_alignment *a, const orb_alignment *swapped) {
  assert_true(a->energy == swapped->energy);
  for (int s = 0; s < 2; s++) {
    const orb_aligned_shape *one = &a->shapes[s], *other = &swapped->shapes[1 - s];
    assert_int_equal(one->mesh.vertex_count, other->mesh.vertex_count);
    assert_memory_equal(one->points, other->points, 3 * (size_t)one->mesh.vertex_count * sizeof(double));
  }
}

static void assert_same_swapped(const orb_alignment *a, const orb_alignment *swapped) {
  assert_same_map(a, swapped);
  assert_memory_equal(&a->match, &swapped->match, sizeof a->match);
  assert_true(a->alternative_count > 0);
  assert_int_equal(a->alternative_count, swapped->alternative_count);
  for (int32_t i = 0; i < a->alternative_count; i++) {
    const orb_alternative *one = &a->alternatives[i], *other = &swapped->alternatives[i];
    assert_true(one->cost == other->cost && one->shape == 1 && other->shape == 1);
    assert_int_equal(one->count, other->count);
    assert_same_places(one->at, other->at, one->count);
  }
}

/* Whoever swaps two shapes gets the same map and the same alternatives, also where a copy of one stands for it. */
static void order_changes_nothing(void **unused) {
  static const int levels[][2] = {{4, 4}, {4, 6}}; /* the round one is large and copied */
  (void)unused;
  for (size_t i = 0; i < (IS_SLOW ? 1 : sizeof levels / sizeof *levels); i++) {
    orb_context *ctx;
    orb_mesh mesh[2];
    orb_embedding embedding[2];
    orb_align_shape shapes[2];
    orb_alignment out[2];
    assert_int_equal(orb_context_create(NULL, &ctx), ORB_OK);
    make_creatures(ctx, 0, levels[i], mesh, embedding, shapes);
    for (int first = 0; first < 2; first++) {
      align_in_order(ctx, shapes, first, &out[first]);
    }
    assert_same_swapped(&out[0], &out[1]);
    orb_alignment_free(ctx, &out[0]);
    orb_alignment_free(ctx, &out[1]);
    free_creatures(ctx, mesh, embedding);
    orb_context_destroy(ctx);
  }
}

/* Aligns two creatures in this order of the shapes by the tips of their limbs. */
static void align_marked(orb_context *ctx, const orb_align_shape shapes[2], int first, orb_alignment *out) {
  const orb_align_shape ordered[2] = {shapes[first], shapes[1 - first]};
  orb_landmark landmarks[LIMBS];
  orb_place at[LIMBS][2];
  int32_t tip[2][LIMBS];
  orb_align_options options;
  orb_align_defaults(&options);
  options.preset = ORB_PRESET_DEFAULT;
  mark_tips(ctx, ordered, tip, at, landmarks);
  align_and_check(ctx, ordered, 2, landmarks, LIMBS, &options, out);
}

/* Whoever swaps two shapes with landmarks gets the same map: if one is clearly less round, if both are about as round,
 * and if a copy of one stands for it. */
static void order_changes_nothing_with_landmarks(void **unused) {
  static const struct {
    int lean, levels[2];
  } pairs[] = {{0, {4, 4}}, {2, {4, 3}}, {0, {6, 4}}}; /* 2: neither has long limbs */
  (void)unused;
  for (size_t i = 0; i < (IS_SLOW ? 1 : sizeof pairs / sizeof *pairs); i++) {
    orb_context *ctx;
    orb_mesh mesh[2];
    orb_embedding embedding[2];
    orb_align_shape shapes[2];
    orb_alignment out[2];
    assert_int_equal(orb_context_create(NULL, &ctx), ORB_OK);
    make_creatures(ctx, pairs[i].lean, pairs[i].levels, mesh, embedding, shapes);
    for (int first = 0; first < 2; first++) {
      align_marked(ctx, shapes, first, &out[first]);
    }
    assert_same_map(&out[0], &out[1]);
    for (int s = 0; s < 2; s++) {
      assert_memory_equal(out[0].shapes[s].landmark_vertices, out[1].shapes[1 - s].landmark_vertices,
                          LIMBS * sizeof(int32_t));
    }
    orb_alignment_free(ctx, &out[0]);
    orb_alignment_free(ctx, &out[1]);
    free_creatures(ctx, mesh, embedding);
    orb_context_destroy(ctx);
  }
}

/* Two landmarks share a place on one shape only. In both orders the error names that shape as the request does. */
static void errors_name_shapes_of_the_request(void **unused) {
  orb_context *ctx;
  orb_mesh mesh[2];
  orb_embedding embedding[2];
  orb_align_shape shapes[2];
  orb_align_options options;
  (void)unused;
  orb_align_defaults(&options);
  assert_int_equal(orb_context_create(NULL, &ctx), ORB_OK);
  make_creatures(ctx, 0, (const int[2]){3, 3}, mesh, embedding, shapes);
  for (int first = 0; first < 2; first++) {
    const orb_align_shape ordered[2] = {shapes[first], shapes[1 - first]};
    orb_landmark landmarks[LIMBS];
    orb_place at[LIMBS][2];
    int32_t tip[2][LIMBS];
    orb_alignment out;
    mark_tips(ctx, ordered, tip, at, landmarks);
    at[1][first] = at[0][first]; /* on the creature with long limbs */
    assert_int_equal(orb_align(ctx, ordered, 2, landmarks, LIMBS, &options, &out), ORB_E_BAD_LANDMARKS);
    assert_int_equal(orb_context_error(ctx)->shape, first);
    assert_non_null(strstr(orb_context_error(ctx)->detail, first == 0 ? "on shape 0" : "on shape 1"));
  }
  free_creatures(ctx, mesh, embedding);
  orb_context_destroy(ctx);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(limbs_go_to_limbs), cmocka_unit_test(order_changes_nothing),
                                     cmocka_unit_test(order_changes_nothing_with_landmarks),
                                     cmocka_unit_test(errors_name_shapes_of_the_request),
                                     cmocka_unit_test(landmarks_meet)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
