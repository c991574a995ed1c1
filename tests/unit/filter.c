/* Selects the tests that a unit test program runs: ORB_TEST_ONLY is a pattern with * and ? of the tests to run,
 * ORB_TEST_SKIP one of the tests to skip. Every such program links this file, because under memcheck some tests take an
 * hour and the others a minute. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

__attribute__((constructor)) static void choose(void) {
  const char *only = getenv("ORB_TEST_ONLY"), *skip = getenv("ORB_TEST_SKIP");
  if (only != NULL)
    cmocka_set_test_filter(only);
  if (skip != NULL)
    cmocka_set_skip_filter(skip);
}
