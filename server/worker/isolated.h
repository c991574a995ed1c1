/* The daemon's side of a job in a process of its own: sends the inputs, stores the objects that come back. */
#ifndef ORB_WORKER_ISOLATED_H
#define ORB_WORKER_ISOLATED_H

#include "worker/run.h"

typedef struct isolated_limits {
  int64_t memory, deadline_ms, max_triangles;
  int threads, nice;
} isolated_limits;

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
