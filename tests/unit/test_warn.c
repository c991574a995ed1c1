/* Warnings of a report, on tubes whose maps are known: their places, their shares of the area, and maps without
 * warnings. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "base/memory.h"
#include "merge/report.h"
#include "merge/warn.h"
#include "support_context.h"

enum { AROUND = 36, RINGS = 201, VERTICES = AROUND * RINGS, TRIANGLES = 2 * AROUND * (RINGS - 1) };
static const double LENGTH = 10;

static int32_t triangles[3 * TRIANGLES];
static double position[2][3 * VERTICES];
static const double unmoved[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
static const orb_warn_pair tubes = {triangles, TRIANGLES, VERTICES, {position[0], position[1]}, {unmoved, unmoved}};

typedef double (*profile)(double z);

/* Two tubes of radius 1 along z. On the second, the ring at z is moved to length(z) and rotated by turn(z). */
static void make_tubes(profile length, profile turn) {
  for (int i = 0; i < RINGS; i++) {
    double z = LENGTH * i / (RINGS - 1);
    for (int k = 0; k < AROUND; k++) {
      double angle = 2 * M_PI * k / AROUND;
      const double a[3] = {cos(angle), sin(angle), z}, b[3] = {cos(angle + turn(z)), sin(angle + turn(z)), length(z)};
      memcpy(position[0] + 3 * (AROUND * i + k), a, sizeof a);
      memcpy(position[1] + 3 * (AROUND * i + k), b, sizeof b);
    }
  }
  for (int i = 0; i + 1 < RINGS; i++) {
    for (int k = 0; k < AROUND; k++) {
      int32_t p = AROUND * i + k, q = AROUND * i + (k + 1) % AROUND;
      const int32_t two[6] = {p, q, p + AROUND, q, q + AROUND, p + AROUND};
      memcpy(triangles + 6 * (AROUND * i + k), two, sizeof two);
    }
  }
}

static double same(double z) {
  return z;
}

static double none(double z) {
  (void)z;
  return 0;
}

static double factor, band_share, from[2]; /* bands of this share of the tube begin at `from` */

/* Lengthens the bands by the factor. */
static double bands(double z) {
  double out = z;
  for (int i = 0; i < 2; i++) {
    out += (factor - 1) * fmin(fmax(z - from[i], 0), band_share * LENGTH);
  }
  return out;
}

static double half_twist(double z) {
  return fmin(fmax(M_PI * (z - 5), 0), M_PI); /* from z = 5 to z = 6 */
}

static double quarter_twist(double z) {
  return 0.5 * half_twist(z);
}

static void lengthen(double by, double share, double first, double second) {
  factor = by;
  band_share = share;
  from[0] = first;
  from[1] = second;
  make_tubes(bands, none);
}

/* After scaling to the same area, a band lengthened by k has σ² = r and r k², where r is the ratio of the areas. */
static double band_energy(double k, double area) {
  double r = 1 / area;
  return 0.25 * (r + 1 / r + r * k * k + 1 / (r * k * k));
}

static void test_bands(void **state) {
  (void)state;
  orb_warning warning = {0};
  double area = 0.9 + 0.1 * 13;
  lengthen(13, 0.05, 1, 7);
  assert_true(band_energy(13, area) < 20);
  assert_int_equal(orb_warn_stretched(ctx, &tubes, &warning), ORB_OK);
  assert_int_equal(warning.part_count, 0);

  lengthen(20, 0.05, 1, 7);
  area = 0.9 + 0.1 * 20;
  assert_true(band_energy(20, area) > 20);
  assert_int_equal(orb_warn_stretched(ctx, &tubes, &warning), ORB_OK);
  assert_int_equal(warning.part_count, 2);
  assert_true(fabs(warning.share - 2 / area) < 1e-9);
  for (int i = 0; i < 2; i++) {
    const orb_warning_part *part = &warning.parts[i];
    int later = part->centre[0][2] > 4;
    assert_true(fabs(part->share - 1 / area) < 1e-9);
    assert_true(fabs(part->centre[0][2] - (later ? 7.25 : 1.25)) < 1e-9);
    assert_true(fabs(part->centre[1][2] - bands(later ? 7.25 : 1.25)) < 1e-9);
    assert_true(fabs(part->radius[0] - hypot(1, 0.25)) < 1e-9 && fabs(part->radius[1] - hypot(1, 5)) < 1e-9);
    assert_int_equal(part->triangle_count, ORB_WARNING_TRIANGLES);
    for (int k = 0; k < 3 * ORB_WARNING_TRIANGLES; k++) {
      double z = position[0][3 * part->triangles[k] + 2], first = later ? 7 : 1;
      assert_true(z > first - 1e-9 && z < first + 0.5 + 1e-9);
    }
  }
  assert_true(warning.parts[0].centre[0][2] * warning.parts[1].centre[0][2] < 7.3 * 1.3); /* not twice the same */
}

/* Half a per cent of the first shape and a twentieth of the second: a limb that grew counts on the shape on which it is
 * large. */
static void test_either_shape(void **state) {
  (void)state;
  orb_warning warning = {0};
  lengthen(11, 0.005, 3, 30);
  assert_true(band_energy(11, 1.05) > 20);
  assert_int_equal(orb_warn_stretched(ctx, &tubes, &warning), ORB_OK);
  assert_int_equal(warning.part_count, 1);
  assert_true(fabs(warning.share - 0.055 / 1.05) < 1e-9);
}

