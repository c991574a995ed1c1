/* A head and the bust that it is a part of: the same points of space, so that what corresponds is known. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "align/find/inset/inset.h"
#include "align/find/trials.h"
#include "base/check.h"
#include "orbmorph/align.h"
#include "orbmorph/locate.h"
#include "support_align.h"
#include "support_context.h"
#include "support_shapes.h"

/* Where the neck begins: its angle from the top of the head, and the share of the way from the top of the shape to its
 * bottom. */
static const double NECK = 0.85 * M_PI, OF_HEAD = 0.9, OF_BUST = 0.45;

/* The surface at a share of the way down, as radius and height: a ball, then the sole of a head, or shoulders. */
static void profile(int is_bust, double down, double *radius, double *height) {
  static const double at[][2] = {{0, 0}, {0.9, -1.5}, {1.7, -1.9}, {2, -3.2}, {0, -3.3}}; /* shoulders, chest, sole */
  const double of = is_bust ? OF_BUST : OF_HEAD, below = (down - of) / (1 - of);
  const double neck = sin(NECK), low = cos(NECK);
  if (below <= 0) {
    *radius = sin(down / of * NECK);
    *height = cos(down / of * NECK);
  } else if (!is_bust) {
    *radius = neck * (1 - below);
    *height = low;
  } else {
    const int i = below < 1 ? (int)(4 * below) : 3;
    const double f = 4 * below - i, r0 = i ? at[i][0] : neck, h0 = i ? at[i][1] : low;
    *radius = r0 + f * (at[i + 1][0] - r0);
    *height = h0 + f * (at[i + 1][1] - h0);
  }
}

/* How far a nose, ears and a bun make a direction of the head stand out. */
static double feature(const double p[3]) {
  static const double to[4][3] = {{1, 0, 0}, {0, 0.98, 0.2}, {0, -0.98, 0.2}, {-0.8, 0, 0.6}};
  static const double by[4] = {0.9, 0.5, 0.5, 0.6};
  double out = 1;
  for (int i = 0; i < 4; i++) {
    out += by[i] * exp(-(1 - p[0] * to[i][0] - p[1] * to[i][1] - p[2] * to[i][2]) / 0.08);
  }
  return out;
}

/* Is a vertex of the ball one of the head? */
static int is_head(const double ball[3], int is_bust) {
  return acos(fmax(-1, fmin(1, ball[2]))) / M_PI < (is_bust ? OF_BUST : OF_HEAD) - 0.02;
}

/* The head or the bust on the triangles of a ball, times a scale. */
static orb_mesh shape_of(int is_bust, int levels, double scale) {
  orb_mesh mesh = shape_ball(ctx, levels);
  for (int32_t v = 0; v < mesh.vertex_count; v++) {
    double *p = mesh.positions + 3 * (size_t)v, radius, height;
    const double around = atan2(p[1], p[0]);
    profile(is_bust, acos(fmax(-1, fmin(1, p[2]))) / M_PI, &radius, &height);
    const double q[3] = {radius * cos(around), radius * sin(around), height};
    const double out = is_head(p, is_bust) ? feature(q) : 1, wide = height < cos(NECK) ? 1.4 : 1;
    p[0] = scale * out * q[0];
    p[1] = scale * out * wide * q[1];
    p[2] = scale * out * q[2];
  }
  return mesh;
}

typedef struct scene {
  orb_mesh mesh[2];
  orb_trials trials;
} scene;

static orb_status search(scene *s, orb_context *of, orb_inset *out) {
  ORB_TRY(orb_trials_open(of, &s->mesh[0], &s->mesh[1], &s->trials));
  ORB_TRY(orb_trials_survey(&s->trials, 0));
  return orb_inset_find(&s->trials, out);
}

static void scene_close(scene *s) {
  orb_trials_close(&s->trials);
  shape_free(ctx, &s->mesh[0]);
  shape_free(ctx, &s->mesh[1]);
}

