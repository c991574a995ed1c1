/* A supermesh job waits for the jobs of its embeddings. */
#include <string.h>

#include "queue/internal.h"
#include "queue/shared.h"

queue_result queue_wait_for(queue *q, job *j, char (*keys)[API_ID_SIZE], const char *const *requests,
                            const int64_t *costs, int count) {
  queue_result result = QUEUE_OK;
  if (q->shared) {
    return shared_wait_for(q, j, keys, requests, costs, count);
  }
  pthread_mutex_lock(&q->lock);
  memcpy(j->dependencies, keys, (size_t)count * sizeof *keys);
  j->dependency_count = count;
  j->waits_for = 1; /* keeps it from running before all of them are submitted */
  pthread_mutex_unlock(&q->lock);
  for (int i = 0; i < count && result == QUEUE_OK; i++) {
    job *needed = NULL;
    queue_request request = {.kind = API_JOB_EMBEDDING,
                             .key = keys[i],
                             .request = requests[i],
                             .owner = j->row.owner,
                             .charged = j->row.charged,
                             .cost = costs[i],
                             .priority = j->row.priority,
                             .trace = j->row.trace};
    result = queue_submit(q, &request, &needed, NULL);
    queue_release(q, needed);
  }
  pthread_mutex_lock(&q->lock);
  j->waits_for = 0;
  for (int i = 0; i < count && result == QUEUE_OK; i++) {
    for (job *other = q->first; other; other = other->next) {
      j->waits_for += is_for(other, keys[i], j->row.owner);
    }
  }
  if (result != QUEUE_OK) {
    j->retry_at = orb_clock_ms() + RETRY_SOON_MS;
  }
  if (j->cancel) { /* cancelled in the meantime */
    j->waits_for = 0;
    pthread_mutex_unlock(&q->lock);
    queue_finish(q, j, API_JOB_CANCELLED, NULL);
    return QUEUE_OK;
  }
  schedule_leave(q, j);
  job_unref(j);
  pthread_mutex_unlock(&q->lock);
  return result;
}

char *queue_dependency_problem(queue *q, job *j) {
  pthread_mutex_lock(&q->lock);
  char *problem = j->dependency_problem;
  j->dependency_problem = NULL;
  pthread_mutex_unlock(&q->lock);
  return problem;
}

void queue_add_embed_ms(queue *q, job *j, double ms) {
  pthread_mutex_lock(&q->lock);
  for (job *other = q->first; other; other = other->next) {
    for (int d = 0; other->waits_for && d < other->dependency_count; d++) {
      if (is_for(j, other->dependencies[d], other->row.owner)) {
        other->embed_ms += ms;
      }
    }
  }
  pthread_mutex_unlock(&q->lock);
}

double queue_embed_ms(queue *q, job *j) {
  pthread_mutex_lock(&q->lock);
  double ms = j->embed_ms;
  pthread_mutex_unlock(&q->lock);
  return ms;
}
