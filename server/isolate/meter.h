/* What Draco takes from C++'s operator new, counted in the budget of a job while it runs. The daemon replaces operator
 * new for this. With sanitizers, which bring one of their own, nothing is counted. */
#ifndef ORB_ISOLATE_METER_H
#define ORB_ISOLATE_METER_H

#include "orbmorph/context.h"

#ifdef __cplusplus
extern "C" {
#endif

/* For the options of a context: see orb_meter_fn. Threads count apart. */
void meter_set(orb_context *ctx, size_t counted);

#ifdef __cplusplus
}
#endif

#endif
