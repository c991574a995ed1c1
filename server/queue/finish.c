/* The end of a job, cancelling, and retry: jobs that a worker returns are chosen again after retry_at. */
#include <stdlib.h>
#include <string.h>

#include "faults.h"
#include "log.h"
#include "queue/internal.h"
#include "queue/shared.h"
#include "store/usage.h"

static void release_dependents(queue *q, job *ended) {
  for (job *j = q->first; j; j = j->next) {
    for (int d = 0; j->waits_for && d < j->dependency_count; d++) {
      if (is_for(ended, j->dependencies[d], j->row.owner)) {
        j->ready = --j->waits_for ? j->ready : unix_ms();
        j->seconds_left = j->waits_for ? j->seconds_left : 0; /* until a worker takes it */
        if (ended->row.state == API_JOB_FAILED && ended->row.problem && !j->dependency_problem) {
          j->dependency_problem = strdup(ended->row.problem);
        }
      }
    }
  }
}

/* Marks the job as ended in memory, after its row was committed. */
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
  wake_workers(q);
}

/* Commits the end of a taken job, then shows it. worked: a worker has taken the job; it leaves the job in the same step
 * in which others see that it has ended. */
static store_result end_job(queue *q, job *j, job_end *end, int worked) {
  api_job_state state = end->state;
  end->now = unix_ms();
  pthread_mutex_lock(&q->lock);
  job shown = *j;
  end->owner = j->row.owner;
  end->started = j->row.started;
  end->worker_ms = worked && !fetches(j) ? used_ms(j, orb_clock_ms()) : 0;
  shown.row.state = state;
  shown.row.finished = end->now;
  shown.row.problem = (char *)(uintptr_t)end->problem;
  copy_text(shown.row.result, sizeof shown.row.result, end->mesh ? end->mesh : "");
  shown.progress = state == API_JOB_SUCCEEDED ? 1 : j->progress;
  api_text json = {0};
  end->event = prepare_event(&shown, &json) + 1000; /* above any event that is added before the commit */
  end->event_json = json.data;
  pthread_mutex_unlock(&q->lock);
  FAULT_POINT("before-finish");
  store_result stored = json.failed ? STORE_ERROR : catalogue_job_finish(q->cat, j->row.id, j->row.attempt, end);
  FAULT_POINT("after-finish");
  if (stored == STORE_OK) {
    pthread_mutex_lock(&q->lock);
    const int left =
        !worked && q->shared && j->taken;      /* a worker that has lost the job shows the end when it leaves the job */
    if (api_job_ended(j->row.state) || left) { /* a notice has brought the end before this thread */
      if (left && j->ctx) {
        orb_context_cancel(j->ctx);
      } else if (worked) {
        schedule_leave(q, j);
      }
      pthread_mutex_unlock(&q->lock);
      api_text_free(&json);
      return STORE_OK;
    }
    copy_text(j->row.result, sizeof j->row.result, end->mesh ? end->mesh : "");
    ended_locked(q, j, state, end->problem, end->now);
    if (worked) {
      schedule_leave(q, j);
    }
    publish_end(q, j, end->event, json.data);
    pthread_mutex_unlock(&q->lock);
    if (q->on_end) {
      q->on_end(q->on_end_user);
    }
  }
  api_text_free(&json);
  return stored;
}

/* Marks the job as cancelled. 1 if no worker has it: the caller has then taken it and must end it. */
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
  store_result stored = end_job(q, j, &(job_end){.state = API_JOB_CANCELLED}, 0);
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

/* Cancels the embedding jobs that only this job needed. Each is checked and marked under one lock, so a request that
 * comes later gets a new job. */
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

enum { LOST_TRIES = 3 };

/* Tries again while the database is unreachable: nothing is lost. */
static store_result end_surely(queue *q, job *j, job_end *end, const queue_made *made) {
  store_result stored = end_job(q, j, end, 1);
  for (int lost = 0; q->shared;) {
    int again = stored == STORE_ERROR  ? shared_pause(q)
                : stored == STORE_LOST ? made && lost++ < LOST_TRIES && shared_pause(q) && made->published(made->user)
                                       : 0;
    if (!again) {
      break;
    }
    stored = end_job(q, j, end, 1);
  }
  return stored;
}

static void finish_as(queue *q, job *j, job_end *end, const queue_made *made) {
  store_result stored = end_surely(q, j, end, made);
  if (stored == STORE_CONFLICT && q->shared) {
    log_warn("job %s, attempt %d: this node has lost it; its result is dropped", j->row.id, j->row.attempt);
    queue_give_back(q, j);
    return;
  }
  if (stored != STORE_OK) {
    log_error("the end of job %s could not be stored; the job will run again", j->row.id);
    pthread_mutex_lock(&q->lock);
    j->retry_at = orb_clock_ms() + RETRY_AFTER_STORE_MS;
    pthread_mutex_unlock(&q->lock);
    queue_give_back(q, j);
    return;
  }
  if (end->state == API_JOB_CANCELLED && !q->shared) {
    cancel_needless(q, j);
  }
  pthread_mutex_lock(&q->lock);
  job_unref(j);
  pthread_mutex_unlock(&q->lock);
}

void queue_finish(queue *q, job *j, api_job_state state, const char *problem) {
  finish_as(q, j, &(job_end){.state = state, .problem = problem}, NULL);
}

void queue_finish_made(queue *q, job *j, const queue_made *made) {
  finish_as(q, j, &(job_end){.state = API_JOB_SUCCEEDED, .result = made->result}, made);
}

void queue_finish_mesh(queue *q, job *j, const char *mesh) {
  finish_as(q, j, &(job_end){.state = API_JOB_SUCCEEDED, .mesh = mesh}, NULL);
}

