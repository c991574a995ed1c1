/* The choice of the loop at run time. */
#ifndef ORB_ALIGN_MAP_ENGINE_VECTOR_LOOPS_H
#define ORB_ALIGN_MAP_ENGINE_VECTOR_LOOPS_H

#include "align/map/engine/vector/jobs.h"

/* The version for what orb_context_cpu() returns. */
const orb_map_loops *orb_map_loops_of(orb_cpu cpu);

#endif
