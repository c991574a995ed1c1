/* Helpers for the tests of all remesh methods. */
#ifndef ORB_TESTS_SUPPORT_REMESH_H
#define ORB_TESTS_SUPPORT_REMESH_H

#include "support_sphere.h"

orb_context *remesh_context(int threads);
/* Creates a context with one thread whose allocations fail after the next *left ones. */
orb_context *remesh_failing_context(int64_t *left);

/* Remeshes with the method's defaults. Prints the reason of a failure, unless it is lack of memory. */
orb_status remesh_by(orb_context *ctx, orb_remesh_method method, const orb_aligned_shape *shapes, int count,
                     orb_supermesh *out);

/* Fails the test unless one thread and four threads give the same bytes. */
void remesh_assert_threads_do_not_matter(orb_remesh_method method);

/* Makes every allocation fail once. Each time the call must report it and leak nothing (the context asserts this). */
void remesh_assert_fails_cleanly(orb_remesh_method method);

#endif
