#include "worker/spans.h"

#include <stdio.h>
#include <string.h>

void spans_begin(job_spans *s, queue *q, const job *j) {
  *s = (job_spans){.kind = job_kind(j), .ready_us = 1000 * queue_ready_ms(q, j), .taken_us = trace_now_us()};
  memcpy(s->id, job_id(j), sizeof s->id);
  memcpy(s->request, job_trace(j), sizeof s->request);
}

void spans_queue(const job_spans *s) {
  char self[TRACE_PARENT];
  trace_begin_below(s->request, self);
  trace_end(&(trace_span){.self = self,
                          .parent = s->request,
                          .name = "queue",
                          .kind = TRACE_INTERNAL,
                          .start_us = s->ready_us,
                          .end_us = s->taken_us,
                          .attributes = {{"orbmorph.job", s->id, 0}}});
}

void spans_run(job_spans *s, queue *q, const job *j, job_progress *progress) {
  spans_queue(s);
  s->number = queue_attempt(q, j);
  trace_begin_below(s->request, s->attempt);
  memcpy(progress->trace, s->attempt, sizeof progress->trace);
}

void spans_end(const job_spans *s, const char *error) {
  char name[32];
  snprintf(name, sizeof name, "%s job", api_job_kind_name(s->kind));
  trace_end(&(trace_span){.self = s->attempt,
                          .parent = s->request,
                          .name = name,
                          .kind = TRACE_INTERNAL,
                          .start_us = s->taken_us,
                          .end_us = trace_now_us(),
                          .error = error,
                          .attributes = {{"orbmorph.job", s->id, 0}, {"orbmorph.attempt", NULL, s->number}}});
}
