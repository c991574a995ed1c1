/* Memory that a context frees is used again, and costs no page faults a second time. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <sys/resource.h>

#include <cmocka.h>

#include "orbmorph/orbmorph.h"

#if !defined(__GLIBC__) || defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define OTHER_MALLOC 1
#elif defined(__has_feature)
#define OTHER_MALLOC (__has_feature(address_sanitizer) || __has_feature(thread_sanitizer))
#else
#define OTHER_MALLOC 0
#endif

enum { BLOCKS = 8, BLOCK = 1500000, PAGE = 4096 }; /* bytes; as the arrays of a level of 10,000 triangles */

static long faults(void) {
  struct rusage used;
  assert_int_equal(getrusage(RUSAGE_SELF, &used), 0);
  return used.ru_minflt;
}

/* One stage of a job: takes the blocks, writes every byte, frees them. */
static void stage(orb_context *ctx) {
  void *blocks[BLOCKS];
  for (int i = 0; i < BLOCKS; i++) {
    blocks[i] = orb_alloc(ctx, BLOCK, 1);
    assert_non_null(blocks[i]);
    memset(blocks[i], 1, BLOCK);
  }
  for (int i = 0; i < BLOCKS; i++) {
    orb_free(ctx, blocks[i]);
  }
}

static void freed_pages_serve_again(void **state) {
  orb_context *ctx;
  (void)state;
  if (OTHER_MALLOC) {
    skip();
  }
  orb_keep_heap();
  assert_int_equal(orb_context_create(&(orb_context_options){.threads = 1}, &ctx), ORB_OK);
  stage(ctx);
  const long before = faults();
  for (int i = 0; i < 10; i++) {
    stage(ctx);
  }
  const long each = (faults() - before) / 10, pages = (long)BLOCKS * BLOCK / PAGE;
  print_message("%ld page faults for %ld pages\n", each, pages);
  assert_true(each < pages / 20);
  orb_context_destroy(ctx);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(freed_pages_serve_again)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
