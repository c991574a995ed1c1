/* Few landmarks and many shapes: the shapes determine what one or two landmarks leave open; three, five and sixteen
 * shapes meet at their landmarks, or are rotated onto each other without any. All bodies have the same surface with
 * different triangulations, embedded by the ball that it was made from, so the true counterpart of every point is
 * known.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "base/memory.h"
#include "numeric/vec3.h"
#include "support_align.h"
#include "support_bodies.h"
#include "support_shapes.h"

enum { MANY = 16, MARKS = 8 };

typedef struct crowd {
  orb_context *ctx;
  int count;
  orb_mesh mesh[MANY];
  double *ball[MANY], *points[MANY];
  orb_align_shape shape[MANY];
  orb_place at[MARKS][MANY];
  orb_landmark landmark[MARKS];
} crowd;

/* The point of the surface in direction p of the ball: asymmetric. */
static void surface(const double p[3], double out[3]) {
  double r = 1 + 0.4 * p[0] + 0.3 * p[1] * p[2] + 0.2 * p[1];
  out[0] = 2 * r * p[0];
  out[1] = r * p[1];
  out[2] = 0.7 * r * p[2];
}

/* Rotates around an axis that differs for every shape. */
static void turn(int s, const double p[3], double out[3]) {
  double axis[3] = {sin(1.3 * s), cos(2.1 * s), sin(0.7 * s + 1)}, angle = 1.9 * s, a[3];
  orb_normalize(axis);
  orb_cross(axis, p, a);
  double along = orb_dot(axis, p) * (1 - cos(angle));
  for (int k = 0; k < 3; k++) {
    out[k] = cos(angle) * p[k] + sin(angle) * a[k] + along * axis[k];
  }
  orb_normalize(out);
}

/* threads: 0: one per processor. */
static void crowd_open_on(crowd *c, int count, int threads) {
  const orb_context_options options = {.threads = threads};
  memset(c, 0, sizeof *c);
  c->count = count;
  assert_int_equal(orb_context_create(&options, &c->ctx), ORB_OK);
  for (int s = 0; s < count; s++) {
    c->mesh[s] = shape_globe(c->ctx, 18 + s % 5 * 2, 14 + s % 7);
    size_t size = 3 * (size_t)c->mesh[s].vertex_count;
    c->ball[s] = ORB_NEW(c->ctx, double, size);
    c->points[s] = ORB_NEW(c->ctx, double, size);
    assert_true(c->ball[s] && c->points[s]);
    for (int32_t v = 0; v < c->mesh[s].vertex_count; v++) {
      double *x = c->mesh[s].positions + 3 * v;
      memcpy(c->ball[s] + 3 * v, x, 3 * sizeof *x);
      orb_normalize(c->ball[s] + 3 * v);
      turn(s, c->ball[s] + 3 * v, c->points[s] + 3 * v);
      surface(c->ball[s] + 3 * v, x);
    }
    c->shape[s] = (orb_align_shape){&c->mesh[s], c->points[s]};
  }
}

static void crowd_open(crowd *c, int count) {
  crowd_open_on(c, count, 0);
}

static void crowd_close(crowd *c) {
  for (int s = 0; s < c->count; s++) {
    orb_free(c->ctx, c->ball[s]);
    orb_free(c->ctx, c->points[s]);
    shape_free(c->ctx, &c->mesh[s]);
  }
  orb_context_destroy(c->ctx);
}

/* Landmark k at the vertex of each shape nearest to a direction of the ball. */
static void mark(crowd *c, int k, const double direction[3]) {
  for (int s = 0; s < c->count; s++) {
    int32_t best = 0;
    for (int32_t v = 0; v < c->mesh[s].vertex_count; v++) {
      if (orb_distance2(c->ball[s] + 3 * v, direction) < orb_distance2(c->ball[s] + 3 * best, direction)) {
        best = v;
      }
    }
    assert_int_equal(orb_place_of_vertex(c->ctx, &c->mesh[s], best, &c->at[k][s]), ORB_OK);
  }
  c->landmark[k].at = c->at[k];
}

/* The root mean square, over the vertices of later shapes, of the angle between a vertex and its counterpart on the
 * first shape. The counterpart is the first shape's vertex nearest to the direction that the vertex was made from. */
static double mistake(const crowd *c, const orb_alignment *out) {
  double sum = 0;
  int32_t count = 0;
  for (int s = 1; s < c->count; s++) {
    for (int32_t v = 0; v < c->mesh[s].vertex_count; v++) {
      const double *d = c->ball[s] + 3 * v;
      int32_t best = 0;
      for (int32_t u = 0; u < c->mesh[0].vertex_count; u++) {
        if (orb_distance2(c->ball[0] + 3 * u, d) < orb_distance2(c->ball[0] + 3 * best, d)) {
          best = u;
        }
      }
      sum += orb_distance2(out->shapes[0].points + 3 * best, out->shapes[s].points + 3 * v);
      count++;
    }
  }
  return sqrt(sum / count);
}

