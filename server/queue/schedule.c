/* Submitting, choosing, ending. */
#include <stdlib.h>
#include <string.h>

#include "faults.h"
#include "log.h"
#include "queue/internal.h"

/* The owner's job for the same, referenced; NULL with the number of the owner's listed jobs. One that was cancelled
 * while it was waited for is none. */
static job *adopt_locked(queue *q, const queue_request *request, int64_t *mine) {
  for (;;) {
    job *j;
    *mine = 0;
    for (j = q->first; j && (j->cancel || !is_for(j, request->key, request->owner)); j = j->next) {
      *mine += request->owner_limit > 0 && j->row.listed && strcmp(j->row.owner, request->owner) == 0;
    }
    if (!j) {
      return NULL;
    }
    j->refs++;
    while (!j->committed && !j->dead) { /* until then the row is read by who writes it, without the lock */
      pthread_cond_wait(&q->committed, &q->lock);
    }
    if (!j->cancel || j->dead) {
      return j;
    }
    job_unref(j);
  }
}

static queue_result submit_locked(queue *q, const queue_request *request, job **out, int *fresh) {
  int64_t mine = 0;
  job *j = adopt_locked(q, request, &mine);
  if (j) {
    j->row.priority = request->priority > j->row.priority ? request->priority : j->row.priority;
    *out = j;
    return j->dead ? QUEUE_ERROR : QUEUE_OK;
  }
  if (q->stopping) {
    return QUEUE_STOPPING;
  }
  if (request->listed && q->unfinished >= q->options.limit) {
    return QUEUE_FULL;
  }
  if (request->owner_limit > 0 && mine >= request->owner_limit) {
    return QUEUE_QUOTA;
  }
  j = calloc(1, sizeof *j);
  char *text = strdup(request->request);
  if (!j || !text) {
    free(j);
    free(text);
    return QUEUE_ERROR;
  }
  j->refs = 2; /* the table's and the caller's */
  j->row.request = text;
  j->row.kind = request->kind;
  j->row.cost = request->cost;
  j->row.priority = request->priority;
  j->row.listed = request->listed;
  j->row.created = unix_ms();
  api_random_id(j->row.id);
  copy_text(j->row.key, sizeof j->row.key, request->key);
  copy_text(j->row.owner, sizeof j->row.owner, request->owner);
  table_add(q, j);
  *out = j;
  *fresh = 1;
  return QUEUE_OK;
}

queue_result queue_submit(queue *q, const queue_request *request, job **out, int *fresh) {
  int is_fresh = 0, make_listed = 0;
  pthread_mutex_lock(&q->lock);
  queue_result result = submit_locked(q, request, out, &is_fresh);
  if (result == QUEUE_OK && !is_fresh && request->listed && !(*out)->row.listed) {
    make_listed = 1;
    (*out)->adopters++; /* from here nobody cancels it as needless */
  }
  pthread_mutex_unlock(&q->lock);
  if (fresh) {
    *fresh = is_fresh;
  }
  if (make_listed) {
    store_result stored = catalogue_job_list_it(q->cat, (*out)->row.id);
    pthread_mutex_lock(&q->lock);
    (*out)->adopters--;
    (*out)->row.listed |= stored == STORE_OK;
    pthread_mutex_unlock(&q->lock);
    result = stored == STORE_OK ? QUEUE_OK : stored == STORE_FULL ? QUEUE_STORE_FULL : QUEUE_ERROR;
  }
  if (!is_fresh) {
    return result;
  }
  job *j = *out;
  FAULT_POINT("before-accept");
  store_result stored = catalogue_job_insert(q->cat, &j->row);
  FAULT_POINT("after-accept");
  pthread_mutex_lock(&q->lock);
  if (stored == STORE_OK) {
    j->committed = 1;
    pthread_cond_signal(&q->work);
  } else {
    j->dead = 1;
    j->row.state = API_JOB_FAILED;
    table_drop_key(q, j);
    j->committed = 0;
    table_ended(q, j);
    job_unref(j);
    *out = NULL;
    result = stored == STORE_FULL ? QUEUE_STORE_FULL : stored == STORE_NOT_FOUND ? QUEUE_MESH_GONE : QUEUE_ERROR;
  }
  pthread_cond_broadcast(&q->committed);
  pthread_mutex_unlock(&q->lock);
  return result;
}

/* An entry for a name; one that has nothing unfinished makes room where all are taken. */
static int owner_at(queue *q, const char *name) {
  int at = 0, free_at = OWNERS - 1;
  while (at < q->owner_count && strcmp(q->owners[at].name, name) != 0) {
    if (q->owners[at].unfinished == 0) {
      free_at = at;
    }
    at++;
  }
  if (at < q->owner_count) {
    return at;
  }
  if (q->owner_count < OWNERS) {
    q->owner_count++;
  } else {
    at = free_at;
  }
  copy_text(q->owners[at].name, sizeof q->owners[at].name, name);
  q->owners[at].service = 0;
  return at;
}

