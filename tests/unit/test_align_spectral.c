/* Eigenfunctions of shapes whose spectra are known, and whether the spectral search finds known maps. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#include "spectral/shape.h"
#include "spectral/spectral.h"
#include "support_context.h"
#include "support_shapes.h"

enum { LIMBS = 5 };

/* Five directions without any symmetry, and how far the limbs reach. */
static const double limb[LIMBS][3] = {{1, 0, 0}, {-0.6, 0.8, 0}, {0, -0.8, 0.6}, {-0.48, -0.6, -0.64}, {0, 0.28, 0.96}};
static const double reach[LIMBS] = {4, 3.4, 2.9, 2.5, 2.2};

/* Limbs with a plane of symmetry, x = 0: the first two and the next two are twins. */
static const double twin_limb[LIMBS][3] = {
    {0.8, -0.6, 0}, {-0.8, -0.6, 0}, {0.6, 0.64, 0.48}, {-0.6, 0.64, 0.48}, {0, 0, -1}};
static const double twin_reach[LIMBS] = {3.5, 3.5, 2.5, 2.5, 2};

static orb_mesh creature_of(const double (*direction)[3], const double *far, int levels) {
  return shape_creature(ctx, LIMBS, direction, far, levels);
}

/* x, y, z → y, z, x: a rotation; and other vertex numbers. */
static void rotate(orb_mesh *mesh) {
  int32_t n = mesh->vertex_count;
  double *old = mesh->positions;
  mesh->positions = orb_alloc(ctx, 3 * (size_t)n, sizeof(double));
  assert_non_null(mesh->positions);
  for (int32_t v = 0; v < n; v++) {
    double *p = mesh->positions + 3 * (size_t)(n - 1 - v), *q = old + 3 * (size_t)v;
    for (int k = 0; k < 3; k++) {
      p[k] = q[(k + 1) % 3];
    }
  }
  for (int32_t h = 0; h < 3 * mesh->triangle_count; h++) {
    mesh->triangles[h] = n - 1 - mesh->triangles[h];
  }
  orb_free(ctx, old);
}

/* x → −x; the faces still face outwards. */
static void mirror(orb_mesh *mesh) {
  for (int32_t v = 0; v < mesh->vertex_count; v++) {
    mesh->positions[3 * (size_t)v] *= -1;
  }
  for (int32_t t = 0; t < mesh->triangle_count; t++) {
    int32_t *v = mesh->triangles + 3 * (size_t)t, first = v[0];
    v[0] = v[1];
    v[1] = first;
  }
}

/* The mean angle between the direction of a vertex of one mesh, taken to the other, and that of its partner. */
static double mean_angle(const orb_spectral_candidate *one, const orb_mesh *a, const orb_mesh *b, int rotated,
                         double sign) {
  double sum = 0;
  assert_true(one->count >= 12);
  for (int32_t i = 0; i < one->count; i++) {
    const double *p = a->positions + 3 * (size_t)one->first[i], *q = b->positions + 3 * (size_t)one->second[i];
    double dot = 0, pp = 0, qq = 0;
    for (int k = 0; k < 3; k++) {
      double x = p[rotated ? (k + 1) % 3 : k] * (k == 0 ? sign : 1);
      dot += x * q[k];
      pp += x * x;
      qq += q[k] * q[k];
    }
    sum += acos(fmin(1, dot / sqrt(pp * qq))) / one->count;
  }
  return sum;
}

/* A ball of area 1: the eigenvalues are 4π l (l + 1), 2 l + 1 times each. */
static void a_ball_has_spherical_harmonics(void **state) {
  (void)state;
  orb_mesh ball = shape_ball(ctx, 4);
  orb_spectral_shape shape;
  assert_int_equal(orb_spectral_shape_create(ctx, &ball, 0, &shape), ORB_OK);
  assert_true(shape.is_usable);
  for (int l = 0, k = 0; l < 5; l++) {
    for (int m = 0; m < 2 * l + 1; m++, k++) {
      assert_true(fabs(shape.value[k] - 4 * M_PI * l * (l + 1)) < 0.03 * 4 * M_PI * l * (l + 1) + 1e-6);
    }
  }
  double share = 0, far = 0;
  for (int s = 0; s < ORB_SPECTRAL_SAMPLES; s++) {
    share += shape.share[2][s];
    assert_true(fabs(fabs(shape.at[0][s]) - 1) < 1e-4); /* constant, of length 1 */
    for (int k = 0; k < ORB_SPECTRAL_SAMPLES; k++) {
      far = fmax(far, shape.distance[s * ORB_SPECTRAL_SAMPLES + k]);
    }
  }
  assert_true(fabs(share - 1) < 1e-9);
  assert_true(far > 0.98 * M_PI / sqrt(4 * M_PI) && far < 1.08 * M_PI / sqrt(4 * M_PI)); /* half a great circle */
  orb_spectral_shape_free(ctx, &shape);
  shape_free(ctx, &ball);
}

/* The size and the place of a shape do not matter. */
static void size_does_not_matter(void **state) {
  (void)state;
  orb_mesh a = creature_of(limb, reach, 3), b = creature_of(limb, reach, 3);
  orb_spectral_shape one, other;
  for (int32_t i = 0; i < 3 * b.vertex_count; i++) {
    b.positions[i] = 1000 * b.positions[i] + 5000;
  }
  assert_int_equal(orb_spectral_shape_create(ctx, &a, 0, &one), ORB_OK);
  assert_int_equal(orb_spectral_shape_create(ctx, &b, 0, &other), ORB_OK);
  for (int k = 1; k < ORB_SPECTRAL_FUNCTIONS; k++) {
    assert_true(fabs(one.value[k] / other.value[k] - 1) < 1e-6);
  }
  assert_memory_equal(one.sample, other.sample, sizeof one.sample);
  orb_spectral_shape_free(ctx, &one);
  orb_spectral_shape_free(ctx, &other);
  shape_free(ctx, &a);
  shape_free(ctx, &b);
}

