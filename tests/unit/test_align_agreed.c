/* Rough maps extended from the part on which a registration agrees with its way back: on a creature whose places are
 * known, since it is matched with itself. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "align/find/agreed.h"
#include "base/memory.h"
#include "support_context.h"
#include "support_shapes.h"

enum { LIMBS = 5 };

/* Five asymmetric directions, and the lengths of the limbs. */
static const double limb[LIMBS][3] = {{1, 0, 0}, {-0.6, 0.8, 0}, {0, -0.8, 0.6}, {-0.48, -0.6, -0.64}, {0, 0.28, 0.96}};
static const double reach[LIMBS] = {4, 3.4, 2.9, 2.5, 2.2};

/* A creature of area 4π, and where a registration takes it, and back. */
typedef struct scene {
  orb_mesh mesh;
  double *position[2];
  int32_t *forth, *back;
} scene;

/* All vertices at their places. */
static scene scene_open(void) {
  scene s = {.mesh = shape_creature(ctx, LIMBS, limb, reach, 4)};
  const size_t n = (size_t)s.mesh.vertex_count;
  orb_extent extent;
  orb_mesh_extent(&s.mesh, &extent);
  for (size_t i = 0; i < 3 * n; i++) {
    s.mesh.positions[i] *= sqrt(4 * M_PI / extent.area);
  }
  for (int k = 0; k < 2; k++) {
    s.position[k] = orb_alloc(ctx, 3 * n, sizeof(double));
    assert_non_null(s.position[k]);
    memcpy(s.position[k], s.mesh.positions, 3 * n * sizeof(double));
  }
  s.forth = orb_alloc(ctx, n, sizeof(int32_t));
  s.back = orb_alloc(ctx, n, sizeof(int32_t));
  assert_true(s.forth && s.back);
  return s;
}

static void scene_close(scene *s) {
  orb_free(ctx, s->position[0]);
  orb_free(ctx, s->position[1]);
  orb_free(ctx, s->forth);
  orb_free(ctx, s->back);
  shape_free(ctx, &s->mesh);
}

static orb_status extend(scene *s, int *extended) {
  const double *const position[2] = {s->position[0], s->position[1]};
  const orb_mesh *const mesh[2] = {&s->mesh, &s->mesh};
  orb_agreed agreed = {0};
  orb_survey survey;
  orb_status status = orb_survey_create(ctx, &s->mesh, 1, &survey);
  const orb_survey *const surveys[2] = {&survey, &survey};
  if (status == ORB_OK) {
    status = orb_agreed_create(ctx, mesh, surveys, &agreed);
  }
  if (status == ORB_OK) {
    status = orb_agreed_extend(ctx, &agreed, position, 1, s->forth, s->back, extended);
  }
  orb_agreed_free(ctx, &agreed);
  orb_survey_free(ctx, &survey);
  return status;
}

/* How far along limb i a point lies: 1 at its end, at most 0 elsewhere. */
static double along(const scene *s, int i, const double p[3]) {
  const double *tip = s->mesh.positions + 3 * (size_t)shape_farthest(&s->mesh, limb[i]);
  const double length = sqrt(tip[0] * tip[0] + tip[1] * tip[1] + tip[2] * tip[2]);
  const double far = p[0] * limb[i][0] + p[1] * limb[i][1] + p[2] * limb[i][2];
  const double off = sqrt(fmax(0, p[0] * p[0] + p[1] * p[1] + p[2] * p[2] - far * far));
  return off < 0.5 * far ? far / length : 0;
}

/* Takes the outer two thirds of limb i to limb k. */
static void misplace(scene *s, int i, int k) {
  const double *tip = s->mesh.positions + 3 * (size_t)shape_farthest(&s->mesh, limb[k]);
  for (int32_t v = 0; v < s->mesh.vertex_count; v++) {
    const double far = along(s, i, s->mesh.positions + 3 * (size_t)v);
    for (int c = 0; c < 3 && far > 0.33; c++) {
      s->position[0][3 * (size_t)v + (size_t)c] = far * tip[c];
    }
  }
}

static void misplace_two(scene *s) {
  misplace(s, 0, 1);
  misplace(s, 2, 3);
}

static double distance(const scene *s, int32_t v, int32_t u) {
  const double *x = s->mesh.positions + 3 * (size_t)v, *y = s->mesh.positions + 3 * (size_t)u;
  return sqrt((x[0] - y[0]) * (x[0] - y[0]) + (x[1] - y[1]) * (x[1] - y[1]) + (x[2] - y[2]) * (x[2] - y[2]));
}

/* A limb that lies on another limb goes to its own, and all other vertices stay. */
static void a_limb_goes_to_its_own(void **state) {
  (void)state;
  int extended;
  scene s = scene_open();
  misplace_two(&s);
  assert_int_equal(extend(&s, &extended), ORB_OK);
  assert_true(extended);
  for (int32_t v = 0; v < s.mesh.vertex_count; v++) { /* an edge is about 0.1 long */
    assert_true(distance(&s, v, s.forth[v]) < 0.25);
    assert_true(distance(&s, v, s.back[v]) < 0.25);
  }
  scene_close(&s);
}

/* Where all agree, or nearly nothing does, there is nothing to extend. */
static void nothing_is_extended(void **state) {
  (void)state;
  int extended;
  scene s = scene_open();
  assert_int_equal(extend(&s, &extended), ORB_OK);
  assert_false(extended);
  for (int32_t v = 1; v < s.mesh.vertex_count; v++) {
    memcpy(s.position[0] + 3 * (size_t)v, s.position[0], 3 * sizeof(double));
  }
  assert_int_equal(extend(&s, &extended), ORB_OK);
  assert_false(extended);
  scene_close(&s);
}

static void *alloc_or_fail(void *left, size_t size) {
  return (*(int *)left)-- == 0 ? NULL : malloc(size);
}

static void free_it(void *left, void *block) {
  (void)left;
  free(block);
}

/* Each allocation fails once: that is reported, and destroying the context finds nothing left behind. */
static void memory_runs_out(void **state) {
  (void)state;
  scene s = scene_open();
  misplace_two(&s);
  orb_context *all = ctx;
  int failed = 0, extended = 0;
  for (int call = 1; !extended && call < 1000; call++) { /* the allocation of the context comes before these */
    int left = call;
    const orb_context_options setup = {.threads = 1, .allocator = {alloc_or_fail, free_it, &left}};
    assert_int_equal(orb_context_create(&setup, &ctx), ORB_OK);
    const orb_status status = extend(&s, &extended);
    assert_true(status == ORB_OK || status == ORB_E_NO_MEMORY);
    failed += status == ORB_E_NO_MEMORY;
    orb_context_destroy(ctx);
  }
  ctx = all;
  assert_true(extended);
  assert_true(failed > 5);
  scene_close(&s);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(a_limb_goes_to_its_own), cmocka_unit_test(nothing_is_extended),
                                     cmocka_unit_test(memory_runs_out)};
  return cmocka_run_group_tests(tests, context_one_thread, context_end);
}
