/* Limits of a context that only core reads.
 *
 * core/base: state.h (the struct of a context), context.c (its life, cancelling, progress), error.c, memory.c,
 * buffer.c, parallel.c (threads), loops.h (loops that check for cancellation), check.h (invariants), grow.h, status.c.
 */
#ifndef ORB_BASE_CONTEXT_H
#define ORB_BASE_CONTEXT_H

#include "orbmorph/context.h"

int64_t orb_context_max_triangles(const orb_context *ctx);

#endif
