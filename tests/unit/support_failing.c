#include "support_failing.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

typedef struct failing {
  int left, failed;
  long blocks; /* not yet freed */
} failing;

static void *alloc_or_fail(void *user, size_t size) {
  failing *f = user;
  if (f->left-- == 0) {
    f->failed = 1;
    return NULL;
  }
  void *block = malloc(size);
  f->blocks += block != NULL;
  return block;
}

static void free_it(void *user, void *block) {
  failing *f = user;
  f->blocks -= block != NULL;
  free(block);
}

int failing_embeds(const orb_mesh *mesh, const orb_embed_options *options) {
  int failures = 0;
  for (int n = 1;; n++) { /* the allocation of the context comes before these */
    failing f = {.left = n};
    orb_context_options setup = {.threads = 1, .allocator = {.alloc = alloc_or_fail, .free = free_it, .user = &f}};
    orb_context *ctx;
    assert_int_equal(orb_context_create(&setup, &ctx), ORB_OK);
    long before = f.blocks;
    orb_embedding e;
    orb_status status = orb_embed(ctx, mesh, options, &e);
    if (status == ORB_OK) {
      assert_true(e.certificate.valid);
      orb_embedding_free(ctx, &e);
    } else {
      assert_int_equal(status, ORB_E_NO_MEMORY);
      assert_null(e.points);
      failures++;
    }
    assert_int_equal(f.blocks, before);
    orb_context_destroy(ctx);
    assert_int_equal(f.blocks, 0);
    if (!f.failed) {
      assert_int_equal(status, ORB_OK);
      return failures;
    }
  }
}
