/* What core asks a context beyond the public header. */
#ifndef ORB_BASE_CONTEXT_H
#define ORB_BASE_CONTEXT_H

#include "orbmorph/context.h"

int64_t orb_context_max_triangles(const orb_context *ctx);

#endif
