/* Alignments that begin where another one has ended: on creatures whose limbs are known. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#include "align/methods.h"
#include "orbmorph/align.h"
#include "orbmorph/embed.h"
#include "support_align.h"
#include "support_shapes.h"

enum { LIMBS = 4, SHAPES = 2, LEVELS = 4 };

static const double limb[LIMBS][3] = {{1, 0, 0}, {-0.6, 0.8, 0}, {0, -0.8, 0.6}, {-0.48, -0.6, -0.64}};
static const double reach[SHAPES][LIMBS] = {{4, 3.5, 3, 2.5}, {2.8, 3.2, 2.5, 2.2}};

/* Two creatures, the tips of their limbs as landmarks, and the alignment by these. */
typedef struct scene {
  orb_context *ctx;
  orb_mesh mesh[SHAPES];
  orb_embedding embedding[SHAPES];
  orb_align_shape shape[SHAPES];
  orb_landmark landmark[LIMBS];
  orb_place at[LIMBS][SHAPES];
  orb_align_options options;
  orb_alignment start;
} scene;

static void scene_open(scene *s, int threads) {
  const orb_context_options options = {.threads = threads};
  orb_embed_options embed;
  memset(s, 0, sizeof *s);
  orb_embed_defaults(&embed);
  orb_align_defaults(&s->options);
  assert_int_equal(orb_context_create(&options, &s->ctx), ORB_OK);
  for (int k = 0; k < SHAPES; k++) {
    s->mesh[k] = shape_creature(s->ctx, LIMBS, limb, reach[k], LEVELS);
    assert_int_equal(orb_embed(s->ctx, &s->mesh[k], &embed, &s->embedding[k]), ORB_OK);
    s->shape[k] = (orb_align_shape){&s->mesh[k], s->embedding[k].points};
  }
  for (int i = 0; i < LIMBS; i++) {
    for (int k = 0; k < SHAPES; k++) {
      assert_int_equal(orb_place_of_vertex(s->ctx, &s->mesh[k], shape_farthest(&s->mesh[k], limb[i]), &s->at[i][k]),
                       ORB_OK);
    }
    s->landmark[i] = (orb_landmark){.at = s->at[i], .confidence = 1, .weight = 1};
  }
  align_and_check(s->ctx, s->shape, SHAPES, s->landmark, LIMBS, &s->options, &s->start);
  assert_int_equal(s->start.has_followed, 0);
}

static void scene_close(scene *s) {
  orb_alignment_free(s->ctx, &s->start);
  for (int k = 0; k < SHAPES; k++) {
    orb_embedding_free(s->ctx, &s->embedding[k]);
    shape_free(s->ctx, &s->mesh[k]);
  }
  orb_context_destroy(s->ctx);
}

/* What most tests begin with, made once. Each has its own landmarks. */
static scene shared;

static int open_shared(void **unused) {
  (void)unused;
  scene_open(&shared, 1);
  return 0;
}

static int close_shared(void **unused) {
  (void)unused;
  scene_close(&shared);
  return 0;
}

/* Moves a landmark of the second creature to a place beside its own, inside a triangle. */
static void nudge(scene *s, int landmark) {
  s->at[landmark][1].at[0] = 0.8;
  s->at[landmark][1].at[1] = 0.12;
  s->at[landmark][1].at[2] = 0.08;
}

static orb_status align_again(scene *s, const orb_alignment *start, orb_alignment *out) {
  for (int i = 0; i < LIMBS; i++) {
    s->landmark[i].at = s->at[i]; /* of this copy of a scene */
  }
  return orb_align_again(s->ctx, s->shape, SHAPES, s->landmark, LIMBS, &s->options, start, out);
}

static void again(scene *s, const orb_alignment *start, int followed, orb_alignment *out) {
  assert_int_equal(align_again(s, start, out), ORB_OK);
  assert_int_equal(out->has_followed, followed);
  check_alignment(out, 1);
}

