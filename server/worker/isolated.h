/* The daemon's side of a job in a process of its own: sends the inputs, stores the objects that come back. */
#ifndef ORB_WORKER_ISOLATED_H
#define ORB_WORKER_ISOLATED_H

#include "worker/run.h"

typedef struct isolated_limits {
  int64_t memory, deadline_ms, max_triangles;
  int threads, nice;
  int64_t hold_ms; /* see ISOLATED_HOLD_MS */
} isolated_limits;

/* A process sends what it has made at its end, at once. From its first object on the daemon holds the store, which
 * keeps deletions waiting and, behind them, all who publish. So the next frame must follow within this time: hashing
 * the largest result takes seconds on a busy machine. A process that is late is killed, and counts as one that died. */
enum { ISOLATED_HOLD_MS = 30000 };

/* How a process ended that brought neither a result nor a problem. */
typedef struct isolated_end {
  int died;
  int status;    /* as of waitpid(); −1: unknown */
  char why[100]; /* "was killed by signal 11 (Segmentation fault)" */
} isolated_end;

/* Like run_embedding() and run_supermesh(). Cancelling the context, or its deadline, kills the process. */
int isolated_run(const run_env *env, orb_context *ctx, api_job_kind kind, const run_job *j,
                 const isolated_limits *limits, run_output *out, api_problem *problem, isolated_end *end);

#endif
