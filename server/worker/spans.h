/* The spans of a job that a worker has taken: how long it was in the queue, and the attempt, with its stages below it.
 */
#ifndef ORB_WORKER_SPANS_H
#define ORB_WORKER_SPANS_H

#include "worker/progress.h"

typedef struct job_spans {
  char id[API_JOB_ID_SIZE], request[TRACE_PARENT]; /* of the job: others may free it before the end is recorded */
  char attempt[TRACE_PARENT];
  api_job_kind kind;
  int64_t ready_us, taken_us;
  int number; /* of the attempt */
} job_spans;

/* When the worker has taken the job. */
void spans_begin(job_spans *s, queue *q, const job *j);
/* It waits for other jobs now: only its time in the queue. */
void spans_queue(const job_spans *s);
/* Once it is sure that the job runs: its spans, and those of its stages (progress->trace). */
void spans_run(job_spans *s, queue *q, const job *j, job_progress *progress);
/* When the run has ended. error: what went wrong; NULL: nothing. */
void spans_end(const job_spans *s, const char *error);

#endif
