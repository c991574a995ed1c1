/* Memory that a context frees is used again, and costs no page faults a second time. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/memory.h"
#include "orbmorph/orbmorph.h"

#if !defined(__GLIBC__) || defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define OTHER_MALLOC 1
#elif defined(__has_feature)
#define OTHER_MALLOC (__has_feature(address_sanitizer) || __has_feature(thread_sanitizer))
#else
#define OTHER_MALLOC 0
#endif

enum { BLOCKS = 8, BLOCK = 1500000 }; /* bytes; as the arrays of a level of 10,000 triangles */

/* Blocks of 2 MiB and more are mapped. */
enum { SMALL = 1 << 20, LARGE = 1 << 22 };

static int is_all(const unsigned char *bytes, size_t count, unsigned char value) {
  size_t same = 0;
  while (same < count && bytes[same] == value) {
    same++;
  }
  return same == count;
}

static void a_block_keeps_its_bytes_as_it_grows_and_shrinks(void **state) {
  orb_context *ctx;
  (void)state;
  assert_int_equal(orb_context_create(&(orb_context_options){.threads = 1, .memory_limit = 4 * LARGE}, &ctx), ORB_OK);
  static const size_t sizes[] = {SMALL, LARGE, 2 * LARGE, LARGE, SMALL};
  unsigned char *block = orb_alloc(ctx, SMALL, 1);
  assert_non_null(block);
  memset(block, 7, SMALL);
  for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
    block = orb_realloc(ctx, block, sizes[i], 1);
    assert_non_null(block);
    assert_true(is_all(block, SMALL, 7));
    assert_in_range(orb_memory_used(ctx), sizes[i], sizes[i] + (1 << 17));
  }
  orb_free(ctx, block);
  assert_int_equal(orb_memory_used(ctx), 0);
  orb_context_destroy(ctx);
}

/* Memory that a program holds besides leaves less for blocks, until it is discharged. */
static void what_is_charged_counts(void **state) {
  orb_context *ctx;
  (void)state;
  assert_int_equal(orb_context_create(&(orb_context_options){.threads = 1, .memory_limit = 2 * LARGE}, &ctx), ORB_OK);
  assert_int_equal(orb_memory_charge(ctx, LARGE), ORB_OK);
  assert_int_equal(orb_memory_used(ctx), LARGE);
  assert_int_equal(orb_memory_charge(ctx, LARGE + 1), ORB_E_NO_MEMORY);
  assert_int_equal(orb_context_error(ctx)->status, ORB_E_NO_MEMORY);
  assert_null(orb_alloc(ctx, LARGE, 1));
  orb_memory_discharge(ctx, LARGE);
  assert_int_equal(orb_memory_used(ctx), 0);
  void *block = orb_alloc(ctx, LARGE, 1);
  assert_non_null(block);
  orb_free(ctx, block);
  orb_context_destroy(ctx);
}

/* malloc() hands out what was freed, whatever is in it. */
static void a_zeroed_block_is_zero(void **state) {
  orb_context *ctx;
  (void)state;
  assert_int_equal(orb_context_create(&(orb_context_options){.threads = 1}, &ctx), ORB_OK);
  static const size_t sizes[] = {1 << 10, SMALL, LARGE};
  for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
    unsigned char *block = orb_alloc(ctx, sizes[i], 1);
    assert_non_null(block);
    memset(block, 7, sizes[i]);
    orb_free(ctx, block);
    block = orb_calloc(ctx, sizes[i], 1);
    assert_non_null(block);
    assert_true(is_all(block, sizes[i], 0));
    orb_free(ctx, block);
  }
  orb_context_destroy(ctx);
}

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
  (void)prctl(PR_SET_THP_DISABLE, 1, 0, 0, 0); /* each page counts */
  orb_keep_heap();
  assert_int_equal(orb_context_create(&(orb_context_options){.threads = 1}, &ctx), ORB_OK);
  stage(ctx);
  const long before = faults();
  for (int i = 0; i < 10; i++) {
    stage(ctx);
  }
  const long each = (faults() - before) / 10, pages = (long)BLOCKS * BLOCK / sysconf(_SC_PAGESIZE);
  print_message("%ld page faults for %ld pages\n", each, pages);
  assert_true(each < pages / 20);
  orb_context_destroy(ctx);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(a_block_keeps_its_bytes_as_it_grows_and_shrinks),
                                     cmocka_unit_test(what_is_charged_counts), cmocka_unit_test(a_zeroed_block_is_zero),
                                     cmocka_unit_test(freed_pages_serve_again)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
