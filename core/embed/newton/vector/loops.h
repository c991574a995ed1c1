/* The choice of vector loops at run time. */
#ifndef ORB_EMBED_NEWTON_VECTOR_LOOPS_H
#define ORB_EMBED_NEWTON_VECTOR_LOOPS_H

#include "embed/newton/vector/jobs.h"

/* The version for what orb_context_cpu() returns. */
const orb_vector_loops *orb_vector_loops_of(orb_cpu cpu);

#endif
