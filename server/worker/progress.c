#include "worker/progress.h"

#include <stdio.h>
#include <string.h>

#include "metrics.h"

static void record_stage(const job_progress *progress) {
  char self[TRACE_PARENT];
  trace_begin_below(progress->trace, self);
  trace_end(&(trace_span){.self = self,
                          .parent = progress->trace,
                          .name = progress->stage,
                          .kind = TRACE_INTERNAL,
                          .start_us = progress->began_us,
                          .end_us = trace_now_us()});
}

void progress_enter(job_progress *progress, const char *stage) {
  if (strncmp(progress->stage, stage, sizeof progress->stage - 1) == 0) {
    return;
  }
  double now = orb_clock();
  if (progress->stage[0]) {
    metrics_stage((int)job_kind(progress->j), progress->stage, now - progress->began);
    record_stage(progress);
  }
  snprintf(progress->stage, sizeof progress->stage, "%s", stage);
  progress->began = now;
  progress->began_us = trace_now_us();
}

void progress_report(void *user, const char *stage, double fraction) {
  job_progress *progress = user;
  if (progress->show) {
    progress->show(progress->user, stage, fraction);
    return;
  }
  progress_enter(progress, stage);
  queue_progress(progress->q, progress->j, stage, fraction);
}
