/* Choosing and claiming a job. */
#include <stdlib.h>

#include "faults.h"
#include "queue/internal.h"
#include "queue/shared.h"

/* Whether job a goes before job b; b is the older one. share: the workers that an owner may have while others wait. */
static int goes_before(const queue *q, const job *a, const job *b, int share) {
  int class_a = a->row.priority / QUEUE_URGENCIES, class_b = b->row.priority / QUEUE_URGENCIES;
  if (class_a != class_b) {
    return class_a > class_b;
  }
  if (a->owner != b->owner) {
    int over_a = q->owners[a->owner].running >= share, over_b = q->owners[b->owner].running >= share;
    return over_a != over_b ? over_b : q->owners[a->owner].service < q->owners[b->owner].service;
  }
  return a->row.priority > b->row.priority;
}

static int runnable(const queue *q, const job *j, int64_t now) {
  return j->committed && !j->taken && j->waits_for == 0 && j->retry_at <= now && !table_key_taken(q, j);
}

/* The workers that each owner may have while others wait: an equal part, rounded up. */
static int share_of_owner(queue *q, int64_t now) {
  int active = 0;
  for (int i = 0; i < q->owner_count; i++) {
    q->owners[i].runnable = 0;
  }
  for (const job *j = q->first; j; j = j->next) {
    q->owners[j->owner].runnable |= !fetches(j) && runnable(q, j, now);
  }
  for (int i = 0; i < q->owner_count; i++) {
    active += q->owners[i].runnable || q->owners[i].running > 0;
  }
  return active > 1 ? (q->options.workers + active - 1) / active : q->options.workers;
}

static budget_part part_of(queue_lane lane) {
  return lane == QUEUE_GUESTS ? BUDGET_SMALL : BUDGET_JOBS;
}

/* The bytes that a job needs in this lane; 0: memory does not count. */
static int64_t memory_of(const queue *q, queue_lane lane, const job *j) {
  if (!q->options.memory || fetches(j)) {
    return 0;
  }
  const int64_t most = budget_most(q->options.memory, part_of(lane)), share = most / SHARE_OF_JOB;
  const int64_t base = share < BYTES_OF_JOB ? share : BYTES_OF_JOB;
  return j->needs_all || j->row.cost > (most - base) / BYTES_A_TRIANGLE ? most : base + BYTES_A_TRIANGLE * j->row.cost;
}

static budget_room look_for_memory(const queue *q, queue_lane lane, const job *j) {
  return q->options.memory ? budget_look(q->options.memory, part_of(lane), memory_of(q, lane, j), &q->claim)
                           : BUDGET_FREE;
}

static int has_memory(const queue *q, queue_lane lane, const job *j) {
  return look_for_memory(q, lane, j) == BUDGET_FREE;
}

/* Whether a worker of this lane may take a runnable job that computes. kept: the workers are kept for a suspect. */
static int admits(const queue *q, queue_lane lane, const job *j, int kept) {
  int workers = q->options.workers, most_large = workers > 1 ? workers - 1 : 1;
  int computing = q->running - q->fetching - q->guests, large = j->row.cost > LARGE;
  int fits = has_memory(q, QUEUE_COMPUTES, j);
  if (lane == QUEUE_COMPUTES) {
    return fits && !(large && q->running_large >= most_large);
  }
  if (large || j->needs_all || !has_memory(q, QUEUE_GUESTS, j)) {
    return 0;
  }
  if (workers == 1 && computing == 1 && q->guests == 0 && q->running_large == 1 && !kept) {
    return 1;
  }
  return q->owners[j->owner].running == 0 && (computing >= workers || !fits || kept);
}

/* A worker is free: claims the memory of the oldest job that waits for checks alone. */
static void claim_memory(queue *q, int64_t now) {
  int64_t bytes = 0;
  for (const job *j = q->first; j && bytes == 0 && q->options.memory; j = j->next) {
    if (runnable(q, j, now) && !fetches(j) && look_for_memory(q, QUEUE_COMPUTES, j) == BUDGET_OTHERS) {
      bytes = memory_of(q, QUEUE_COMPUTES, j);
    }
  }
  if (bytes < q->claim.bytes) {
    table_drop_claim(q);
  }
  if (bytes > 0) {
    budget_claim_bytes(q->options.memory, &q->claim, bytes);
  }
}