/* The corrected landmark meets, and so do the others; the map is no worse, for any number of threads the same. */
static void corrected_landmarks_meet(void **unused) {
  orb_alignment first = {0};
  scene keep;
  (void)unused;
  for (int t = 0; t < THREAD_COUNTS; t++) {
    scene s;
    orb_alignment out;
    if (IS_SLOW) {
      s = shared;
    } else {
      scene_open(&s, thread_counts[t]);
    }
    nudge(&s, 1);
    again(&s, &s.start, 1, &out);
    assert_true(out.energy <= s.start.energy);
    if (t == 0) {
      first = out;
      keep = s;
      continue;
    }
    for (int k = 0; k < SHAPES; k++) {
      const orb_aligned_shape *x = &out.shapes[k], *y = &first.shapes[k];
      assert_int_equal(x->mesh.vertex_count, y->mesh.vertex_count);
      assert_memory_equal(x->points, y->points, 3 * (size_t)x->mesh.vertex_count * sizeof(double));
    }
    orb_alignment_free(s.ctx, &out);
    scene_close(&s);
  }
  orb_alignment_free(keep.ctx, &first);
  if (!IS_SLOW) {
    scene_close(&keep);
  }
}

/* The second correction begins at the first one, whose meshes have been split; each triangle still has its parent. */
static void corrections_follow_each_other(void **unused) {
  scene s = shared;
  orb_alignment one, two;
  (void)unused;
  nudge(&s, 1);
  again(&s, &s.start, 1, &one);
  assert_true(one.shapes[1].mesh.vertex_count > s.mesh[1].vertex_count);
  nudge(&s, 2);
  again(&s, &one, 1, &two);
  assert_true(two.shapes[1].mesh.vertex_count > one.shapes[1].mesh.vertex_count);
  const orb_mesh *given = &s.mesh[1], *mesh = &two.shapes[1].mesh;
  for (int32_t t = 0; t < mesh->triangle_count; t++) { /* the middle of a piece lies in its parent */
    const int32_t parent = two.shapes[1].parent[t];
    assert_in_range(parent, 0, given->triangle_count - 1);
    const orb_place middle = {t, {1.0 / 3, 1.0 / 3, 1.0 / 3}};
    double at[3], n[3], edge[3], away[3], side[3];
    orb_place_position(mesh, &middle, at);
    const double *p[3];
    for (int k = 0; k < 3; k++) {
      p[k] = given->positions + 3 * (size_t)given->triangles[3 * parent + k];
    }
    for (int k = 0; k < 3; k++) {
      edge[k] = p[1][k] - p[0][k];
      away[k] = p[2][k] - p[0][k];
    }
    for (int k = 0; k < 3; k++) {
      n[k] = edge[(k + 1) % 3] * away[(k + 2) % 3] - edge[(k + 2) % 3] * away[(k + 1) % 3];
    }
    for (int i = 0; i < 3; i++) {
      const double *from = p[i], *to = p[(i + 1) % 3];
      double inside = 0;
      for (int k = 0; k < 3; k++) {
        edge[k] = to[k] - from[k];
        away[k] = at[k] - from[k];
      }
      for (int k = 0; k < 3; k++) {
        side[k] = edge[(k + 1) % 3] * away[(k + 2) % 3] - edge[(k + 2) % 3] * away[(k + 1) % 3];
        inside += side[k] * n[k];
      }
      assert_true(inside > 0);
    }
  }
  orb_alignment_free(s.ctx, &one);
  orb_alignment_free(s.ctx, &two);
}

/* Landmarks that take limbs to other limbs lead away from the start: the shapes are aligned anew, and they meet. */
static void other_limbs_begin_anew(void **unused) {
  scene s = shared;
  orb_alignment out;
  (void)unused;
  if (IS_SLOW) {
    skip(); /* what they do anew, other tests do with sanitizers */
  }
  for (int i = 0; i < LIMBS; i++) { /* an odd permutation: a mirror image */
    static const int other[LIMBS] = {1, 0, 2, 3};
    assert_int_equal(orb_place_of_vertex(s.ctx, &s.mesh[1], shape_farthest(&s.mesh[1], limb[other[i]]), &s.at[i][1]),
                     ORB_OK);
  }
  again(&s, &s.start, 0, &out);
  orb_alignment_free(s.ctx, &out);
}

