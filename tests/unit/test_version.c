/* The build, the headers and the library have the same version. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include <cmocka.h>

#include "orbmorph/version.h"

static void test_version(void **state) {
  char text[32];
  (void)state;
  snprintf(text, sizeof text, "%d.%d.%d", ORB_VERSION_MAJOR, ORB_VERSION_MINOR, ORB_VERSION_PATCH);
  assert_string_equal(text, ORB_PROJECT_VERSION); /* CMakeLists.txt */
  assert_string_equal(orb_version(), text);
  assert_int_equal(ORB_VERSION, ORB_VERSION_MAJOR * 10000 + ORB_VERSION_MINOR * 100 + ORB_VERSION_PATCH);
#if !(ORB_VERSION >= 10000)
  fail(); /* the preprocessor can compare it */
#endif
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_version)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
