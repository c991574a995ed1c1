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
  assert_int_equal(orb_contest_run(ctx, &out->match, ORB_PRESET_DEFAULT, &out->alignment, &out->won), ORB_OK);
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
  static const double reach[2][LIMBS] = {{6, 5, 4, 3}, {1.6, 1.8, 1.4, 1.3}};
  static const int threads[] = {1, 2, 5};
  double *first[2] = {NULL, NULL};
  double energy = 0;
  for (size_t t = 0; t < sizeof threads / sizeof *threads; t++) {
    const orb_context_options options = {.threads = threads[t]};
    orb_context *ctx;
    orb_mesh mesh[2];
    orb_embedding embedding[2];
    orb_align_shape shapes[2];
    orb_embed_options embed;
    outcome out = {0};
    assert_int_equal(orb_context_create(&options, &ctx), ORB_OK);
    orb_embed_defaults(&embed);
    for (int s = 0; s < 2; s++) {
      mesh[s] = shape_creature(ctx, LIMBS, limb, reach[s == lean ? 0 : 1], 4);
      assert_int_equal(orb_embed(ctx, &mesh[s], &embed, &embedding[s]), ORB_OK);
      shapes[s] = (orb_align_shape){&mesh[s], embedding[s].points};
    }
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
    for (int s = 0; s < 2; s++) {
      orb_embedding_free(ctx, &embedding[s]);
      shape_free(ctx, &mesh[s]);
    }
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

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(limbs_go_to_limbs)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
