/* Mirror landmarks: on a body with one plane of symmetry, on the same body rotated, and on one without symmetry. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#include "align/map/starts/mirror.h"
#include "support_shapes.h"

/* Four limbs in two pairs and two more in the plane x = 0; away: one limb of each pair points elsewhere. */
static const double limb[6][3] = {{0.6, -0.8, 0},      {-0.6, -0.8, 0},  {0.48, -0.6, 0.64},
                                  {-0.48, -0.6, 0.64}, {0, 0.28, -0.96}, {0, 0.8, 0.6}};
static const double away[6][3] = {{0.8, 0.6, 0},       {-0.6, -0.8, 0},  {0.48, 0.64, 0.6},
                                  {-0.48, -0.6, 0.64}, {0, 0.28, -0.96}, {0, 0.8, 0.6}};
static const double reach[6] = {2.5, 2.5, 2.1, 2.1, 2.9, 1.7};

static orb_mesh creature(orb_context *ctx, const double (*way)[3], int thirds) {
  orb_mesh mesh = shape_ball(ctx, 5);
  for (int32_t v = 0; v < mesh.vertex_count; v++) {
    double *p = mesh.positions + 3 * (size_t)v, r = 1, q[3];
    for (int i = 0; i < 6; i++) {
      r += (reach[i] - 1) * exp(-20 * (1 - p[0] * way[i][0] - p[1] * way[i][1] - p[2] * way[i][2]));
    }
    memcpy(q, p, sizeof q);
    for (int k = 0; k < 3; k++) {
      p[(k + thirds) % 3] = r * q[k] + 0.1 * k;
    }
  }
  return mesh;
}

/* The vertex farthest along a direction of the creature. */
static int32_t tip(const orb_mesh *mesh, const double way[3], int thirds) {
  int32_t best = 0;
  double most = -INFINITY;
  for (int32_t v = 0; v < mesh->vertex_count; v++) {
    double along = 0;
    for (int k = 0; k < 3; k++) {
      along += way[k] * mesh->positions[3 * (size_t)v + (size_t)((k + thirds) % 3)];
    }
    if (along > most) {
      most = along;
      best = v;
    }
  }
  return best;
}

typedef struct mirrored {
  int32_t count, vertex[2][4];
  orb_mesh mesh[2];
} mirrored;

/* Mirror landmarks of the tips of limbs 0, 2 and 4, of the creature and of a second body, which is rotated. */
static mirrored mirror(orb_context *ctx, const double (*second)[3]) {
  const orb_map_params params = orb_map_params_of(ORB_PRESET_DEFAULT);
  mirrored g = {.mesh = {creature(ctx, limb, 0), creature(ctx, second, 1)}};
  int32_t landmark[2][3];
  for (int i = 0; i < 3; i++) {
    landmark[0][i] = tip(&g.mesh[0], limb[2 * i], 0);
    landmark[1][i] = tip(&g.mesh[1], second[2 * i], 1);
  }
  const orb_mesh *const meshes[2] = {&g.mesh[0], &g.mesh[1]};
  const int32_t *const landmarks[2] = {landmark[0], landmark[1]};
  int32_t *const images[2] = {g.vertex[0], g.vertex[1]};
  assert_int_equal(orb_map_mirror_landmarks(ctx, &params, meshes, landmarks, 3, images, &g.count), ORB_OK);
  return g;
}

static void mirrored_free(orb_context *ctx, mirrored *g) {
  orb_mesh_free(ctx, &g->mesh[0]);
  orb_mesh_free(ctx, &g->mesh[1]);
}

/* Limbs 0 and 2 have the mirror images 1 and 3; limb 4 lies in the plane and is its own image. */
static void images_are_found_on_both(void **state) {
  (void)state;
  orb_context *ctx;
  assert_int_equal(orb_context_create(NULL, &ctx), ORB_OK);
  mirrored g = mirror(ctx, limb);
  assert_int_equal(g.count, 2);
  for (int i = 0; i < 2; i++) {
    for (int s = 0; s < 2; s++) {
      const double *p = g.mesh[s].positions + 3 * (size_t)g.vertex[s][i];
      const double *q = g.mesh[s].positions + 3 * (size_t)tip(&g.mesh[s], limb[2 * i + 1], s);
      double d = sqrt((p[0] - q[0]) * (p[0] - q[0]) + (p[1] - q[1]) * (p[1] - q[1]) + (p[2] - q[2]) * (p[2] - q[2]));
      assert_true(d < 0.15); /* an edge or two */
    }
  }
  mirrored_free(ctx, &g);
  orb_context_destroy(ctx);
}

static void none_where_one_shape_has_no_symmetry(void **state) {
  (void)state;
  orb_context *ctx;
  assert_int_equal(orb_context_create(NULL, &ctx), ORB_OK);
  mirrored g = mirror(ctx, away);
  assert_int_equal(g.count, 0);
  mirrored_free(ctx, &g);
  orb_context_destroy(ctx);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(images_are_found_on_both),
                                     cmocka_unit_test(none_where_one_shape_has_no_symmetry)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
