/* Tasks that run side by side: halves of a step that do not need each other, or whole maps. Loops over data that are
 * too short to share pay so as well. */
#ifndef ORB_BASE_TASKS_H
#define ORB_BASE_TASKS_H

#include "orbmorph/context.h"

/* Does task number `task` of `arg`, on a context of its own. */
typedef orb_status (*orb_task_fn)(orb_context *ctx, void *arg, int32_t task);

/* Runs tasks 0 to count − 1 side by side on the threads of ctx, which they share: with fewer threads than
 * tasks, some wait, and threads without a task help with the loops of those that run. Each gets a part of ctx
 * (orb_context_part()), which ends with it; so what it leaves behind must not point to that. A single task runs on ctx
 * itself, and so do all, one after the other, where only one thread takes part in the loops of ctx. Tasks share nothing
 * that they write, and their results do not depend on how many threads there are. Not within a parallel loop. Returns
 * the status of the first task that failed, with its error; later tasks may have run or not. */
ORB_MUST_CHECK orb_status orb_tasks_run(orb_context *ctx, int32_t count, orb_task_fn task, void *arg);

#endif
