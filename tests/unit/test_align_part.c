/* Which landmarks show that only a part of a shape corresponds. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "align/map/space/part.h"
#include "orbmorph/context.h"

enum { LANDMARKS = 8 };

/* The corners of a cube, and the same points with each axis scaled, each on a surface of one triangle whose area is 1.
 */
static orb_map_part part_of(const double scale[3], int32_t landmarks) {
  double positions[2][3 * (LANDMARKS + 3)] = {{0}};
  int32_t vertex[LANDMARKS], triangle[3] = {LANDMARKS, LANDMARKS + 1, LANDMARKS + 2};
  const double corner[9] = {0, 0, 0, 2, 0, 0, 0, 1, 0};
  orb_aligned_shape shape[2] = {0};
  orb_context *ctx;
  orb_map_part part = ORB_MAP_NO_PART;
  assert_int_equal(orb_context_create(NULL, &ctx), ORB_OK);
  for (int i = 0; i < LANDMARKS; i++) {
    vertex[i] = i;
    for (int k = 0; k < 3; k++) {
      positions[1][3 * i + k] = (i >> k & 1) - 0.5;
      positions[0][3 * i + k] = scale[k] * positions[1][3 * i + k];
    }
  }
  for (int s = 0; s < 2; s++) {
    memcpy(positions[s] + 3 * LANDMARKS, corner, sizeof corner);
    shape[s].mesh = (orb_mesh){
        .positions = positions[s], .vertex_count = LANDMARKS + 3, .triangles = triangle, .triangle_count = 1};
    shape[s].landmark_vertices = vertex;
  }
  const orb_map_params params = orb_map_params_of(ORB_PRESET_DEFAULT);
  assert_int_equal(orb_map_find_part(ctx, &params, &shape[0], &shape[1], landmarks, &part), ORB_OK);
  orb_context_destroy(ctx);
  return part;
}

static int is_part(const double scale[3], int32_t landmarks) {
  return part_of(scale, landmarks) != ORB_MAP_NO_PART;
}

static void the_part_is_the_shape_with_longer_distances(void **state) {
  (void)state;
  assert_int_equal(part_of((const double[3]){1.5, 1.5, 1.5}, LANDMARKS), ORB_MAP_PART_IS_FIXED);
  assert_int_equal(part_of((const double[3]){0.6, 0.6, 0.6}, LANDMARKS), ORB_MAP_PART_MOVES);
}

static void landmarks_of_another_scale_show_a_part(void **state) {
  (void)state;
  assert_true(is_part((const double[3]){1.5, 1.5, 1.5}, LANDMARKS));
  assert_true(is_part((const double[3]){1.45, 1.5, 1.6}, LANDMARKS));
  assert_true(is_part((const double[3]){0.6, 0.6, 0.6}, LANDMARKS)); /* the other shape is the part */
}

static void other_landmarks_show_no_part(void **state) {
  (void)state;
  assert_false(is_part((const double[3]){1, 1, 1}, LANDMARKS));
  assert_false(is_part((const double[3]){1.2, 1.25, 1.3}, LANDMARKS));
  assert_false(is_part((const double[3]){1.4, 2, 3}, LANDMARKS)); /* limbs are longer, but not all alike */
  assert_false(is_part((const double[3]){1, 1, 3}, LANDMARKS));
  assert_false(is_part((const double[3]){1.5, 1.5, 1.5}, 4)); /* too few to be sure */
  assert_true(is_part((const double[3]){1.5, 1.5, 1.5}, 5));
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(the_part_is_the_shape_with_longer_distances),
                                     cmocka_unit_test(landmarks_of_another_scale_show_a_part),
                                     cmocka_unit_test(other_landmarks_show_no_part)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
