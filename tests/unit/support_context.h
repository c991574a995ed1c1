/* One context for all tests of a file: cmocka_run_group_tests(tests, context_one_thread, context_end). */
#ifndef SUPPORT_CONTEXT_H
#define SUPPORT_CONTEXT_H

#include "orbmorph/context.h"

extern orb_context *ctx;

int context_one_thread(void **unused);
int context_two_threads(void **unused);
int context_end(void **unused); /* asserts that nothing leaked */

#endif
