/* Submitting and claiming jobs where several nodes share them: the catalogue decides. */
#include <stdlib.h>
#include <string.h>

#include "faults.h"
#include "queue/internal.h"
#include "queue/shared.h"

static queue_result result_of(store_result stored, submit_outcome outcome) {
  static const queue_result results[] = {[SUBMIT_FRESH] = QUEUE_OK,
                                         [SUBMIT_KNOWN] = QUEUE_OK,
                                         [SUBMIT_FULL] = QUEUE_FULL,
                                         [SUBMIT_QUOTA] = QUEUE_QUOTA,
                                         [SUBMIT_ROOM] = QUEUE_ROOM};
  return stored == STORE_OK          ? results[outcome]
         : stored == STORE_FULL      ? QUEUE_STORE_FULL
         : stored == STORE_NOT_FOUND ? QUEUE_MESH_GONE
         : stored == STORE_CONFLICT  ? (outcome == SUBMIT_KNOWN ? QUEUE_WEBHOOKS : QUEUE_CRASHED)
                                     : QUEUE_ERROR;
}

/* Puts the job of a request into memory before its row is committed, so that a notice about it finds the job. */
static job *prepare(queue *q, const queue_request *request) {
  pthread_mutex_lock(&q->lock);
  job *j = q->stopping ? NULL : job_create(q, request);
  pthread_mutex_unlock(&q->lock);
  return j;
}

/* Drops a job whose row was not inserted. The row may be there nevertheless, if the connection was lost at the commit.
 */
static void withdraw(queue *q, job *j) {
  pthread_mutex_lock(&q->lock);
  if (j->taken || api_job_ended(j->row.state)) {
    j->committed = 1;
  } else {
    j->dead = 1;
    table_forget(q, j);
  }
  job_unref(j);
  pthread_mutex_unlock(&q->lock);
}

/* *again: the job of the same request ended just now, so another try finds its result. */
static queue_result submit_once(queue *q, const queue_request *request, job **out, int *fresh, int *again) {
  const int stopping = q->stopping;
  job *j = prepare(q, request);
  *out = NULL;
  *again = 0;
  if (!j) {
    return stopping ? QUEUE_STOPPING : QUEUE_ERROR;
  }
  job_row row = j->row;
  row.request = (char *)(uintptr_t)request->request;
  job_submission s = {.row = &row,
                      .hook = request->hook,
                      .limit = q->options.limit,
                      .owner_limit = request->owner_limit,
                      .room = request->room,
                      .head = queue_bytes_of(0),
                      .triangle = queue_bytes_of(1) - queue_bytes_of(0),
                      .needs = queue_needs_of(request)};
  FAULT_POINT("before-accept");
  store_result stored = catalogue_job_submit(q->cat, &s);
  FAULT_POINT("after-accept");
  queue_result result = result_of(stored, s.outcome);
  if (fresh) {
    *fresh = result == QUEUE_OK && s.outcome == SUBMIT_FRESH;
  }
  if (result == QUEUE_OK && s.outcome == SUBMIT_FRESH) {
    pthread_mutex_lock(&q->lock);
    j->committed = 1;
    j->row.seq = row.seq;
    pthread_mutex_unlock(&q->lock);
    *out = j;
    return QUEUE_OK;
  }
  withdraw(q, j);
  if (result == QUEUE_OK) {
    *out = queue_follow(q, row.id);
    *again = !*out;
  }
  return result;
}

queue_result shared_submit(queue *q, const queue_request *request, job **out, int *fresh) {
  enum { TRIES = 3 };
  int again = 1;
  queue_result result = QUEUE_ERROR;
  for (int i = 0; i < TRIES && again; i++) {
    result = submit_once(q, request, out, fresh, &again);
  }
  return again ? QUEUE_ERROR : result;
}

/* What a worker of this lane may claim now; 0: nothing. */
static int may_claim(const queue *q, queue_lane lane, claim_wish *wish) {
  const sharing *s = q->shared;
  const int workers = q->options.workers, computing = q->running - q->fetching - q->guests;
  const int most_large = workers > 1 ? workers - 1 : 1, kept = schedule_is_kept(q, orb_clock_ms());
  int big = 1;
  *wish = (claim_wish){.node = s->node,
                       .fetches = lane == QUEUE_FETCHES,
                       .fetches_most = QUEUE_FETCHES_OF_OWNER,
                       .most_cost = INT64_MAX,
                       .alone_ms = q->isolated ? SUSPECT_MS : INT64_MAX,
                       .big = 1};
  if (!s->options.works || !s->look[lane] || s->looking[lane] || orb_clock_ms() < s->hold_until) {
    return 0;
  }
  if (lane == QUEUE_FETCHES) {
    return !kept;
  }
  if (lane == QUEUE_GUESTS && computing < workers && !kept) {
    return 0;
  }
  wish->most_cost = schedule_room(q, lane, &big);
  wish->big = big;
  if (lane == QUEUE_COMPUTES) {
    wish->alone = q->running - (q->isolated ? q->guests : 0) == 0;
    if (q->running_large >= most_large && wish->most_cost > LARGE) {
      wish->most_cost = LARGE;
    }
    return !kept && wish->most_cost >= 0;
  }
  const int beside_large = workers == 1 && computing == 1 && q->guests == 0 && q->running_large == 1;
  wish->guest = !beside_large;
  wish->big = 0;
  wish->most_cost = wish->most_cost < LARGE ? wish->most_cost : LARGE;
  return (!kept || q->isolated) && wish->most_cost >= 0;
}