/* A soft landmark is no vertex that both shapes share. */
static void soft_landmarks_stay_soft(void **unused) {
  scene s = shared;
  orb_alignment out;
  (void)unused;
  nudge(&s, 0);
  s.landmark[0].weight = 0.3;
  assert_int_equal(align_again(&s, &s.start, &out), ORB_OK);
  assert_int_equal(out.has_followed, 1);
  for (int k = 0; k < SHAPES; k++) {
    assert_int_equal(out.shapes[k].landmark_vertices[0], -1);
    assert_true(out.shapes[k].landmark_vertices[1] >= 0);
  }
  orb_alignment_free(s.ctx, &out);
}

static void assert_refused(scene *s, const orb_align_shape *shapes, int32_t landmarks, const char *word) {
  orb_alignment out;
  static const orb_alignment none;
  assert_int_equal(orb_align_again(s->ctx, shapes, SHAPES, s->landmark, landmarks, &s->options, &s->start, &out),
                   ORB_E_BAD_OPTION);
  assert_non_null(strstr(orb_context_error(s->ctx)->detail, word));
  assert_memory_equal(&out, &none, sizeof none);
}

/* A third shape moves beside the second; both keep to the first. */
static void three_shapes_follow(void **unused) {
  scene s = shared;
  const orb_align_shape shapes[3] = {s.shape[0], s.shape[1], s.shape[1]};
  orb_place at[LIMBS][3];
  orb_landmark landmarks[LIMBS];
  orb_alignment start, out;
  (void)unused;
  for (int i = 0; i < LIMBS; i++) {
    memcpy(at[i], s.at[i], sizeof s.at[i]);
    at[i][2] = s.at[i][1];
    landmarks[i] = s.landmark[i];
    landmarks[i].at = at[i];
  }
  align_and_check(s.ctx, shapes, 3, landmarks, LIMBS, &s.options, &start);
  nudge(&s, 3);
  at[3][2] = s.at[3][1];
  assert_int_equal(orb_align_again(s.ctx, shapes, 3, landmarks, LIMBS, &s.options, &start, &out), ORB_OK);
  assert_int_equal(out.has_followed, 1);
  check_alignment(&out, 1);
  assert_int_equal(out.shapes[0].mesh.vertex_count, s.mesh[0].vertex_count);
  assert_int_equal(out.shapes[1].mesh.vertex_count, s.mesh[1].vertex_count);
  assert_int_equal(out.shapes[2].mesh.vertex_count, s.mesh[1].vertex_count + 1);
  orb_alignment_free(s.ctx, &start);
  orb_alignment_free(s.ctx, &out);
}

/* A landmark whose triangle does not exist is refused as by orb_align(), also where the start has split meshes. */
static void places_that_do_not_exist_are_refused(void **unused) {
  scene s = shared;
  orb_alignment one, out;
  (void)unused;
  nudge(&s, 1);
  again(&s, &s.start, 1, &one);
  s.at[2][1].triangle = s.mesh[1].triangle_count;
  assert_int_equal(align_again(&s, &one, &out), ORB_E_BAD_LANDMARKS);
  s.at[2][1] = (orb_place){0, {1.5, -0.5, 0}};
  assert_int_equal(align_again(&s, &one, &out), ORB_E_BAD_LANDMARKS);
  orb_alignment_free(s.ctx, &one);
}

static void other_starts_are_refused(void **unused) {
  scene s = shared;
  (void)unused;
  const orb_align_shape swapped[SHAPES] = {s.shape[1], s.shape[0]};
  assert_refused(&s, swapped, LIMBS, "of other shapes");
  s.options.method = ORB_ALIGN_AUTO;
  assert_refused(&s, s.shape, 0, "with landmarks");
  s.options.method = ORB_ALIGN_RBF;
  assert_refused(&s, s.shape, LIMBS, "pin and auto");
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(corrected_landmarks_meet), cmocka_unit_test(corrections_follow_each_other),
      cmocka_unit_test(other_limbs_begin_anew),   cmocka_unit_test(soft_landmarks_stay_soft),
      cmocka_unit_test(three_shapes_follow),      cmocka_unit_test(places_that_do_not_exist_are_refused),
      cmocka_unit_test(other_starts_are_refused)};
  return cmocka_run_group_tests(tests, open_shared, close_shared);
}
