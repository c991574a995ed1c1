/* Tasks that run side by side, where loops over data are too short to share. */
#ifndef ORB_BASE_TASKS_H
#define ORB_BASE_TASKS_H

#include "orbmorph/context.h"

/* Does task number `task` of `arg`, on a context of its own. */
typedef orb_status (*orb_task_fn)(orb_context *ctx, void *arg, int32_t task);

/* Runs tasks 0 to count − 1 side by side on the threads of ctx, which they share: with fewer threads than
 * tasks, some wait. Each gets a part of ctx (orb_context_part()), which ends with it; so what it leaves behind must not
 * point to that. On one thread the tasks run one after the other on ctx itself. Tasks share nothing that they write,
 * and their results do not depend on how many threads there are. Not within a parallel loop. Returns the status of the
 * first task that failed, with its error; later tasks may have run or not. */
ORB_MUST_CHECK orb_status orb_tasks_run(orb_context *ctx, int32_t count, orb_task_fn task, void *arg);

#endif