static double distance(const double *p, const double *q) {
  return hypot(hypot(p[0] - q[0], p[1] - q[1]), p[2] - q[2]);
}

/* Pairs are at the same place of the head, within two edges of it in the mean. */
static void assert_pairs(const scene *s, const orb_inset *found, int head, double scale) {
  double sum = 0;
  assert_true(found->count > ORB_FIND_INSET_PAIRS / 2);
  for (int32_t i = 0; i < found->count; i++) {
    const double *p = s->mesh[head].positions + 3 * (size_t)found->vertex[head][i];
    const double *q = s->mesh[1 - head].positions + 3 * (size_t)found->vertex[1 - head][i];
    const double of_head[3] = {p[0] / scale, p[1] / scale, p[2] / scale};
    sum += distance(of_head, q);
    for (int32_t k = 0; k < i; k++) {
      assert_int_not_equal(found->vertex[0][i], found->vertex[0][k]);
      assert_int_not_equal(found->vertex[1][i], found->vertex[1][k]);
    }
  }
  assert_true(sum / found->count < 0.15);
}

static void head_is_found_on_the_bust(void **state) {
  (void)state;
  for (int head = 0; head < 2; head++) { /* it may be either shape */
    scene s = {.mesh = {shape_of(head, 5 - !head, head ? 1 : 3), shape_of(!head, 5 - head, head ? 3 : 1)}};
    orb_inset found;
    assert_int_equal(search(&s, ctx, &found), ORB_OK);
    assert_pairs(&s, &found, head, 3);
    scene_close(&s);
  }
}

/* The bust is turned by 50° around (1, 2, 3), so that no axis is kept. */
static void head_is_found_on_a_turned_bust(void **state) {
  (void)state;
  scene s = {.mesh = {shape_of(0, 4, 1), shape_of(1, 5, 1)}};
  const double axis[3] = {1 / sqrt(14), 2 / sqrt(14), 3 / sqrt(14)}, cosine = cos(50 * M_PI / 180),
               sine = sin(50 * M_PI / 180);
  orb_inset found;
  double *kept = malloc(3 * (size_t)s.mesh[1].vertex_count * sizeof *kept);
  assert_non_null(kept);
  memcpy(kept, s.mesh[1].positions, 3 * (size_t)s.mesh[1].vertex_count * sizeof *kept);
  for (int32_t v = 0; v < s.mesh[1].vertex_count; v++) { /* Rodrigues' formula */
    const double *p = kept + 3 * (size_t)v;
    const double along = axis[0] * p[0] + axis[1] * p[1] + axis[2] * p[2];
    for (int k = 0; k < 3; k++) {
      const double cross = axis[(k + 1) % 3] * p[(k + 2) % 3] - axis[(k + 2) % 3] * p[(k + 1) % 3];
      s.mesh[1].positions[3 * v + k] = cosine * p[k] + sine * cross + (1 - cosine) * along * axis[k];
    }
  }
  assert_int_equal(search(&s, ctx, &found), ORB_OK);
  memcpy(s.mesh[1].positions, kept, 3 * (size_t)s.mesh[1].vertex_count * sizeof *kept);
  assert_pairs(&s, &found, 0, 1);
  free(kept);
  scene_close(&s);
}

/* Neither a shape of the same size nor one with limbs is a part. */
static void other_shapes_are_no_parts(void **state) {
  (void)state;
  static const double limb[4][3] = {{0.8, -0.6, 0}, {-0.8, -0.6, 0}, {0, 0.6, 0.8}, {0, 0.6, -0.8}};
  static const double reach[4] = {3.5, 3.5, 2.5, 2.5};
  for (int i = 0; i < 3; i++) {
    scene s = {.mesh = {i == 2 ? shape_of(1, 4, 1) : shape_of(0, 4, 1),
                        i == 0 ? shape_of(0, 5, 2) : shape_creature(ctx, 4, limb, reach, 4)}};
    orb_inset found;
    assert_int_equal(search(&s, ctx, &found), ORB_OK);
    assert_int_equal(found.count, 0);
    scene_close(&s);
  }
}

