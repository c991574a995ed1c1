/* The subdivision method on synthetic shapes. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#include "base/memory.h"
#include "numeric/vec3.h"
#include "support_remesh.h"

static void run(orb_context *ctx, const orb_aligned_shape *shapes, int count, int landmarks, orb_supermesh *out) {
  orb_remesh_options options;
  orb_remesh_defaults(&options);
  options.method = ORB_REMESH_SUBDIVISION;
  orb_status status = orb_remesh(ctx, shapes, count, landmarks, &options, out);
  if (status != ORB_OK) {
    print_message("%s: %s\n", orb_status_name(status), orb_context_error(ctx)->detail);
  }
  assert_int_equal(status, ORB_OK);
}

/* Every vertex of every shape is a corner place of some supermesh vertex. */
static void assert_vertices_present(const orb_supermesh *m, const orb_aligned_shape *shapes, int count) {
  for (int s = 0; s < count; s++) {
    int32_t present = 0, *seen = test_calloc((size_t)shapes[s].mesh.vertex_count, sizeof *seen);
    for (int32_t v = 0; v < m->vertex_count; v++) {
      const orb_place *place = &m->places[(size_t)s * (size_t)m->vertex_count + (size_t)v];
      for (int k = 0; k < 3; k++) {
        int32_t corner = shapes[s].mesh.triangles[3 * place->triangle + k];
        if (place->at[k] == 1 && !seen[corner]) {
          seen[corner] = 1;
          present++;
        }
      }
    }
    assert_int_equal(present, shapes[s].mesh.vertex_count);
    test_free(seen);
  }
}

static void check_pair(sphere_kind a, int a_size, sphere_kind b, int b_size, double jitter, unsigned seed_b) {
  orb_context *ctx = remesh_context(2);
  orb_aligned_shape shapes[2];
  sphere_shape(ctx, a, a_size, jitter, jitter > 0 ? 1 : 0, &shapes[0]);
  sphere_shape(ctx, b, b_size, jitter, seed_b, &shapes[1]);
  orb_supermesh m;
  run(ctx, shapes, 2, 0, &m);
  sphere_assert_valid(&m, shapes, 2);
  assert_vertices_present(&m, shapes, 2);
  orb_supermesh_free(ctx, &m);
  sphere_shape_free(ctx, &shapes[0]);
  sphere_shape_free(ctx, &shapes[1]);
  orb_context_destroy(ctx); /* asserts that all was freed */
}

static void holds_every_vertex(void **state) {
  (void)state;
  check_pair(SPHERE_ICO, 3, SPHERE_OCTA, 3, 0.2, 2);
  check_pair(SPHERE_TETRA, 0, SPHERE_TETRA, 0, 0, 0);
  check_pair(SPHERE_OCTA, 0, SPHERE_OCTA, 4, 0, 0);
  check_pair(SPHERE_UV, 20, SPHERE_ICO, 4, 0, 5);
  check_pair(SPHERE_UV, 24, SPHERE_UV, 24, 0, 0);
  check_pair(SPHERE_TETRA, 0, SPHERE_ICO, 4, 0, 5);
}

static void coincident_landmarks_are_one_vertex(void **state) {
  (void)state;
  orb_context *ctx = remesh_context(1);
  orb_aligned_shape shapes[3];
  sphere_shape(ctx, SPHERE_OCTA, 3, 0, 0, &shapes[0]);
  sphere_shape(ctx, SPHERE_UV, 16, 0, 0, &shapes[1]);
  sphere_shape(ctx, SPHERE_OCTA, 2, 0, 0, &shapes[2]);
  const double pole[3] = {0, 0, 1};
  for (int s = 0; s < 3; s++) {
    shapes[s].landmark_vertices = ORB_NEW(ctx, int32_t, 2);
    for (int32_t v = 0; v < shapes[s].mesh.vertex_count; v++) {
      if (memcmp(shapes[s].points + 3 * v, pole, sizeof pole) == 0) {
        shapes[s].landmark_vertices[0] = v;
      }
    }
    shapes[s].landmark_vertices[1] = s == 1 ? 5 : 0; /* not at one place: no vertex represents it */
  }
  orb_supermesh m;
  run(ctx, shapes, 3, 2, &m);
  sphere_assert_valid(&m, shapes, 3);
  assert_true(m.landmark_vertices[0] >= 0);
  assert_memory_equal(m.points + 3 * m.landmark_vertices[0], pole, sizeof pole);
  assert_int_equal(m.landmark_vertices[1], -1);
  orb_supermesh_free(ctx, &m);
  for (int s = 0; s < 3; s++) {
    sphere_shape_free(ctx, &shapes[s]);
  }
  orb_context_destroy(ctx);
}

static void threads_do_not_matter(void **state) {
  (void)state;
  remesh_assert_threads_do_not_matter(ORB_REMESH_SUBDIVISION);
}

static void cancelling_ends_it(void **state) {
  (void)state;
  orb_context *ctx = remesh_context(1);
  orb_aligned_shape shapes[2];
  sphere_shape(ctx, SPHERE_ICO, 3, 0, 0, &shapes[0]);
  sphere_shape(ctx, SPHERE_ICO, 3, 0, 1, &shapes[1]);
  orb_context_cancel(ctx);
  orb_remesh_options options;
  orb_remesh_defaults(&options);
  options.method = ORB_REMESH_SUBDIVISION;
  orb_supermesh m;
  assert_int_equal(orb_remesh(ctx, shapes, 2, 0, &options, &m), ORB_E_CANCELLED);
  sphere_shape_free(ctx, &shapes[0]);
  sphere_shape_free(ctx, &shapes[1]);
  orb_context_destroy(ctx); /* asserts that all was freed */
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(holds_every_vertex),
      cmocka_unit_test(coincident_landmarks_are_one_vertex),
      cmocka_unit_test(threads_do_not_matter),
      cmocka_unit_test(cancelling_ends_it),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