/* Who had nothing to do saves nothing up: it starts level with the least of those who have. */
void owner_enter(queue *q, job *j) {
  j->owner = owner_at(q, j->row.owner);
  if (q->owners[j->owner].unfinished++ > 0) {
    return;
  }
  double least = -1, *mine = &q->owners[j->owner].service;
  for (int i = 0; i < q->owner_count; i++) {
    if (i != j->owner && q->owners[i].unfinished > 0 && (least < 0 || q->owners[i].service < least)) {
      least = q->owners[i].service;
    }
  }
  *mine = *mine > least ? *mine : least;
}

void owner_leave(queue *q, const job *j) {
  q->owners[j->owner].unfinished--;
}

/* Whether a goes before b, which is older. */
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

/* The next job for a worker, or NULL. */
static job *choose(queue *q, int small_only) {
  int64_t now = orb_clock_ms();
  int most_large = q->options.workers > 1 ? q->options.workers - 1 : 1;
  job *best = NULL;
  if (q->exclusive || (small_only && q->running_large < most_large)) {
    return NULL;
  }
  for (job *j = q->first; j; j = j->next) {
    if (!runnable(q, j, now)) {
      continue;
    }
    if (j->row.suspect) {
      return q->running == 0 ? j : NULL;
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

int queue_take(queue *q, int small_only, job **out, int *threads) {
  pthread_mutex_lock(&q->lock);
  job *j = NULL;
  while (!q->stopping && !(j = choose(q, small_only))) {
    pthread_cond_wait(&q->work, &q->lock);
  }
  if (j && !q->stopping) {
    int beside = 0;
    int64_t now = orb_clock_ms();
    for (job *other = q->first; other; other = other->next) {
      beside += other != j && runnable(q, other, now);
    }
    int wanted = q->running + 1 + beside;
    int share = wanted < q->options.workers ? wanted : q->options.workers;
    *threads = q->options.cores / share > 0 ? q->options.cores / share : 1;
    j->taken = 1;
    j->refs++;
    q->running++;
    q->running_large += j->row.cost > LARGE;
    q->running_cost += j->row.cost;
    q->exclusive = j->row.suspect;
    q->owners[j->owner].service += (double)j->row.cost + 1000;
    *out = j;
  } else {
    j = NULL;
  }
  pthread_mutex_unlock(&q->lock);
  return j != NULL;
}

/* Undoes what queue_take() counted. */
static void leave(queue *q, job *j) {
  q->running--;
  q->running_large -= j->row.cost > LARGE;
  q->running_cost -= j->row.cost;
  q->exclusive = 0;
  j->taken = 0;
  j->running = 0;
  j->ctx = NULL;
  pthread_cond_broadcast(&q->work);
}

queue_result queue_wait_for(queue *q, job *j, char (*keys)[API_ID_SIZE], const char *const *requests,
                            const int64_t *costs, int count) {
  queue_result result = QUEUE_OK;
  pthread_mutex_lock(&q->lock);
  memcpy(j->dependencies, keys, (size_t)count * sizeof *keys);
  j->dependency_count = count;
  j->waits_for = 1; /* so that it does not run before all are there */
  pthread_mutex_unlock(&q->lock);
  for (int i = 0; i < count && result == QUEUE_OK; i++) {
    job *needed = NULL;
    queue_request request = {.kind = API_JOB_EMBEDDING,
                             .key = keys[i],
                             .request = requests[i],
                             .owner = j->row.owner,
                             .cost = costs[i],
                             .priority = j->row.priority};
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
    j->retry_at = orb_clock_ms() + 1000;
  }
  if (j->cancel) { /* while it was planned */
    j->waits_for = 0;
    pthread_mutex_unlock(&q->lock);
    queue_finish(q, j, API_JOB_CANCELLED, NULL, NULL);
    return QUEUE_OK;
  }
  leave(q, j);
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

static void release_dependents(queue *q, job *ended) {
  for (job *j = q->first; j; j = j->next) {
    for (int d = 0; j->waits_for && d < j->dependency_count; d++) {
      if (is_for(ended, j->dependencies[d], j->row.owner)) {
        j->waits_for--;
        if (ended->row.state == API_JOB_FAILED && ended->row.problem && !j->dependency_problem) {
          j->dependency_problem = strdup(ended->row.problem);
        }
      }
    }
  }
}

/* The end of a job in memory, after its row was committed. */
static void ended_locked(queue *q, job *j, api_job_state state, const char *problem, int64_t now) {
  j->row.state = state;
  j->row.finished = now;
  j->row.problem = problem ? strdup(problem) : NULL;
  if (state == API_JOB_SUCCEEDED) {
    j->progress = 1;
  }
  table_drop_key(q, j);
  q->ended[state]++;
}

static void publish_end(queue *q, job *j, int64_t number, const char *json) {
  keep_event(j, number, api_job_state_name(j->row.state), json);
  release_dependents(q, j);
  wake_job(q, j, 1);
  table_ended(q, j);
  pthread_cond_broadcast(&q->work);
}

/* Writes the end and shows it; the caller has taken the job. worked: as the worker that has it, and leaves it in the
 * moment in which others see it ended. */
static store_result end_job(queue *q, job *j, api_job_state state, const char *problem, const resource *result,
                            int worked) {
  int64_t now = unix_ms();
  pthread_mutex_lock(&q->lock);
  job shown = *j;
  shown.row.state = state;
  shown.row.finished = now;
  shown.row.problem = (char *)(uintptr_t)problem;
  shown.progress = state == API_JOB_SUCCEEDED ? 1 : j->progress;
  api_text json = {0};
  int64_t number = prepare_event(&shown, &json) + 1000; /* beyond events that are still on their way */
  pthread_mutex_unlock(&q->lock);
  FAULT_POINT("before-finish");
  store_result stored = json.failed ? STORE_ERROR
                                    : catalogue_job_finish(q->cat, j->row.id, j->row.attempt, state, problem, now,
                                                           result, number, json.data);
  FAULT_POINT("after-finish");
  if (stored == STORE_OK) {
    pthread_mutex_lock(&q->lock);
    ended_locked(q, j, state, problem, now);
    if (worked) {
      leave(q, j);
    }
    publish_end(q, j, number, json.data);
    pthread_mutex_unlock(&q->lock);
  }
  api_text_free(&json);
  return stored;
}

/* Notes the wish; 1 where the job is the caller's to end, because no worker has it. */
static int cancel_locked(job *j) {
  int mine = !api_job_ended(j->row.state) && !j->taken;
  j->cancel = 1;
  if (j->ctx) {
    orb_context_cancel(j->ctx);
  }
  j->taken |= mine;
  return mine;
}

static store_result end_cancelled(queue *q, job *j) {
  store_result stored = end_job(q, j, API_JOB_CANCELLED, NULL, NULL, 0);
  if (stored != STORE_OK) {
    pthread_mutex_lock(&q->lock);
    j->taken = 0;
    pthread_mutex_unlock(&q->lock);
  }
  return stored;
}

static int is_wanted(const queue *q, const job *needed, const job *besides) {
  int wanted = needed->row.listed || needed->adopters > 0 || !needed->committed;
  for (const job *j = q->first; j && !wanted; j = j->next) {
    for (int k = 0; j != besides && k < j->dependency_count; k++) {
      wanted |= is_for(needed, j->dependencies[k], j->row.owner);
    }
  }
  return wanted;
}

/* Ends the sub-jobs that only this job wanted. Looked at and marked under one lock: who comes later gets another. */
static void cancel_needless(queue *q, job *of) {
  for (int d = 0; d < of->dependency_count; d++) {
    pthread_mutex_lock(&q->lock);
    job *needed = table_find(q, of->dependencies[d], of->row.owner);
    if (!needed || is_wanted(q, needed, of)) {
      pthread_mutex_unlock(&q->lock);
      continue;
    }
    needed->refs++;
    int mine = cancel_locked(needed);
    pthread_mutex_unlock(&q->lock);
    if (mine && end_cancelled(q, needed) != STORE_OK) {
      log_warn("job %s could not be cancelled", needed->row.id);
    }
    queue_release(q, needed);
  }
}

void queue_finish(queue *q, job *j, api_job_state state, const char *problem, const resource *result) {
  store_result stored = end_job(q, j, state, problem, result, 1);
  if (stored != STORE_OK) {
    log_error("the end of job %s could not be stored; it will be run again", j->row.id);
    pthread_mutex_lock(&q->lock);
    j->retry_at = orb_clock_ms() + 5000;
    pthread_mutex_unlock(&q->lock);
    queue_give_back(q, j);
    return;
  }
  if (state == API_JOB_CANCELLED) {
    cancel_needless(q, j);
  }
  pthread_mutex_lock(&q->lock);
  job_unref(j);
  pthread_mutex_unlock(&q->lock);
}

void queue_give_back(queue *q, job *j) {
  int claimed = j->running;
  store_result stored = claimed ? catalogue_job_release(q->cat, j->row.id, j->row.attempt) : STORE_OK;
  pthread_mutex_lock(&q->lock);
  if (claimed) {
    j->row.state = API_JOB_QUEUED;
    j->row.attempt -= stored == STORE_OK;
    j->stage[0] = 0;
    if (stored != STORE_OK) { /* try again to make the row what it should be before it runs */
      j->retry_at = orb_clock_ms() + 5000;
    }
  }
  leave(q, j);
  job_unref(j);
  pthread_mutex_unlock(&q->lock);
}

void queue_put_off(queue *q, job *j) {
  pthread_mutex_lock(&q->lock);
  j->retry_at = orb_clock_ms() + 1000;
  leave(q, j);
  job_unref(j);
  pthread_mutex_unlock(&q->lock);
}

store_result queue_cancel(queue *q, job *j) {
  pthread_mutex_lock(&q->lock);
  int mine = cancel_locked(j);
  pthread_mutex_unlock(&q->lock);
  if (!mine) {
    return STORE_OK; /* the worker that has it sees the wish */
  }
  store_result stored = end_cancelled(q, j);
  if (stored == STORE_OK) {
    cancel_needless(q, j);
  }
  return stored;
}

void queue_set_limit(queue *q, int limit) {
  pthread_mutex_lock(&q->lock);
  q->options.limit = limit;
  pthread_mutex_unlock(&q->lock);
}
