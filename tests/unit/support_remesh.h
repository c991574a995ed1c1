/* What the tests of all remesh methods have in common. */
#ifndef ORB_TESTS_SUPPORT_REMESH_H
#define ORB_TESTS_SUPPORT_REMESH_H

#include "support_sphere.h"

orb_context *remesh_context(int threads);
/* Of one thread; allocations fail once *left of them have been made. */
orb_context *remesh_failing_context(int64_t *left);

/* Remeshes with the method's defaults; says why where it fails for another reason than memory. */
orb_status remesh_by(orb_context *ctx, orb_remesh_method method, const orb_aligned_shape *shapes, int count,
                     orb_supermesh *out);

/* Fails the test unless one thread and four give the same bytes. */
void remesh_assert_threads_do_not_matter(orb_remesh_method method);

/* Lets every allocation fail once: each time the call must say so, and leave nothing behind (the context asserts it).
 */
void remesh_assert_fails_cleanly(orb_remesh_method method);

#endif
