/* Guided walks: if a shape folds when it is put at the targets of its match, samples of the targets lead to a map. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>

#include <cmocka.h>

#include "align/find/contest.h"
#include "align/find/match.h"
#include "align/map/engine/params.h"
#include "align/methods.h"
#include "align/sheet/even.h"
#include "orbmorph/align.h"
#include "orbmorph/embed.h"
#include "orbmorph/format.h"
#include "support_align.h"

static orb_mesh read_sample(orb_context *ctx, const char *name) {
  static unsigned char bytes[1 << 20];
  char path[512];
  orb_mesh mesh;
  snprintf(path, sizeof path, ORB_SOURCES "/tests/samples/%s", name);
  FILE *file = fopen(path, "rb");
  assert_non_null(file);
  size_t size = fread(bytes, 1, sizeof bytes, file);
  fclose(file);
  assert_in_range(size, 1, sizeof bytes - 1);
  assert_int_equal(orb_mesh_read(ctx, bytes, size, ORB_FORMAT_AUTO, &mesh, NULL), ORB_OK);
  return mesh;
}

/* The neck of a giraffe is four times as long as that of a dog, so its targets fold, and no start from them leads to a
 * map. A walk does, of one shape or the other: its energy is that of shapes that correspond. One walk alone is not sure
 * to: of eight of the giraffe's towards meshes that differ in the tenth digit, seven come to 1.34 to 1.73, one to 1.81.
 */
static void dog_to_giraffe(void **state) {
  (void)state;
  orb_context *ctx;
  orb_match match;
  orb_contest_result won;
  orb_alignment alignment;
  orb_mesh mesh[2];
  orb_embedding embedding[2];
  orb_align_shape shapes[2];
  orb_even_shapes even;
  orb_embed_options embed;
  orb_align_options options;
  assert_int_equal(orb_context_create(NULL, &ctx), ORB_OK);
  orb_embed_defaults(&embed);
  for (int s = 0; s < 2; s++) {
    mesh[s] = read_sample(ctx, s ? "giraffe.off" : "dog.obj");
    assert_int_equal(orb_embed(ctx, &mesh[s], &embed, &embedding[s]), ORB_OK);
    shapes[s] = (orb_align_shape){&mesh[s], embedding[s].points};
  }
  orb_align_defaults(&options);
  options.method = ORB_ALIGN_AUTO;
  options.preset = ORB_PRESET_FAST; /* rotations only */
  assert_int_equal(orb_even_shapes_create(ctx, shapes, 2, &even), ORB_OK);
  assert_int_equal(orb_align(ctx, even.shapes, 2, NULL, 0, &options, &alignment), ORB_OK);
  orb_even_shapes_free(ctx, &even);
  assert_int_equal(orb_match_find(ctx, &mesh[0], &mesh[1], NULL, 1, &match), ORB_OK);
  assert_int_equal(orb_contest_run(ctx, &match, ORB_PRESET_DEFAULT, &alignment, &won), ORB_OK);
  assert_false(won.is_space);
  assert_true(alignment.energy <= orb_map_params_of(ORB_PRESET_DEFAULT).energy.poor);
  check_alignment(&alignment, 0);
  orb_alignment_free(ctx, &alignment);
  orb_match_free(ctx, &match);
  for (int s = 0; s < 2; s++) {
    orb_embedding_free(ctx, &embedding[s]);
    orb_mesh_free(ctx, &mesh[s]);
  }
  orb_context_destroy(ctx);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(dog_to_giraffe)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