static double align(crowd *c, orb_align_method method, int marks) {
  orb_align_options options = bodies_options(method);
  orb_alignment out;
  align_and_check(c->ctx, c->shape, c->count, c->landmark, marks, &options, &out);
  double wrong = mistake(c, &out);
  orb_alignment_free(c->ctx, &out);
  return wrong;
}

/* An undetermined rotation would have an error of about 1 on average. */
static void few_landmarks(void **state) {
  (void)state;
  static const double axis[2][3] = {{0.6, 0.64, 0.48}, {-0.6, -0.64, -0.48}};
  crowd c;
  crowd_open(&c, 3);
  for (int marks = 1; marks <= 2; marks++) {
    for (int k = 0; k < marks; k++) {
      mark(&c, k, axis[k]);
    }
    assert_true(align(&c, ORB_ALIGN_ROTATE, marks) < 0.25);
    assert_true(align(&c, ORB_ALIGN_PIN, marks) < 0.4);
    assert_true(align(&c, ORB_ALIGN_RBF, marks) < 0.3);
  }
  crowd_close(&c);
}

/* Maps of several shapes are made side by side. However many threads there are, all points are the same bytes. */
static void same_for_any_threads(void **state) {
  static const double axis[MARKS][3] = {{0.6, 0.64, 0.48}, {-0.6, -0.64, -0.48}, {0.8, -0.6, 0}, {-0.8, 0.6, 0},
                                        {0, 0.6, -0.8},    {0.28, 0, 0.96},      {0, -1, 0},     {-0.6, 0, 0.8}};
  static const struct {
    orb_align_method method;
    int marks;
  } tried[] = {{ORB_ALIGN_AUTO, 0}, {ORB_ALIGN_PIN, 3}, {ORB_ALIGN_PIN, MARKS}};
  (void)state;
  for (size_t i = 0; i < sizeof tried / sizeof *tried; i++) {
    if (IS_SLOW && i == 1) {
      continue; /* the last one runs the same code */
    }
    orb_alignment out[THREAD_COUNTS];
    crowd c[THREAD_COUNTS];
    for (int t = 0; t < THREAD_COUNTS; t++) {
      crowd_open_on(&c[t], 4, thread_counts[t]);
      for (int k = 0; k < tried[i].marks; k++) {
        mark(&c[t], k, axis[k]);
      }
      orb_align_options options = bodies_options(tried[i].method);
      options.preset = ORB_PRESET_DEFAULT;
      align_and_check(c[t].ctx, c[t].shape, 4, c[t].landmark, tried[i].marks, &options, &out[t]);
      assert_true(out[t].energy == out[0].energy);
      for (int s = 0; s < 4; s++) {
        assert_int_equal(out[t].shapes[s].mesh.vertex_count, out[0].shapes[s].mesh.vertex_count);
        assert_memory_equal(out[t].shapes[s].points, out[0].shapes[s].points,
                            3 * (size_t)out[0].shapes[s].mesh.vertex_count * sizeof(double));
      }
    }
    for (int t = 0; t < THREAD_COUNTS; t++) {
      orb_alignment_free(c[t].ctx, &out[t]);
      crowd_close(&c[t]);
    }
  }
}

/* The landmarks are equal directions of equal surfaces, so the maps are nearly the identity. */
static void many_shapes(void **state) {
  (void)state;
  static const int counts[] = {3, 5, MANY};
  for (int i = 0; i < 3; i++) {
    crowd c;
    crowd_open(&c, counts[i]);
    for (int k = 0; k < MARKS; k++) {
      double z = 1 - (2 * k + 1.0) / MARKS, r = sqrt(1 - z * z);
      mark(&c, k, (const double[3]){r * cos(2.4 * k), r * sin(2.4 * k), z});
    }
    assert_true(align(&c, ORB_ALIGN_ROTATE, MARKS) < 0.25);
    assert_true(align(&c, ORB_ALIGN_PIN, MARKS) < 0.3);
    assert_true(align(&c, ORB_ALIGN_RBF, MARKS) < 0.3);
    assert_true(align(&c, ORB_ALIGN_AUTO, 0) < 0.25);
    crowd_close(&c);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(few_landmarks), cmocka_unit_test(many_shapes),
                                     cmocka_unit_test(same_for_any_threads)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
