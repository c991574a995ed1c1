/* pin and rbf on the real pairs, where their folder is there. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "orbmorph/embed.h"
#include "support_align.h"
#include "support_shared.h"

enum { LANDMARKS_MAX = 64, NAME_MAX_LENGTH = 128 };

static const char *const PAIRS[] = {"armadillo_29k-armadillo_86k", "bumpy_cube-round_cube", "cow-spot",
                                    "human_man-armadillo_29k",     "human_man-human_woman", "human_man-penguin",
                                    "koala_lr-koala_100k",         "shrec381-shrec388",     "shrec397-shrec393",
                                    "shrec397-shrec398",           "spot-koala_lr",         "spot-shrec381"};

static void load(orb_context *ctx, const char *name, orb_mesh *mesh, orb_embedding *embedding) {
  assert_true(shared_mesh(ctx, name, mesh));
  orb_embed_options options;
  orb_embed_defaults(&options);
  assert_int_equal(orb_embed(ctx, mesh, &options, embedding), ORB_OK);
}

typedef struct pair {
  char names[2][NAME_MAX_LENGTH];
  int32_t count, vertices[LANDMARKS_MAX][2];
} pair;

/* What this test needs of a pair file: "meshes": ["a", "b"] and "landmarks": [[i, j], …]. */
static void read_pair(char *text, pair *out) {
  memset(out, 0, sizeof *out);
  char *at = strstr(text, "\"meshes\"");
  assert_non_null(at);
  assert_int_equal(sscanf(strchr(at, '['), "[\"%127[^\"]\", \"%127[^\"]\"", out->names[0], out->names[1]), 2);
  at = strstr(text, "\"landmarks\"");
  assert_non_null(at);
  at = strchr(at, '[') + 1;
  int a, b;
  while (out->count < LANDMARKS_MAX && sscanf(at, " [%d, %d]", &a, &b) == 2) {
    out->vertices[out->count][0] = a;
    out->vertices[out->count++][1] = b;
    at = strchr(at, ']') + 1;
    at += *at == ',';
  }
  assert_true(out->count > 0);
}

static int run_pair(orb_context *ctx, const char *name) {
  char file[NAME_MAX_LENGTH];
  size_t size;
  snprintf(file, sizeof file, "%s.json", name);
  char *text = (char *)shared_bytes("pairs", file, &size);
  if (!text) {
    return 0;
  }
  pair p;
  read_pair(text, &p);
  free(text);
  orb_mesh meshes[2];
  orb_embedding embeddings[2];
  orb_place at[LANDMARKS_MAX][2];
  orb_landmark landmarks[LANDMARKS_MAX];
  orb_align_shape shapes[2];
  memset(landmarks, 0, sizeof landmarks);
  for (int s = 0; s < 2; s++) {
    load(ctx, p.names[s], &meshes[s], &embeddings[s]);
    shapes[s] = (orb_align_shape){&meshes[s], embeddings[s].points};
    for (int32_t k = 0; k < p.count; k++) {
      int32_t v = meshes[s].vertex_of_source[p.vertices[k][s]];
      assert_int_equal(orb_place_of_vertex(ctx, &meshes[s], v, &at[k][s]), ORB_OK);
      landmarks[k].at = at[k];
    }
  }
  for (int m = 0; m < 2; m++) {
    orb_align_options options;
    orb_align_defaults(&options);
    options.method = m ? ORB_ALIGN_RBF : ORB_ALIGN_PIN;
    options.preset = ORB_PRESET_FAST;
    orb_alignment out;
    align_and_check(ctx, shapes, 2, landmarks, p.count, &options, &out);
    orb_alignment_free(ctx, &out);
  }
  for (int s = 0; s < 2; s++) {
    orb_mesh_free(ctx, &meshes[s]);
    orb_embedding_free(ctx, &embeddings[s]);
  }
  return 1;
}

static void real_pairs_meet(void **state) {
  (void)state;
  orb_context *ctx;
  assert_int_equal(orb_context_create(NULL, &ctx), ORB_OK);
  int found = 0;
  for (size_t i = 0; i < sizeof PAIRS / sizeof *PAIRS; i++) {
    found += run_pair(ctx, PAIRS[i]);
  }
  orb_context_destroy(ctx);
  if (found == 0) {
    print_message("The folder of real meshes is not there.\n");
    skip();
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(real_pairs_meet)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