/* Takes back queue_show_running(). */
static void show_queued(job *j) {
  if (j->row.kind == API_JOB_FETCH && !j->running) {
    j->row.state = API_JOB_QUEUED;
    j->stage[0] = 0;
  }
}

/* Counts the time of a worker that a job leaves before its end. */
static void count_time(queue *q, const job *j) {
  int64_t ms = fetches(j) ? 0 : used_ms(j, orb_clock_ms());
  if (ms > 0) {
    catalogue_add_time(q->cat, j->row.owner, ms);
  }
}

static store_result release(queue *q, const job *j) {
  return q->shared && j->needs_all ? catalogue_job_release_big(q->cat, j->row.id, j->row.attempt)
                                   : catalogue_job_release(q->cat, j->row.id, j->row.attempt);
}

void queue_give_back(queue *q, job *j) {
  int claimed = j->running;
  count_time(q, j);
  store_result stored = claimed ? release(q, j) : STORE_OK;
  while (stored == STORE_ERROR && q->shared && shared_pause(q)) {
    stored = release(q, j);
  }
  pthread_mutex_lock(&q->lock);
  if (claimed && !api_job_ended(j->row.state)) {
    j->row.state = API_JOB_QUEUED;
    j->row.attempt -= stored == STORE_OK;
    j->stage[0] = 0;
    if (stored != STORE_OK) { /* the row still says that it runs: the next claim corrects it */
      j->retry_at = orb_clock_ms() + RETRY_AFTER_STORE_MS;
    }
  }
  show_queued(j);
  schedule_leave(q, j);
  char id[API_JOB_ID_SIZE];
  memcpy(id, j->row.id, sizeof id);
  job_unref(j);
  pthread_mutex_unlock(&q->lock);
  if (q->shared) {
    shared_refresh(q, id);
  }
}

int queue_needs_memory(queue *q, job *j) {
  pthread_mutex_lock(&q->lock);
  int more = j->memory > 0 && j->memory < budget_most(q->options.memory, BUDGET_JOBS);
  j->needs_all |= more;
  pthread_mutex_unlock(&q->lock);
  if (more) {
    log_info("job %s needs more than its share of the memory and runs again with all of it", j->row.id);
    queue_give_back(q, j);
  }
  return more;
}

int queue_crashed(queue *q, job *j, queue_blame blame) {
  pthread_mutex_lock(&q->lock);
  const int counts = blame == QUEUE_BLAMED || j->row.attempt >= ATTEMPTS_BORNE;
  const int crashes = j->row.crashes + counts, suspect = !counts && blame == QUEUE_SUSPECTED;
  pthread_mutex_unlock(&q->lock);
  store_result stored = catalogue_job_crashed(q->cat, &j->row, counts, suspect, unix_ms());
  while (stored == STORE_ERROR && q->shared && shared_pause(q)) {
    stored = catalogue_job_crashed(q->cat, &j->row, counts, suspect, unix_ms());
  }
  if (crashes >= CRASHES_MOST) {
    return 1;
  }
  count_time(q, j);
  pthread_mutex_lock(&q->lock);
  j->row.state = api_job_ended(j->row.state) ? j->row.state : API_JOB_QUEUED;
  j->row.crashes = crashes;
  j->row.suspect = suspect;
  j->alone_until = schedule_alone_until(q);
  j->stage[0] = 0;
  if (stored != STORE_OK) { /* the row still says that it runs: the next claim corrects it */
    j->retry_at = orb_clock_ms() + RETRY_AFTER_STORE_MS;
  }
  schedule_leave(q, j);
  job_unref(j);
  pthread_mutex_unlock(&q->lock);
  return 0;
}

void queue_put_off(queue *q, job *j) {
  if (q->shared) { /* it was claimed */
    shared_hold(q, RETRY_SOON_MS);
    queue_give_back(q, j);
    return;
  }
  pthread_mutex_lock(&q->lock);
  show_queued(j);
  j->retry_at = orb_clock_ms() + RETRY_SOON_MS;
  schedule_leave(q, j);
  job_unref(j);
  pthread_mutex_unlock(&q->lock);
}

/* The mark in the catalogue reaches the node that runs the job, or claims it at this moment. A job that no node runs
 * ends here, although a node may claim it, or let it wait, at the same moment. */
static store_result cancel_shared(queue *q, job *j) {
  enum { TRIES = 8 };
  job_mark mark;
  store_result stored = catalogue_job_cancel(q->cat, j->row.id);
  for (int i = 0; i < TRIES && stored == STORE_OK; i++) {
    int found = catalogue_job_marks(q->cat, j->row.id, 1, &mark);
    shared_refresh(q, j->row.id);
    if (found != 1 || !mark.queued) {
      stored = found < 0 ? STORE_ERROR : STORE_OK;
      break;
    }
    stored = end_job(q, j, &(job_end){.state = API_JOB_CANCELLED}, 0);
    if (stored == STORE_OK) {
      return STORE_OK;
    }
    stored = stored == STORE_CONFLICT ? STORE_OK : stored;
  }
  if (stored == STORE_OK) {
    shared_cancelled(q, j->row.id);
  }
  return stored;
}

store_result queue_cancel(queue *q, job *j) {
  if (q->shared) {
    return cancel_shared(q, j);
  }
  pthread_mutex_lock(&q->lock);
  int mine = cancel_locked(j);
  pthread_mutex_unlock(&q->lock);
  if (!mine) {
    return STORE_OK; /* the worker that has the job ends it */
  }
  store_result stored = end_cancelled(q, j);
  if (stored == STORE_OK) {
    cancel_needless(q, j);
  }
  return stored;
}