/* The same creature, rotated, with other vertex numbers and more finely meshed. */
static void a_copy_is_found(void **state) {
  (void)state;
  orb_mesh a = creature_of(limb, reach, 3), b = creature_of(limb, reach, 4);
  orb_spectral_list list;
  rotate(&b);
  assert_int_equal(orb_spectral_find(ctx, &a, &b, 0, &list), ORB_OK);
  assert_true(list.count > 0);
  assert_true(mean_angle(&list.candidate[0], &a, &b, 1, 1) < 0.1);
  assert_true(list.candidate[0].facing > 0.5);
  for (int32_t i = 1; i < list.count; i++) {
    assert_true(list.candidate[i].cost >= list.candidate[i - 1].cost);
  }
  shape_free(ctx, &a);
  shape_free(ctx, &b);
}

/* A mirror image is found, and only as a mirror image. */
static void a_mirror_image_is_told_apart(void **state) {
  (void)state;
  orb_mesh a = creature_of(limb, reach, 3), b = creature_of(limb, reach, 3);
  orb_spectral_list list, mirrored;
  mirror(&b);
  assert_int_equal(orb_spectral_find(ctx, &a, &b, 1, &mirrored), ORB_OK);
  assert_true(mirrored.count > 0);
  assert_true(mean_angle(&mirrored.candidate[0], &a, &b, 0, -1) < 0.1);
  assert_int_equal(orb_spectral_find(ctx, &a, &b, 0, &list), ORB_OK);
  for (int32_t i = 0; i < list.count; i++) {
    assert_true(mean_angle(&list.candidate[i], &a, &b, 0, -1) > 0.2);
    assert_true(list.candidate[i].cost > mirrored.candidate[0].cost);
  }
  shape_free(ctx, &a);
  shape_free(ctx, &b);
}

/* A shape with a plane of symmetry maps to itself in two ways: by the identity and by the reflection. */
static void twins_are_known(void **state) {
  (void)state;
  orb_mesh a = creature_of(twin_limb, twin_reach, 3);
  orb_spectral_list list;
  assert_int_equal(orb_spectral_find(ctx, &a, &a, 0, &list), ORB_OK);
  assert_true(list.count > 0 && mean_angle(&list.candidate[0], &a, &a, 0, 1) < 0.1);
  assert_int_equal(orb_spectral_find(ctx, &a, &a, 1, &list), ORB_OK);
  assert_true(list.count > 0 && mean_angle(&list.candidate[0], &a, &a, 0, -1) < 0.1);
  shape_free(ctx, &a);
}

static void threads_change_nothing(void **state) {
  (void)state;
  orb_mesh a = creature_of(limb, reach, 3), b = creature_of(twin_limb, reach, 3);
  orb_spectral_list one, other;
  orb_context_options options = {.threads = 3};
  orb_context *three;
  assert_int_equal(orb_context_create(&options, &three), ORB_OK);
  assert_int_equal(orb_spectral_find(ctx, &a, &b, 0, &one), ORB_OK);
  assert_int_equal(orb_spectral_find(three, &a, &b, 0, &other), ORB_OK);
  assert_int_equal(one.count, other.count);
  for (int32_t i = 0; i < one.count; i++) {
    const orb_spectral_candidate *x = &one.candidate[i], *y = &other.candidate[i];
    assert_int_equal(x->count, y->count);
    assert_memory_equal(&x->cost, &y->cost, sizeof x->cost);
    assert_memory_equal(x->first, y->first, (size_t)x->count * sizeof *x->first);
    assert_memory_equal(x->second, y->second, (size_t)x->count * sizeof *x->second);
  }
  orb_context_destroy(three);
  shape_free(ctx, &a);
  shape_free(ctx, &b);
}

/* With too few vertices or without area there are no candidates, and no error. */
static void what_cannot_be_used_has_no_candidates(void **state) {
  (void)state;
  orb_mesh a = shape_icosahedron(ctx), b = creature_of(limb, reach, 3);
  orb_spectral_list list;
  assert_int_equal(orb_spectral_find(ctx, &a, &b, 0, &list), ORB_OK);
  assert_int_equal(list.count, 0);
  memset(b.positions, 0, 3 * (size_t)b.vertex_count * sizeof *b.positions);
  assert_int_equal(orb_spectral_find(ctx, &b, &b, 0, &list), ORB_OK);
  assert_int_equal(list.count, 0);
  shape_free(ctx, &a);
  shape_free(ctx, &b);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(a_ball_has_spherical_harmonics),
                                     cmocka_unit_test(size_does_not_matter),
                                     cmocka_unit_test(a_copy_is_found),
                                     cmocka_unit_test(a_mirror_image_is_told_apart),
                                     cmocka_unit_test(twins_are_known),
                                     cmocka_unit_test(threads_change_nothing),
                                     cmocka_unit_test(what_cannot_be_used_has_no_candidates)};
  return cmocka_run_group_tests(tests, context_one_thread, context_end);
}
