/* Choosing, taking and claiming a job. */

#include "faults.h"
#include "queue/internal.h"

/* Whether job a goes before job b; b is the older one. */
static int goes_before(const queue *q, const job *a, const job *b) {
  int class_a = a->row.priority / QUEUE_URGENCIES, class_b = b->row.priority / QUEUE_URGENCIES;
  if (class_a != class_b) {
    return class_a > class_b;
  }
  if (a->owner != b->owner) {
    return q->owners[a->owner].service < q->owners[b->owner].service;
  }
  return a->row.priority > b->row.priority;
}

static int runnable(const queue *q, const job *j, int64_t now) {
  return j->committed && !j->taken && j->waits_for == 0 && j->retry_at <= now && !table_key_taken(q, j);
}

static int fetches(const job *j) {
  return j->row.kind == API_JOB_FETCH;
}

/* The next job for a worker, or NULL. */
static job *choose(queue *q, queue_lane lane) {
  int64_t now = orb_clock_ms();
  int most_large = q->options.workers > 1 ? q->options.workers - 1 : 1, small_only = lane == QUEUE_COMPUTES_SMALL;
  job *best = NULL;
  if (q->exclusive || (small_only && q->running_large < most_large)) {
    return NULL;
  }
  for (job *j = q->first; j; j = j->next) {
    if (!runnable(q, j, now)) {
      continue;
    }
    int mine = fetches(j) == (lane == QUEUE_FETCHES);
    if (j->row.suspect) {
      return q->running == 0 && mine ? j : NULL;
    }
    if (!mine || (fetches(j) && q->owners[j->owner].fetching >= QUEUE_FETCHES_OF_OWNER)) {
      continue;
    }
    int large = j->row.cost > LARGE;
    int64_t memory = (q->running_cost + j->row.cost) * BYTES_A_TRIANGLE;
    if ((large && (small_only || q->running_large >= most_large)) || (q->running && memory > q->options.memory)) {
      continue;
    }
    if (!best || goes_before(q, j, best)) {
      best = j;
    }
  }
  return best;
}

int queue_take(queue *q, queue_lane lane, job **out, int *threads) {
  pthread_mutex_lock(&q->lock);
  job *j = NULL;
  while (!q->stopping && !(j = choose(q, lane))) {
    pthread_cond_wait(&q->work, &q->lock);
  }
  if (j && !q->stopping) {
    int beside = 0;
    int64_t now = orb_clock_ms();
    for (job *other = q->first; other; other = other->next) {
      beside += other != j && !fetches(other) && runnable(q, other, now);
    }
    int wanted = q->running - q->fetching + 1 + beside;
    int share = wanted < q->options.workers ? wanted : q->options.workers;
    *threads = q->options.cores / share > 0 ? q->options.cores / share : 1;
    j->taken = 1;
    j->refs++;
    q->running++;
    q->running_large += j->row.cost > LARGE;
    q->running_cost += j->row.cost;
    q->exclusive = j->row.suspect;
    q->fetching += fetches(j);
    q->owners[j->owner].fetching += fetches(j);
    q->owners[j->owner].service += (double)j->row.cost + 1000;
    *out = j;
  } else {
    j = NULL;
  }
  pthread_mutex_unlock(&q->lock);
  return j != NULL;
}

void schedule_leave(queue *q, job *j) {
  q->running--;
  q->running_large -= j->row.cost > LARGE;
  q->running_cost -= j->row.cost;
  q->fetching -= fetches(j);
  q->owners[j->owner].fetching -= fetches(j);
  q->exclusive = 0;
  j->taken = 0;
  j->running = 0;
  j->ctx = NULL;
  pthread_cond_broadcast(&q->work);
}

store_result queue_claim(queue *q, job *j) {
  int64_t now = unix_ms();
  FAULT_POINT("before-claim");
  store_result result = catalogue_job_claim(q->cat, j->row.id, j->row.attempt + 1, j->row.suspect, now);
  FAULT_POINT("after-claim");
  pthread_mutex_lock(&q->lock);
  if (result == STORE_OK) {
    j->row.attempt++;
    j->row.state = API_JOB_RUNNING;
    j->row.started = j->row.started ? j->row.started : now;
    j->running = 1;
  }
  pthread_mutex_unlock(&q->lock);
  return result;
}

void queue_show_running(queue *q, job *j) {
  pthread_mutex_lock(&q->lock);
  j->row.state = API_JOB_RUNNING;
  j->row.started = j->row.started ? j->row.started : unix_ms();
  pthread_mutex_unlock(&q->lock);
}

void queue_set_context(queue *q, job *j, orb_context *ctx) {
  pthread_mutex_lock(&q->lock);
  j->ctx = ctx;
  if (ctx && j->cancel) {
    orb_context_cancel(ctx);
  }
  pthread_mutex_unlock(&q->lock);
}

int queue_cancel_wanted(queue *q, job *j) {
  pthread_mutex_lock(&q->lock);
  int wanted = j->cancel;
  pthread_mutex_unlock(&q->lock);
  return wanted;
}