/* Five sixths of a ball lie on the body of a creature with three limbs. But these are left over, which are three
 * pieces, so the ball is no part of it, as the torso of a body is no part of another body. */
static void body_without_its_limbs_is_no_part(void **state) {
  (void)state;
  static const double limb[3][3] = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}}, reach[3] = {3, 3, 3};
  scene s = {.mesh = {shape_ball(ctx, 4), shape_creature(ctx, 3, limb, reach, 4)}};
  orb_inset found;
  assert_int_equal(search(&s, ctx, &found), ORB_OK);
  assert_int_equal(found.count, 0);
  scene_close(&s);
}

/* How far a map takes places of the head from themselves, in the mean. head: which of the shapes it is; levels: of its
 * triangles. */
static double off_the_head(const scene *s, int head, int levels, orb_alignment *out) {
  const orb_aligned_shape *from = &out->shapes[head], *to = &out->shapes[1 - head];
  orb_mesh ball = shape_ball(ctx, levels);
  orb_locator *locator;
  double sum = 0;
  int32_t count = 0;
  assert_int_equal(orb_locator_create(ctx, to->points, to->mesh.vertex_count, to->mesh.triangles,
                                      to->mesh.triangle_count, NULL, &locator),
                   ORB_OK);
  for (int32_t v = 0; v < ball.vertex_count; v++) {
    if (is_head(ball.positions + 3 * (size_t)v, 0)) {
      orb_place place;
      double p[3];
      orb_locate(locator, from->points + 3 * (size_t)v, -1, &place);
      orb_place_position(&to->mesh, &place, p);
      sum += distance(p, s->mesh[head].positions + 3 * (size_t)v);
      count++;
    }
  }
  orb_locator_destroy(ctx, locator);
  shape_free(ctx, &ball);
  return sum / count;
}

/* Without landmarks, the map takes the head to the head of the bust, whichever of the two comes first, and however
 * large it is: from level 6 on, a copy of the head is aligned, since the search begins at the bust. Half of the head's
 * radius is allowed; a map that spreads the head over the bust is off by 2.7. The map of the wholes is the first
 * alternative. */
static void head_goes_to_the_head(void **state) {
  (void)state;
  static const int level[3][2] = {{4, 4}, {4, 4}, {6, 4}};
  const int cases = IS_SLOW ? 1 : 3; /* all of them take eight minutes, and other tests lift shapes with sanitizers */
  for (int i = 0; i < cases; i++) {
    const int head = i == 1;
    scene s = {.mesh = {shape_of(head, level[i][0], 1), shape_of(!head, level[i][1], 1)}};
    orb_mesh ball[2] = {shape_ball(ctx, level[i][0]), shape_ball(ctx, level[i][1])};
    const orb_align_shape shape[2] = {{&s.mesh[0], ball[0].positions}, {&s.mesh[1], ball[1].positions}};
    orb_align_options options;
    orb_alignment out;
    orb_align_defaults(&options);
    options.method = ORB_ALIGN_AUTO;
    assert_int_equal(orb_align(ctx, shape, 2, NULL, 0, &options, &out), ORB_OK);
    assert_int_equal(out.landmark_count, 0);
    assert_null(out.shapes[0].landmark_vertices);
    assert_null(out.shapes[1].landmark_vertices);
    assert_true(out.shapes[0].certificate.valid && out.shapes[1].certificate.valid);
    assert_true(out.match.is_part && out.match.confidence >= ORB_MATCH_LIKELY);
    double surest = 0;
    for (int32_t k = 0; k < out.found_count; k++) {
      surest = fmax(surest, out.confidence[k]);
    }
    assert_true(surest > 0.3); /* `clear` of the wholes does not lower them */
    assert_true(off_the_head(&s, head, level[i][head], &out) < 0.5);
    assert_true(out.alternative_count > 0 && out.alternatives[0].cost == 1);
    orb_alignment_free(ctx, &out);
    shape_free(ctx, &ball[0]);
    shape_free(ctx, &ball[1]);
    scene_close(&s);
  }
}

