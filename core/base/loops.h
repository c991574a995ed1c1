/* Parallel loops that check for cancellation. */
#ifndef ORB_BASE_LOOPS_H
#define ORB_BASE_LOOPS_H

#include <stdatomic.h>

#include "base/parallel.h"
#include "orbmorph/context.h"

/* orb_parallel_for() in slices of 65,536 iterations, rounded up to a multiple of grain, with orb_context_check() before
 * each. Chunks begin at multiples of grain. */
ORB_MUST_CHECK orb_status orb_sliced_for(orb_context *ctx, int64_t count, int64_t grain, orb_loop_fn body, void *arg);

/* The same with slices of `slice` iterations, rounded up alike, for bodies that take long. */
ORB_MUST_CHECK orb_status orb_sliced_by(orb_context *ctx, int64_t count, int64_t slice, int64_t grain, orb_loop_fn body,
                                        void *arg);

#endif
