/* Which tests of a unit's program run: ORB_TEST_ONLY names those that do, by a pattern with * and ?, ORB_TEST_SKIP
   those that do not. Linked into every such program; some of their tests take an hour under memcheck, the others a
   minute. */
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
