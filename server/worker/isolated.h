/* The daemon's side of a job in a process of its own: sends the inputs, stores the objects that come back. */
#ifndef ORB_WORKER_ISOLATED_H
#define ORB_WORKER_ISOLATED_H

#include "worker/run.h"

typedef struct isolated_limits {
  int64_t memory, deadline_ms, max_triangles;
  int threads, nice;
  int64_t hold_ms; /* see ISOLATED_HOLD_MS */
} isolated_limits;

/* A process sends all its results at its end. From the first object on, the daemon holds the store, so deletions wait,
 * and publishers wait behind them. It therefore waits for all further frames together no longer than this: hashing the
 * largest result takes seconds on a busy machine. The daemon kills a process that is late: it broke the protocol. */
enum { ISOLATED_HOLD_MS = 30000 };

/* How a process ended that sent neither a result nor a problem. */
typedef struct isolated_end {
  int died;
  int broke;     /* the daemon ended it because it broke the protocol: no other job can be the cause */
  int status;    /* as of isolate_close() */
  char why[100]; /* "was killed by signal 11 (Segmentation fault)" */
} isolated_end;

/* Like run_embedding() and run_supermesh(). Cancelling the context, or its deadline, kills the process. */
int isolated_run(const run_env *env, orb_context *ctx, api_job_kind kind, const run_job *j,
                 const isolated_limits *limits, run_output *out, api_problem *problem, isolated_end *end);

#endif