/* The vertex of a shape that is nearest to where a direction leaves the ball of the head. */
static int32_t vertex_towards(const orb_mesh *mesh, const double to[3]) {
  const double out = feature(to), at[3] = {out * to[0], out * to[1], out * to[2]};
  int32_t best = 0;
  for (int32_t v = 1; v < mesh->vertex_count; v++) {
    best = distance(mesh->positions + 3 * (size_t)v, at) < distance(mesh->positions + 3 * (size_t)best, at) ? v : best;
  }
  return best;
}

/* Where a landmark is, as a direction from the middle of the head of each shape. */
typedef struct given {
  double to[2][3], weight;
} given;

#define BOTH(...)    \
  {                  \
    {__VA_ARGS__}, { \
      __VA_ARGS__    \
    }                \
  }

/* Aligns the head (the first shape if `head` is 0) and the bust by landmarks. Returns how far the head is off. */
static double off_with(int head, const given *all, int count, orb_preset preset) {
  enum { MOST = 8 };
  scene s = {.mesh = {shape_of(head, 4, 1), shape_of(!head, 4, 1)}};
  orb_mesh ball = shape_ball(ctx, 4);
  const orb_align_shape shape[2] = {{&s.mesh[0], ball.positions}, {&s.mesh[1], ball.positions}};
  orb_place at[MOST][2];
  orb_landmark landmark[MOST];
  orb_align_options options;
  orb_alignment out;
  for (int i = 0; i < count; i++) {
    landmark[i] = (orb_landmark){.at = at[i], .weight = all[i].weight};
    for (int k = 0; k < 2; k++) {
      const int32_t v = vertex_towards(&s.mesh[k], all[i].to[k]);
      assert_int_equal(orb_place_of_vertex(ctx, &s.mesh[k], v, &at[i][k]), ORB_OK);
    }
  }
  orb_align_defaults(&options);
  options.preset = preset;
  assert_int_equal(orb_align(ctx, shape, 2, landmark, count, &options, &out), ORB_OK);
  assert_true(out.shapes[0].certificate.valid && out.shapes[1].certificate.valid);
  assert_int_equal(out.landmark_count, count);
  const int32_t *v[2] = {out.shapes[0].landmark_vertices, out.shapes[1].landmark_vertices};
  for (int i = 0; i < count && all[i].weight == 0; i++) {
    assert_memory_equal(out.shapes[0].points + 3 * (size_t)v[0][i], out.shapes[1].points + 3 * (size_t)v[1][i],
                        3 * sizeof(double));
  }
  const double off = off_the_head(&s, head, 4, &out);
  orb_alignment_free(ctx, &out);
  shape_free(ctx, &ball);
  scene_close(&s);
  return off;
}

/* With landmarks on the nose, the ears, the bun, the top and the neck, or with the first of them alone, the head lies
 * on the head of the bust, whichever comes first: it moves in both orders. A third of its radius is allowed, two edges.
 */
