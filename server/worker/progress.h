/* Progress of one job: what the queue shows and how long each stage takes. */
#ifndef ORB_WORKER_PROGRESS_H
#define ORB_WORKER_PROGRESS_H

#include "queue/queue.h"
#include "trace/trace.h"

typedef struct job_progress {
  queue *q; /* NULL: show() */
  job *j;
  void (*show)(void *user, const char *stage, double fraction);
  void *user;
  char stage[24];
  double began;
  char trace[TRACE_PARENT]; /* the span of the attempt at the job; "": none */
  int64_t began_us;         /* of the stage, Unix time */
} job_progress;

/* Ends the time measurement of the current stage and begins the next; "": none. */
void progress_enter(job_progress *progress, const char *stage);

/* Enters the stage and shows the fraction of it that is done. Core reports its stages through this orb_progress_fn
 * (user: the job_progress); the worker reports reading and storing, during which core does not run. */
void progress_report(void *user, const char *stage, double fraction);

#endif