/* Takes what a claimed row says into a job that is in memory already. Id, key and owner are the same, and threads that
 * hold the job read them without the lock. */
static void update_row(job_row *known, job_row *claimed) {
  known->request = claimed->request; /* it had none: no worker of this node has the job */
  claimed->request = NULL;
  known->seq = claimed->seq;
  known->attempt = claimed->attempt;
  known->crashes = claimed->crashes;
  known->suspect = claimed->suspect;
  known->alone = claimed->alone;
  known->listed = claimed->listed;
  known->priority = claimed->priority;
  known->started = claimed->started;
}

/* The job in memory of a claim; takes over the row. NULL: out of memory. */
static job *enter(queue *q, job_claim *c) {
  job *j = table_with_id(q, c->row.id);
  char *problem = c->row.problem; /* of a job that it waited for */
  c->row.problem = NULL;
  if (j) {
    update_row(&j->row, &c->row);
    free(j->row.problem);
    j->row.problem = NULL;
  } else if ((j = calloc(1, sizeof *j))) {
    j->refs = 1;
    j->row = c->row;
    table_add(q, j);
  } else {
    free(problem);
    return NULL;
  }
  j->row.state = API_JOB_QUEUED; /* until queue_claim(): it may lack embeddings */
  free(j->dependency_problem);
  j->dependency_problem = problem;
  j->committed = 1;
  j->running = 1;
  j->alone_until = c->row.alone ? schedule_alone_until(q) : 0;
  j->cancel |= c->cancel;
  j->needs_all = c->big;
  j->ready = c->ready;
  j->stage[0] = 0;
  j->last_event = c->last_event > j->last_event ? c->last_event : j->last_event;
  return j;
}

/* Gives a claim back, and releases the lock for that time. */
static job *refuse(queue *q, job_claim *c) {
  pthread_mutex_unlock(&q->lock);
  store_result stored = catalogue_job_release(q->cat, c->row.id, c->row.attempt);
  while (stored == STORE_ERROR && shared_pause(q)) {
    stored = catalogue_job_release(q->cat, c->row.id, c->row.attempt);
  }
  job_row_free(&c->row);
  pthread_mutex_lock(&q->lock);
  q->shared->hold_until = orb_clock_ms() + RETRY_SOON_MS;
  return NULL;
}

/* Asks the catalogue for a job, and releases the lock for that time. NULL: there is none. */
static job *claim(queue *q, queue_lane lane, const claim_wish *wish, int *threads) {
  sharing *s = q->shared;
  job_claim claimed;
  const int guests = s->look[QUEUE_GUESTS];
  s->look[lane] = 0;
  s->look[QUEUE_GUESTS] = 0; /* what comes meanwhile sets it again */
  s->looking[lane] = 1;
  pthread_mutex_unlock(&q->lock);
  FAULT_POINT("before-claim");
  store_result result = catalogue_claim_next(q->cat, wish, &claimed);
  FAULT_POINT("after-claim");
  pthread_mutex_lock(&q->lock);
  s->looking[lane] = 0;
  /* A guest is a job of an owner who has no running one, so not of the owner of this one. */
  if (lane != QUEUE_GUESTS && (result != STORE_OK || claimed.others > 0)) {
    s->look[QUEUE_GUESTS] |= guests;
  }
  if (result != STORE_OK) {
    return NULL;
  }
  const job *known = table_with_id(q, claimed.row.id);
  if (known && known->taken) { /* a thread of this node is just leaving it, or does not know yet that it was lost */
    return refuse(q, &claimed);
  }
  job *j = enter(q, &claimed);
  if (!j) {
    return refuse(q, &claimed);
  }
  schedule_enter(q, lane, j, orb_clock_ms());
  int fits = schedule_take_memory(q, lane, j);
  *threads = schedule_threads(q, j, claimed.beside);
  s->look[lane] = 1; /* there may be more */
  pthread_cond_broadcast(&q->work);
  if (fits && !q->stopping) {
    return j;
  }
  pthread_mutex_unlock(&q->lock);
  queue_give_back(q, j);
  pthread_mutex_lock(&q->lock);
  return NULL;
}

int shared_take(queue *q, queue_lane lane, job **out, int *threads) {
  job *j = NULL;
  claim_wish wish;
  pthread_mutex_lock(&q->lock);
  while (!q->stopping && !j) {
    if (!may_claim(q, lane, &wish)) {
      pthread_cond_wait(&q->work, &q->lock);
    } else {
      j = claim(q, lane, &wish, threads);
    }
  }
  pthread_mutex_unlock(&q->lock);
  *out = j;
  return j != NULL;
}

queue_result shared_wait_for(queue *q, job *j, char (*keys)[API_ID_SIZE], const char *const *requests,
                             const int64_t *costs, int count) {
  const job_needs needs = {
      .row = &j->row, .keys = keys, .requests = requests, .costs = costs, .count = count, .now = unix_ms()};
  store_result stored = catalogue_job_wait(q->cat, &needs);
  if (stored != STORE_OK) {
    shared_hold(q, RETRY_SOON_MS);
    queue_give_back(q, j);
    return QUEUE_ERROR;
  }
  pthread_mutex_lock(&q->lock);
  if (!api_job_ended(j->row.state)) {
    j->row.state = API_JOB_QUEUED;
  }
  j->row.attempt--;
  j->stage[0] = 0;
  schedule_leave(q, j);
  job_unref(j);
  pthread_mutex_unlock(&q->lock);
  return QUEUE_OK;
}
