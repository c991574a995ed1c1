/* Numbers of jobs. */
#include <string.h>

#include "queue/internal.h"
#include "queue/shared.h"

static void count_stage(queue_numbers *out, const char *stage) {
  enum { MOST = sizeof out->stages / sizeof out->stages[0] };
  int i = 0;
  while (i < MOST - 1 && out->stages[i].jobs > 0 && strcmp(out->stages[i].name, stage) != 0) {
    i++;
  }
  copy_text(out->stages[i].name, sizeof out->stages[i].name, stage);
  out->stages[i].jobs++;
}

void queue_count(queue *q, queue_numbers *out) {
  memset(out, 0, sizeof *out);
  pthread_mutex_lock(&q->lock);
  int64_t now = unix_ms();
  for (job *j = q->first; j; j = j->next) {
    int runs = j->running || (j->taken && j->row.kind == API_JOB_FETCH); /* a download comes before the claim */
    int queued = !runs && j->waits_for == 0;
    out->queued += queued;
    if (runs) {
      count_stage(out, j->stage[0] ? j->stage : "start");
    }
    out->waiting += j->waits_for > 0;
    if (queued && now - j->row.created > out->oldest_ms) {
      out->oldest_ms = now - j->row.created;
    }
  }
  out->running = q->running;
  out->waiters = q->waiter_count;
  memcpy(out->ended, q->ended, sizeof out->ended);
  if (q->shared) {
    shared_count(q, now, out);
  }
  pthread_mutex_unlock(&q->lock);
}

void queue_count_of(queue *q, const char *owner, int *running, int *queued) {
  *running = *queued = 0;
  if (q->shared) {
    int64_t there[2] = {0, 0};
    catalogue_shared_of(q->cat, owner, &there[0], &there[1]);
    *running = (int)there[0];
    *queued = (int)there[1];
    return;
  }
  pthread_mutex_lock(&q->lock);
  for (int i = 0; i < q->owner_count; i++) {
    if (strcmp(q->owners[i].name, owner) == 0) {
      *running = q->owners[i].running + q->owners[i].fetching;
      *queued = q->owners[i].unfinished - *running;
    }
  }
  pthread_mutex_unlock(&q->lock);
}
