/* Limits of a context that only core reads.
 *
 * core/base: state.h (the struct of a context), context.c (its life, cancelling, progress), error.c, memory.c,
 * buffer.c, parallel.c (threads), tasks.h (work side by side), loops.h (loops that check for cancellation), check.h
 * (invariants), grow.h, hash.c, clock.c, printf.h (checks of formats), status.c, version.c.
 */
#ifndef ORB_BASE_CONTEXT_H
#define ORB_BASE_CONTEXT_H

#include "orbmorph/context.h"

int64_t orb_context_max_triangles(const orb_context *ctx);

/* A part of a context for a task that runs beside others (tasks.h): it has an error record and a pool of its own, which
 * other threads may enter (parallel.h), and the budget, cancel flag, deadline and progress of ctx. What is allocated
 * from the one may be freed from the other. Destroy it before ctx. orb_threads() of it is that of ctx. */
ORB_MUST_CHECK orb_status orb_context_part(orb_context *ctx, orb_context **out);

/* A library that allocates by C++'s operator new is about to run on this thread, or still runs, and the budget has
 * `counted` bytes of what it takes; or it has ended. See orb_meter_fn. */
void orb_library_runs(orb_context *ctx, size_t counted);
void orb_library_ends(orb_context *ctx);

/* Reports progress. Any thread; reports that collide with another are dropped. */
void orb_progress(orb_context *ctx, const char *stage, double fraction);

/* For a stage whose steps are of many kinds and not known beforehand: from now on orb_progress_steps() reports the
 * stage of orb_progress_only(), which must be set, by the steps that are made out of so many. 0 ends that; such stages
 * do not nest. Not within a parallel loop. */
void orb_progress_expect(orb_context *ctx, double steps);
/* Counts steps, and reports every thousandth of the stage. Any thread; a few thousand times a second. The fraction
 * grows with the steps up to 0.8 and then ever more slowly, so it does not get beyond 1 however many there are. */
void orb_progress_steps(orb_context *ctx, int64_t steps);

/* From now on reports only this stage (NULL: any), for a stage that calls functions with stages of their own. The text
 * is not copied and must last until it is replaced. Returns the previous value, which the caller restores at the end.
 * Not within a parallel loop. */
const char *orb_progress_only(orb_context *ctx, const char *stage);

#endif