/* Without processes of their own the end of one job is the end of all, so a suspect runs alone as long as it takes. */
int64_t schedule_alone_until(const queue *q) {
  return q->isolated ? orb_clock_ms() + SUSPECT_MS : INT64_MAX;
}

int schedule_is_kept(const queue *q, int64_t now) {
  return q->alone && now < q->alone->alone_until;
}

/* Whether others wait for this job. */
static int keeps(const job *j, int64_t now) {
  return j->row.suspect && now < j->alone_until;
}

job *schedule_choose(queue *q, queue_lane lane) {
  int64_t now = orb_clock_ms();
  job *best = NULL;
  int kept = schedule_is_kept(q, now), may_pass = q->isolated && lane == QUEUE_GUESTS;
  if (kept && !may_pass) {
    return NULL;
  }
  for (const job *j = q->first; j && !kept; j = j->next) {
    kept = keeps(j, now) && runnable(q, j, now);
  }
  owners_charge(q);
  int share = share_of_owner(q, now);
  for (job *j = q->first; j; j = j->next) {
    if (!runnable(q, j, now)) {
      continue;
    }
    int mine = fetches(j) == (lane == QUEUE_FETCHES);
    if (keeps(j, now) && may_pass) {
      continue;
    }
    if (keeps(j, now)) { /* alone, so not beside others as a guest */
      const int alone = q->running - (q->isolated ? q->guests : 0) == 0;
      return alone && mine && lane != QUEUE_GUESTS ? j : NULL;
    }
    if (!mine || (fetches(j) ? q->owners[j->owner].fetching >= QUEUE_FETCHES_OF_OWNER : !admits(q, lane, j, kept))) {
      continue;
    }
    if (!best || goes_before(q, j, best, share)) {
      best = j;
    }
  }
  if (!best && lane == QUEUE_COMPUTES) {
    claim_memory(q, now);
  }
  return best;
}

/* Counts a job that a worker takes (by = 1) or leaves (by = -1). */
static void count(queue *q, const job *j, int by) {
  q->running += by;
  if (fetches(j)) {
    q->fetching += by;
    q->owners[j->owner].fetching += by;
  } else {
    q->owners[j->owner].running += by;
  }
  if (j->is_guest) {
    q->guests += by;
  } else {
    q->running_large += by * (j->row.cost > LARGE);
  }
}

/* 0: there is none now; others wake the queue when they end. */
int schedule_take_memory(queue *q, queue_lane lane, job *j) {
  const int64_t bytes = memory_of(q, lane, j);
  const int taken = bytes == 0 || budget_take(q->options.memory, part_of(lane), bytes, &q->claim) == BUDGET_FREE;
  j->memory = taken ? bytes : 0;
  if (taken && lane == QUEUE_COMPUTES) { /* the next worker that waits claims again */
    table_drop_claim(q);
  }
  return taken;
}

int64_t queue_memory_of(queue *q, job *j) {
  pthread_mutex_lock(&q->lock);
  int64_t bytes = j->memory;
  pthread_mutex_unlock(&q->lock);
  return bytes;
}

int64_t schedule_room(const queue *q, queue_lane lane, int *big) {
  const int64_t left = q->options.memory ? budget_left(q->options.memory, part_of(lane)) : INT64_MAX;
  job probe = {.needs_all = 1};
  int64_t room = -1;
  probe.row.cost = INT32_MAX;
  *big = memory_of(q, lane, &probe) <= left;
  probe.needs_all = 0;
  for (int64_t step = INT64_C(1) << 32; step > 0; step /= 2) {
    probe.row.cost = room + step;
    room += memory_of(q, lane, &probe) <= left ? step : 0;
  }
  if (room < 0) { /* not even for the smallest job: that is a shortage */
    probe.row.cost = 0;
    (void)has_memory(q, lane, &probe);
  }
  return room;
}

void schedule_enter(queue *q, queue_lane lane, job *j, int64_t now) {
  j->taken = 1;
  j->refs++;
  j->is_guest = lane == QUEUE_GUESTS;
  j->taken_at = now;
  j->charged = 0;
  owner_charge(q, j, fetches(j) ? 0 : 10 + j->row.cost / TRIANGLES_A_MS);
  count(q, j, 1);
  if (!j->is_guest) { /* another one has waited long enough for the one that is alone */
    q->alone = keeps(j, now) ? j : NULL;
  }
  if (q->alone == j) {
    j->alone_until = schedule_alone_until(q);
  }
}

