/* Taking a job for a worker. */
#include "queue/internal.h"
#include "queue/shared.h"

int queue_take(queue *q, queue_lane lane, job **out, int *threads) {
  if (q->shared) {
    return shared_take(q, lane, out, threads);
  }
  pthread_cond_t *const works[] = {
      [QUEUE_COMPUTES] = &q->work, [QUEUE_GUESTS] = &q->guest_work, [QUEUE_FETCHES] = &q->fetch_work};
  pthread_mutex_lock(&q->lock);
  job *j = NULL;
  while (!q->stopping && !((j = schedule_choose(q, lane)) && schedule_take_memory(q, lane, j))) {
    pthread_cond_wait(works[lane], &q->lock);
  }
  if (j && !q->stopping) {
    int64_t now = orb_clock_ms();
    int beside = schedule_beside(q, j, now);
    schedule_enter(q, lane, j, now);
    *threads = schedule_threads(q, j, beside);
    *out = j;
    if (q->unfinished > q->running) {
      wake_workers(q);
    }
  } else {
    j = NULL;
  }
  pthread_mutex_unlock(&q->lock);
  return j != NULL;
}
