/* Start, recovery after a crash, stop. */
#include <stdlib.h>
#include <string.h>

#include "faults.h"
#include "log.h"
#include "queue/internal.h"
#include "queue/shared.h"
#include "wake.h"

enum { BATCH = 64 };

static void memory_freed(void *user) {
  queue *q = user;
  pthread_mutex_lock(&q->lock);
  if (q->shared) {
    shared_look(q, 1);
  }
  wake_workers(q);
  pthread_mutex_unlock(&q->lock);
}

queue *queue_create(const queue_options *options, catalogue *cat) {
  queue *q = calloc(1, sizeof *q);
  if (!q) {
    return NULL;
  }
  q->options = *options;
  q->cat = cat;
  pthread_mutex_init(&q->lock, NULL);
  pthread_cond_init(&q->work, NULL);
  pthread_cond_init(&q->guest_work, NULL);
  pthread_cond_init(&q->fetch_work, NULL);
  pthread_cond_init(&q->committed, NULL);
  wake_init(&q->timer_wake);
  q->claim.part = BUDGET_JOBS;
  if (options->memory) {
    budget_listen(options->memory, memory_freed, q);
  }
  q->timer_started = pthread_create(&q->timer, NULL, timer_main, q) == 0;
  if (!q->timer_started || (options->sharing && !shared_create(q, options->sharing))) {
    queue_destroy(q);
    return NULL;
  }
  return q;
}

void queue_on_end(queue *q, void (*ended)(void *user), void *user) {
  q->on_end = ended;
  q->on_end_user = user;
}

void queue_destroy(queue *q) {
  if (!q) {
    return;
  }
  if (q->timer_started) {
    pthread_mutex_lock(&q->lock);
    q->timer_stop = 1;
    pthread_cond_signal(&q->timer_wake);
    pthread_mutex_unlock(&q->lock);
    pthread_join(q->timer, NULL);
  }
  shared_stop(q); /* the timer asks whether jobs are shared */
  for (job *j = q->first, *next; j; j = next) {
    next = j->next;
    job_unref(j);
  }
  for (job *j = q->oldest_ended, *next; j; j = next) {
    next = j->newer_ended;
    job_unref(j);
  }
  free(q);
}

static int find_meshes(const queue *q, job *j) {
  char *text = catalogue_job_request(q->cat, j->row.id);
  j->meshes = text ? meshes_of(text) : NULL;
  free(text);
  return j->meshes != NULL;
}

/* Adds a job of the catalogue to the table, unless it is there. Takes ownership of the row. */
static store_result load(queue *q, job_row *row) {
  job *j = calloc(1, sizeof *j);
  if (!j) {
    job_row_free(row);
    return STORE_ERROR;
  }
  j->row = *row;
  j->alone_until = schedule_alone_until(q);
  j->ready = unix_ms();
  j->refs = 1;
  j->committed = 1;
  if (!q->shared && !find_meshes(q, j)) { /* else the catalogue is asked for them */
    job_unref(j);
    return STORE_ERROR;
  }
  /* New events continue after the numbers of the stored ones. */
  event_row events[BATCH];
  int64_t after = 0;
  for (int n = BATCH; n == BATCH;) {
    n = catalogue_events(q->cat, j->row.id, after, BATCH, events);
    if (n < 0) {
      job_unref(j);
      return STORE_ERROR;
    }
    for (int i = 0; i < n; i++) {
      after = events[i].number;
      keep_event(j, events[i].number, events[i].type, events[i].json);
      free(events[i].json);
    }
  }
  pthread_mutex_lock(&q->lock);
  if (table_with_id(q, j->row.id)) {
    job_unref(j);
  } else {
    table_add(q, j);
  }
  pthread_mutex_unlock(&q->lock);
  return STORE_OK;
}

job *queue_follow(queue *q, const char *id) {
  job_row row;
  job *j = queue_find(q, id);
  if (j || !q->shared || catalogue_job_get(q->cat, id, &row) != STORE_OK) {
    return j;
  }
  if (api_job_ended(row.state)) {
    job_row_free(&row);
    shared_refresh(q, id);
    return queue_find(q, id);
  }
  if (load(q, &row) != STORE_OK) {
    return NULL;
  }
  pthread_mutex_lock(&q->lock);
  j = table_with_id(q, id);
  if (j) {
    j->refs++;
  }
  pthread_mutex_unlock(&q->lock);
  shared_refresh(q, id); /* a notice may have come before the job was in the table */
  return j;
}

store_result queue_recover(queue *q, int isolated) {
  api_text text = {0};
  q->isolated = isolated;
  if (q->shared) {
    return shared_start(q);
  }
  crash_problem(&text);
  store_result result =
      text.failed ? STORE_ERROR : catalogue_recover(q->cat, isolated ? 0 : CRASHES_MOST, unix_ms(), text.data);
  api_text_free(&text);
  FAULT_POINT("recovered");
  int64_t after = 0;
  int loaded = 0;
  for (int n = BATCH; n == BATCH && result == STORE_OK;) {
    job_row rows[BATCH];
    n = catalogue_unfinished(q->cat, after, BATCH, rows);
    result = n < 0 ? STORE_ERROR : STORE_OK;
    for (int i = 0; i < n; i++) {
      after = rows[i].seq;
      if (result == STORE_OK) {
        result = load(q, &rows[i]);
        loaded++;
      } else {
        job_row_free(&rows[i]);
      }
    }
  }
  if (result != STORE_OK) { /* a job that is not loaded would not run before the next start */
    log_error("the unfinished jobs cannot be read");
    return result;
  }
  if (loaded) {
    log_info("%d unfinished jobs resumed", loaded);
  }
  return result;
}

void queue_stop(queue *q, int now) {
  pthread_mutex_lock(&q->lock);
  q->stopping = 1;
  q->stopping_now |= now;
  for (job *j = q->first; j && now; j = j->next) {
    if (j->ctx) {
      orb_context_cancel(j->ctx);
    }
  }
  wake_workers(q);
  pthread_mutex_unlock(&q->lock);
}

int queue_running(queue *q) {
  pthread_mutex_lock(&q->lock);
  int running = q->running;
  pthread_mutex_unlock(&q->lock);
  return running;
}

void queue_set_limit(queue *q, int limit) {
  pthread_mutex_lock(&q->lock);
  q->options.limit = limit;
  pthread_mutex_unlock(&q->lock);
}
