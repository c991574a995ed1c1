/* What an alignment without landmarks reports as matched: it includes tips, the places agree with the known
 * correspondence of the shapes, and the confidence is right for maps whose stretch follows from geometry. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#include "orbmorph/merge.h"
#include "support_shapes.h"

/* Two ellipsoids made from the same ball, whose points are the embedding of both. */
typedef struct ellipsoids {
  orb_context *ctx;
  orb_mesh ball, mesh[2];
  orb_align_shape shape[2];
} ellipsoids;

static void open_ellipsoids(ellipsoids *e, int levels, const double first[3], const double second[3]) {
  assert_int_equal(orb_context_create(NULL, &e->ctx), ORB_OK);
  e->ball = shape_ball(e->ctx, levels);
  for (int s = 0; s < 2; s++) {
    e->mesh[s] = shape_ball(e->ctx, levels);
    for (int32_t i = 0; i < 3 * e->ball.vertex_count; i++) {
      e->mesh[s].positions[i] *= (s ? second : first)[i % 3];
    }
    e->shape[s] = (orb_align_shape){&e->mesh[s], e->ball.positions};
  }
}

static void close_ellipsoids(ellipsoids *e) {
  shape_free(e->ctx, &e->ball);
  shape_free(e->ctx, &e->mesh[0]);
  shape_free(e->ctx, &e->mesh[1]);
  orb_context_destroy(e->ctx);
}

static void align(ellipsoids *e, orb_alignment *out) {
  orb_align_options options;
  orb_align_defaults(&options);
  options.method = ORB_ALIGN_AUTO;
  options.preset = ORB_PRESET_FAST; /* rotations only */
  assert_int_equal(orb_align(e->ctx, e->shape, 2, NULL, 0, &options, out), ORB_OK);
}

static void assert_place(const orb_mesh *mesh, const orb_place *place) {
  assert_true(place->triangle >= 0 && place->triangle < mesh->triangle_count);
  assert_true(place->at[0] >= 0 && place->at[1] >= 0 && place->at[2] >= 0);
  assert_true(fabs(place->at[0] + place->at[1] + place->at[2] - 1) < 1e-12);
}

/* Semi-axes 3, 2, 1 and twice that: the map is a scaling, up to half turns around the axes and the few degrees that the
 * search leaves. */
static void scaled_copy(void **state) {
  (void)state;
  ellipsoids e;
  orb_alignment alignment;
  open_ellipsoids(&e, 4, (const double[3]){3, 2, 1}, (const double[3]){6, 4, 2});
  align(&e, &alignment);
  assert_int_equal(alignment.landmark_count, 0);
  assert_int_equal(alignment.found_count, ORB_FOUND_MAX);
  int tips = 0;
  for (int i = 0; i < alignment.found_count; i++) {
    double p[3], q[3];
    assert_place(&e.mesh[0], &alignment.found[2 * i]);
    assert_place(&e.mesh[1], &alignment.found[2 * i + 1]);
    orb_place_position(&e.mesh[0], &alignment.found[2 * i], p);
    orb_place_position(&e.mesh[1], &alignment.found[2 * i + 1], q);
    for (int k = 0; k < 3; k++) {
      assert_true(fabs(fabs(q[k]) - 2 * fabs(p[k])) < 0.4);
    }
    tips += fabs(p[0]) > 2.99;
    assert_true(alignment.confidence[i] > 0.97 && alignment.confidence[i] <= 1);
  }
  assert_int_equal(tips, 2);
  orb_alignment_free(e.ctx, &alignment);
  close_ellipsoids(&e);
}

/* Area of the spheroid with semi-axes a > 1, 1, 1. */
static double spheroid_area(double a) {
  double e = sqrt(1 - 1 / (a * a));
  return 2 * M_PI * (1 + a / e * asin(e));
}

/* At the tips of the spheroids the map scales by c in both directions, where c² is the quotient of the areas: the
 * confidence there is 1/E = 2/(c² + 1/c²). On their sides the map stretches by 3/2 in one direction only. */
static void known_stretch(void **state) {
  (void)state;
  ellipsoids e;
  orb_alignment alignment;
  open_ellipsoids(&e, 6, (const double[3]){2, 1, 1}, (const double[3]){3, 1, 1});
  align(&e, &alignment);
  double c2 = spheroid_area(2) / spheroid_area(3), across = c2, along = 2.25 * c2;
  double tip = 2 / (c2 + 1 / c2), side = 4 / (across + along + 1 / across + 1 / along);
  int tips = 0, sides = 0;
  for (int i = 0; i < alignment.found_count; i++) {
    double p[3];
    orb_place_position(&e.mesh[0], &alignment.found[2 * i], p);
    if (fabs(p[0]) > 1.999) {
      assert_true(fabs(alignment.confidence[i] - tip) < 0.02);
      tips++;
    } else if (fabs(p[0]) < 0.1) {
      assert_true(fabs(alignment.confidence[i] - side) < 0.02);
      sides++;
    }
    assert_true(alignment.confidence[i] < 0.99);
  }
  assert_int_equal(tips, 2);
  assert_true(sides > 0);
  orb_alignment_free(e.ctx, &alignment);
  close_ellipsoids(&e);
}

/* Found places are valid landmarks; the overlay has each of them where it was found. */
static void found_can_be_sent_again(void **state) {
  (void)state;
  ellipsoids e;
  orb_merge_options options;
  orb_merge_result first, second;
  orb_landmark landmarks[ORB_FOUND_MAX];
  const char *names[2] = {"a", "b"};
  open_ellipsoids(&e, 3, (const double[3]){3, 2, 1}, (const double[3]){3, 2.2, 1.2});
  orb_merge_defaults(&options);
  options.align.method = ORB_ALIGN_AUTO;
  options.align.preset = ORB_PRESET_FAST;
  options.remesh.method = ORB_REMESH_OVERLAY;
  assert_int_equal(orb_merge(e.ctx, e.shape, names, 2, NULL, 0, &options, &first), ORB_OK);
  memset(landmarks, 0, sizeof landmarks);
  for (int i = 0; i < first.alignment.found_count; i++) {
    landmarks[i].at = first.alignment.found + 2 * i;
    landmarks[i].confidence = first.alignment.confidence[i];
    assert_true(first.found_residuals[2 * i] < 1e-9 && first.found_residuals[2 * i + 1] < 1e-9);
  }
  options.align.method = ORB_ALIGN_PIN;
  assert_int_equal(orb_merge(e.ctx, e.shape, names, 2, landmarks, first.alignment.found_count, &options, &second),
                   ORB_OK);
  assert_int_equal(second.alignment.found_count, 0);
  for (int i = 0; i < 2 * second.alignment.landmark_count; i++) {
    assert_true(second.landmark_residuals[i] < 1e-6);
  }
  orb_merge_result_free(e.ctx, &second);
  orb_merge_result_free(e.ctx, &first);
  close_ellipsoids(&e);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(scaled_copy), cmocka_unit_test(known_stretch),
                                     cmocka_unit_test(found_can_be_sent_again)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