int schedule_threads(const queue *q, const job *j, int64_t beside) {
  const int64_t others = q->running - q->fetching - !fetches(j), wanted = 1 + others + beside;
  const int64_t share = wanted < q->options.workers ? wanted : q->options.workers;
  return j->is_guest || q->options.cores < share ? 1 : q->options.cores / (int)share;
}

int schedule_beside(const queue *q, const job *chosen, int64_t now) {
  int beside = 0;
  for (const job *other = q->first; other; other = other->next) {
    beside += other != chosen && !fetches(other) && runnable(q, other, now);
  }
  return beside;
}

void schedule_leave(queue *q, job *j) {
  owner_charge(q, j, fetches(j) ? 0 : used_ms(j, orb_clock_ms()));
  count(q, j, -1);
  if (j->memory > 0) {
    budget_give(q->options.memory, j->is_guest ? BUDGET_SMALL : BUDGET_JOBS, j->memory, q);
  }
  j->memory = 0;
  free(j->row.request);
  j->row.request = NULL;
  const int frees_fetches = fetches(j) || q->alone == j;
  q->alone = q->alone == j ? NULL : q->alone;
  j->taken_at = 0;
  j->charged = 0;
  j->is_guest = 0;
  j->taken = 0;
  j->running = 0;
  j->ctx = NULL;
  j->ready = unix_ms();
  if (q->shared) {
    shared_look(q, frees_fetches);
  }
  wake_workers(q);
}

int queue_runs_alone(queue *q, job *j) {
  pthread_mutex_lock(&q->lock);
  int alone = q->alone == j;
  pthread_mutex_unlock(&q->lock);
  return alone;
}

/* The job runs from now on. Time that it waited, or that an earlier attempt took, does not count for what is left. */
static void show_start(job *j, int64_t now) {
  j->row.state = API_JOB_RUNNING;
  j->row.started = j->row.started ? j->row.started : now;
  j->began_ms = j->ends_ms = j->seconds_left = 0;
}

store_result queue_claim(queue *q, job *j) {
  int64_t now = unix_ms();
  if (q->shared) { /* queue_take() has claimed it */
    if (!j->row.started) {
      catalogue_job_begin(q->cat, j->row.id, j->row.attempt);
    }
    pthread_mutex_lock(&q->lock);
    show_start(j, now);
    pthread_mutex_unlock(&q->lock);
    return STORE_OK;
  }
  FAULT_POINT("before-claim");
  store_result result = catalogue_job_claim(q->cat, j->row.id, j->row.attempt + 1, queue_runs_alone(q, j), now);
  FAULT_POINT("after-claim");
  pthread_mutex_lock(&q->lock);
  if (result == STORE_OK) {
    j->row.attempt++;
    show_start(j, now);
    j->running = 1;
  }
  pthread_mutex_unlock(&q->lock);
  return result;
}

int queue_read_request(queue *q, job *j) {
  if (j->row.request) { /* the claim has brought it */
    return 1;
  }
  char *text = catalogue_job_request(q->cat, j->row.id);
  pthread_mutex_lock(&q->lock);
  j->row.request = text;
  pthread_mutex_unlock(&q->lock);
  return text != NULL;
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
  if (ctx && (j->cancel || q->stopping_now)) { /* what cancels contexts has come before this one */
    orb_context_cancel(ctx);
  }
  pthread_mutex_unlock(&q->lock);
}

int64_t queue_ready_ms(queue *q, const job *j) {
  pthread_mutex_lock(&q->lock);
  int64_t ready = j->ready;
  pthread_mutex_unlock(&q->lock);
  return ready;
}

int queue_attempt(queue *q, const job *j) {
  pthread_mutex_lock(&q->lock);
  int attempt = j->row.attempt;
  pthread_mutex_unlock(&q->lock);
  return attempt;
}

int queue_cancel_wanted(queue *q, job *j) {
  pthread_mutex_lock(&q->lock);
  int wanted = j->cancel;
  pthread_mutex_unlock(&q->lock);
  return wanted;
}