static void landmarks_lay_the_head_onto_the_bust(void **state) {
  (void)state;
  static const given all[] = {{BOTH(1, 0, 0), 0},          {BOTH(0, 0.98, 0.2), 0},     {BOTH(0, -0.98, 0.2), 0},
                              {BOTH(-0.8, 0, 0.6), 0},     {BOTH(0, 0, 1), 0},          {BOTH(0.6, 0, -0.8), 0},
                              {BOTH(-0.6, 0.5, -0.62), 0}, {BOTH(-0.6, -0.5, -0.62), 0}};
  assert_true(off_with(0, all, 1, ORB_PRESET_DEFAULT) < 0.3);
  assert_true(off_with(1, all, 4, ORB_PRESET_DEFAULT) < 0.3);
  if (!IS_SLOW) {
    assert_true(off_with(1, all, 1, ORB_PRESET_DEFAULT) < 0.3);
    assert_true(off_with(0, all, 3, ORB_PRESET_DEFAULT) < 0.3);
    assert_true(off_with(0, all, 8, ORB_PRESET_DEFAULT) < 0.3);
  }
}

/* The preset `quality` looks for a part too. */
static void quality_lays_the_head_onto_the_bust(void **state) {
  (void)state;
  static const given nose = {BOTH(1, 0, 0), 0};
  if (IS_SLOW) {
    skip();
  }
  assert_true(off_with(0, &nose, 1, ORB_PRESET_QUALITY) < 0.3);
}

/* Landmarks in a row, or all at one place, leave the turn of the part open. */
static void landmarks_in_a_row_fix_no_turn(void **state) {
  (void)state;
  static const given row[] = {{BOTH(1, 0, 0), 0}, {BOTH(0.9, 0.3, 0.3), 0}, {BOTH(0.9, -0.3, -0.3), 0}};
  static const given same[] = {{BOTH(0, 0.98, 0.2), 0}, {BOTH(0, 0.98, 0.2), 0}, {BOTH(0, 0.98, 0.2), 0}};
  if (IS_SLOW) {
    skip(); /* one landmark takes the same way */
  }
  assert_true(off_with(0, row, 3, ORB_PRESET_DEFAULT) < 0.3);
  assert_true(off_with(0, same, 3, ORB_PRESET_DEFAULT) < 0.3);
}

/* What is held for the part stays held when a soft landmark is let go; and a soft one that is wrong excludes no part.
 */
static void soft_landmarks_keep_the_part(void **state) {
  (void)state;
  static const given soft = {BOTH(1, 0, 0), 0.5};
  static const given wrong[] = {{BOTH(1, 0, 0), 0},
                                {BOTH(0, 0.98, 0.2), 0},
                                {BOTH(0, -0.98, 0.2), 0},
                                {BOTH(-0.8, 0, 0.6), 0},
                                {{{0, 0, 1}, {0.5, 0.71, 0.5}}, 0.1}};
  assert_true(IS_SLOW || off_with(0, &soft, 1, ORB_PRESET_DEFAULT) < 0.3);
  assert_true(off_with(0, wrong, 5, ORB_PRESET_DEFAULT) < 0.5); /* it draws what is near it */
}

/* A landmark says that the nose of the head is the foot of the bust, where no part takes it. It is kept. */
static void landmark_excludes_the_part(void **state) {
  (void)state;
  scene s = {.mesh = {shape_of(0, 4, 1), shape_of(1, 4, 1)}};
  orb_mesh ball = shape_ball(ctx, 4);
  const orb_align_shape shape[2] = {{&s.mesh[0], ball.positions}, {&s.mesh[1], ball.positions}};
  orb_place at[2];
  const orb_landmark landmark = {.at = at};
  orb_align_options options;
  orb_alignment out;
  int32_t lowest = 0;
  for (int32_t v = 0; v < s.mesh[1].vertex_count; v++) {
    lowest = s.mesh[1].positions[3 * (size_t)v + 2] < s.mesh[1].positions[3 * (size_t)lowest + 2] ? v : lowest;
  }
  assert_int_equal(orb_place_of_vertex(ctx, &s.mesh[0], vertex_towards(&s.mesh[0], (const double[3]){1, 0, 0}), &at[0]),
                   ORB_OK);
  assert_int_equal(orb_place_of_vertex(ctx, &s.mesh[1], lowest, &at[1]), ORB_OK);
  orb_align_defaults(&options);
  assert_int_equal(orb_align(ctx, shape, 2, &landmark, 1, &options, &out), ORB_OK);
  assert_true(out.shapes[0].certificate.valid && out.shapes[1].certificate.valid);
  assert_true(off_the_head(&s, 0, 4, &out) > 1);
  assert_memory_equal(out.shapes[0].points + 3 * (size_t)out.shapes[0].landmark_vertices[0],
                      out.shapes[1].points + 3 * (size_t)out.shapes[1].landmark_vertices[0], 3 * sizeof(double));
  orb_alignment_free(ctx, &out);
  shape_free(ctx, &ball);
  scene_close(&s);
}

