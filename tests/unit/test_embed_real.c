/* Every real mesh, if the folder exists, embeds with a certificate and with an energy that is known to be possible. */
#include <dirent.h>
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
#include "orbmorph/format.h"
#include "support_shared.h"

enum { LARGEST_FILE = 1700000 }; /* bytes; larger files need ORB_TEST_ALL in the environment */

static const struct {
  const char *name;
  double mean; /* of the symmetric Dirichlet energy */
} known[] = {{"spot.obj", 1.403},
             {"human_man.obj", 4.00},
             {"sword.obj", 8.52},
             {"armadillo_86k.obj", 2.366},
             {"koala_100k.obj", 1.614}};

static void embed_file(const char *folder, const char *name, unsigned repair) {
  size_t size = 0;
  unsigned char *bytes = shared_bytes(folder, name, &size);
  if (!bytes) {
    fail_msg("cannot read %s/%s", folder, name);
  }
  if (size <= LARGEST_FILE || getenv("ORB_TEST_ALL")) {
    orb_context *ctx;
    assert_int_equal(orb_context_create(NULL, &ctx), ORB_OK);
    orb_mesh mesh;
    orb_embedding e;
    orb_status status = orb_mesh_read(ctx, bytes, size, ORB_FORMAT_AUTO, &mesh, NULL);
    if (status == ORB_OK) {
      status = orb_mesh_repair(ctx, &mesh, repair);
    }
    if (status == ORB_OK) {
      status = orb_embed(ctx, &mesh, NULL, &e);
    }
    if (status != ORB_OK) {
      fail_msg("%s: %s", name, orb_context_error(ctx)->detail);
    }
    assert_true(e.certificate.valid && e.certificate.exact);
    for (size_t i = 0; i < sizeof known / sizeof known[0]; i++) {
      if (strcmp(known[i].name, name) == 0) {
        print_message("%s: mean %.4f, known %.4f\n", name, e.distortion.symmetric_dirichlet.mean, known[i].mean);
        assert_true(e.distortion.symmetric_dirichlet.mean < 1.01 * known[i].mean);
      }
    }
    orb_embedding_free(ctx, &e);
    orb_mesh_free(ctx, &mesh);
    orb_context_destroy(ctx);
  }
  free(bytes);
}

static void embed_folder(const char *name, unsigned repair) {
  char folder[2048];
  snprintf(folder, sizeof folder, "%s/%s", ORB_SHARED_MESHES, name);
  DIR *list = opendir(folder);
  if (!list) {
    skip();
  }
  for (struct dirent *entry; (entry = readdir(list)) != NULL;) {
    if (entry->d_name[0] != '.') {
      embed_file(name, entry->d_name, repair);
    }
  }
  closedir(list);
}

static void test_good(void **unused) {
  (void)unused;
  embed_folder("good", ORB_REPAIR_SAFE);
}
static void test_weldable(void **unused) {
  (void)unused;
  embed_folder("weldable", ORB_REPAIR_LARGEST_COMPONENT);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_good), cmocka_unit_test(test_weldable)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
