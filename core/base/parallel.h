/* The threads of a context; orb_parallel_for() is declared in orbmorph/context.h. */
#ifndef ORB_BASE_PARALLEL_H
#define ORB_BASE_PARALLEL_H

#include "orbmorph/context.h"

/* Joins the threads and frees the pool. Does nothing where no parallel loop has run. */
void orb_pool_stop(orb_context *ctx);

#endif