static void threads_change_nothing(void **state) {
  (void)state;
  const orb_context_options options = {.threads = 3};
  scene s = {.mesh = {shape_of(0, 4, 1), shape_of(1, 4, 1)}};
  orb_inset one, other;
  orb_context *three;
  assert_int_equal(search(&s, ctx, &one), ORB_OK);
  orb_trials_close(&s.trials);
  memset(&s.trials, 0, sizeof s.trials);
  assert_int_equal(orb_context_create(&options, &three), ORB_OK);
  assert_int_equal(search(&s, three, &other), ORB_OK);
  assert_true(one.count > 0);
  assert_memory_equal(&one, &other, sizeof one);
  orb_trials_close(&s.trials);
  memset(&s.trials, 0, sizeof s.trials);
  orb_context_destroy(three);
  scene_close(&s);
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

/* Allocations before the search are made by `ctx`, so that each that fails is one of the search. */
static int64_t search_rationed(scene *s, int64_t at, orb_status *status) {
  rationed ration = {at, 0};
  const orb_context_options options = {.threads = 1, .allocator = {alloc_or_fail, free_it, &ration}};
  orb_context *of;
  orb_inset found;
  assert_int_equal(orb_context_create(&options, &of), ORB_OK);
  const int64_t before = ration.calls;
  s->trials.ctx = of;
  *status = orb_inset_find(&s->trials, &found);
  s->trials.ctx = ctx;
  orb_context_destroy(of); /* it checks that nothing is left */
  return ration.calls - before;
}

/* Each allocation of the search fails once, with sanitizers each third: that is reported, and nothing is left behind.
 */
static void memory_runs_out(void **state) {
  (void)state;
  scene s = {.mesh = {shape_of(0, 3, 1), shape_of(1, 4, 1)}};
  orb_inset found;
  orb_status status;
  assert_int_equal(search(&s, ctx, &found), ORB_OK);
  assert_true(found.count > 0);
  const int64_t calls = search_rationed(&s, INT64_MAX, &status);
  assert_int_equal(status, ORB_OK);
  assert_true(calls > 8);
  for (int64_t at = 1; at <= calls; at += IS_SLOW ? 6 : 1) { /* the allocation of the context comes before these */
    (void)search_rationed(&s, at, &status);
    assert_int_equal(status, ORB_E_NO_MEMORY);
  }
  scene_close(&s);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(head_is_found_on_the_bust),
                                     cmocka_unit_test(head_is_found_on_a_turned_bust),
                                     cmocka_unit_test(other_shapes_are_no_parts),
                                     cmocka_unit_test(body_without_its_limbs_is_no_part),
                                     cmocka_unit_test(head_goes_to_the_head),
                                     cmocka_unit_test(landmarks_lay_the_head_onto_the_bust),
                                     cmocka_unit_test(quality_lays_the_head_onto_the_bust),
                                     cmocka_unit_test(landmarks_in_a_row_fix_no_turn),
                                     cmocka_unit_test(soft_landmarks_keep_the_part),
                                     cmocka_unit_test(landmark_excludes_the_part),
                                     cmocka_unit_test(threads_change_nothing),
                                     cmocka_unit_test(memory_runs_out)};
  return cmocka_run_group_tests(tests, context_one_thread, context_end);
}
