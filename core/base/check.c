#include "base/check.h"

#include <stdio.h>
#include <stdlib.h>

_Noreturn void orb_assert_failed(const char *expression, const char *file, int line) {
  fprintf(stderr, "orbmorph: broken invariant: %s (%s:%d)\n", expression, file, line);
  abort();
}
