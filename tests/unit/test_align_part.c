/* Which landmarks show that only a part of a shape corresponds. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "align/map/space/part.h"
#include "orbmorph/context.h"

enum { LANDMARKS = 8 };

/* The corners of a cube, and the same points with each axis scaled. */
static int is_part(const double scale[3], int32_t landmarks) {
  double moving[3 * LANDMARKS], fixed[3 * LANDMARKS];
  int32_t vertex[LANDMARKS];
  orb_context *ctx;
  int part = -1;
  assert_int_equal(orb_context_create(NULL, &ctx), ORB_OK);
  for (int i = 0; i < LANDMARKS; i++) {
    vertex[i] = i;
    for (int k = 0; k < 3; k++) {
      moving[3 * i + k] = (i >> k & 1) - 0.5;
      fixed[3 * i + k] = scale[k] * moving[3 * i + k];
    }
  }
  orb_map_run run = {.ctx = ctx,
                     .params = orb_map_params_of(ORB_PRESET_DEFAULT),
                     .pairs = {.count = landmarks, .landmarks = landmarks, .moving = vertex, .fixed = vertex},
                     .x = moving};
  run.b.x = fixed;
  assert_int_equal(orb_map_is_part(&run, &part), ORB_OK);
  orb_context_destroy(ctx);
  return part;
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
  const struct CMUnitTest tests[] = {cmocka_unit_test(landmarks_of_another_scale_show_a_part),
                                     cmocka_unit_test(other_landmarks_show_no_part)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