static void test_collapsed(void **state) {
  (void)state;
  orb_warning warning = {0};
  lengthen(0, 0.05, 1, 30); /* to nothing */
  assert_int_equal(orb_warn_stretched(ctx, &tubes, &warning), ORB_OK);
  assert_int_equal(warning.part_count, 1);
  assert_true(fabs(warning.share - 0.05) < 1e-9);
}

static void test_twist(void **state) {
  (void)state;
  orb_warning warning = {0};
  make_tubes(same, quarter_twist); /* halfway cos 45° of the radius is left */
  assert_int_equal(orb_warn_thin(ctx, &tubes, &warning), ORB_OK);
  assert_int_equal(warning.part_count, 0);

  make_tubes(same, half_twist); /* halfway the tube is a line from z = 6 on, and below half its radius from 5.67 on */
  assert_int_equal(orb_warn_thin(ctx, &tubes, &warning), ORB_OK);
  assert_true(warning.part_count >= 1);
  assert_true(warning.share > 0.39 && warning.share < 0.51);
  assert_true(warning.parts[0].centre[0][2] > 7 && warning.parts[0].centre[0][2] < 9);
  for (int k = 0; k < 3 * warning.parts[0].triangle_count; k++) {
    assert_true(position[0][3 * warning.parts[0].triangles[k] + 2] > 4.5);
  }
}

/* A motion of the whole shape makes nothing thin once it is undone: here half a turn around z. */
static void test_moved(void **state) {
  (void)state;
  static const double turned[16] = {-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  orb_warn_pair pair = tubes;
  orb_warning warning = {0};
  make_tubes(same, none);
  for (int v = 0; v < VERTICES; v++) {
    position[1][3 * v] *= -1;
    position[1][3 * v + 1] *= -1;
  }
  assert_int_equal(orb_warn_thin(ctx, &pair, &warning), ORB_OK);
  assert_true(warning.share > 0.99);
  memset(&warning, 0, sizeof warning);
  pair.move[1] = turned;
  assert_int_equal(orb_warn_thin(ctx, &pair, &warning), ORB_OK);
  assert_int_equal(warning.part_count, 0);
}

/* Rotates the far half by 60°: it keeps √3/2 of its width halfway, more than half. */
static double turned_by_60(double z) {
  return z > LENGTH / 2 ? M_PI / 3 : 0;
}

/* Files in other units make nothing thin either: a copy that is 100 times as large, scaled back by the motion. */
static void test_units(void **state) {
  (void)state;
  static const double back[16] = {0.01, 0, 0, 0, 0, 0.01, 0, 0, 0, 0, 0.01, 0, 0, 0, 0, 1};
  orb_warn_pair pair = tubes;
  orb_warning warning = {0};
  make_tubes(same, turned_by_60);
  for (int i = 0; i < 3 * VERTICES; i++) {
    position[1][i] *= 100;
  }
  pair.move[1] = back;
  assert_int_equal(orb_warn_thin(ctx, &pair, &warning), ORB_OK);
  assert_int_equal(warning.part_count, 0);
}

/* A band that the map stretches to 400 times its length consists of needles there, and of none where it came from. */
static void test_needles_of_one_shape(void **state) {
  (void)state;
  static orb_place places[2 * VERTICES];
  orb_aligned_shape shapes[2] = {{.points = position[0]}, {.points = position[0]}};
  orb_merge_result out = {.supermesh = {.shape_count = 2,
                                        .vertex_count = VERTICES,
                                        .triangle_count = TRIANGLES,
                                        .triangles = triangles,
                                        .points = position[0],
                                        .places = places},
                          .alignment = {.shapes = shapes, .shape_count = 2}};
  lengthen(400, 0.05, 1, 30);
  for (int s = 0; s < 2; s++) {
    shapes[s].mesh = (orb_mesh){
        .positions = position[s], .triangles = triangles, .vertex_count = VERTICES, .triangle_count = TRIANGLES};
    for (int32_t i = 0; i < 3 * TRIANGLES; i++) {
      places[VERTICES * s + triangles[i]] = (orb_place){.triangle = i / 3, .at = {i % 3 == 0, i % 3 == 1, i % 3 == 2}};
    }
  }
  assert_int_equal(orb_report_pairs(ctx, NULL, &out), ORB_OK);
  int found = 0;
  for (int32_t i = 0; i < out.warning_count; i++) {
    if (out.warnings[i].kind == ORB_WARNING_STRETCHED) {
      found++;
      assert_true(fabs(out.warnings[i].share - 200 / 209.5) < 1e-9);
    }
  }
  assert_int_equal(found, 1);
  orb_free(ctx, out.pairs);
  orb_free(ctx, out.warnings);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_bands),
                                     cmocka_unit_test(test_either_shape),
                                     cmocka_unit_test(test_collapsed),
                                     cmocka_unit_test(test_twist),
                                     cmocka_unit_test(test_moved),
                                     cmocka_unit_test(test_units),
                                     cmocka_unit_test(test_needles_of_one_shape)};
  return cmocka_run_group_tests(tests, context_one_thread, context_end);
}
