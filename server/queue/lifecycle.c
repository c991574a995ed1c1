/* Start, recovery after a crash, stop. */
#include <stdlib.h>
#include <string.h>

#include "api/problem.h"
#include "faults.h"
#include "log.h"
#include "queue/internal.h"
#include "wake.h"

enum { BATCH = 64 };

static void memory_freed(void *user) {
  queue *q = user;
  pthread_mutex_lock(&q->lock);
  pthread_cond_broadcast(&q->work);
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
  pthread_cond_init(&q->committed, NULL);
  wake_init(&q->timer_wake);
  if (options->memory) {
    budget_listen(options->memory, memory_freed, q);
  }
  q->timer_started = pthread_create(&q->timer, NULL, timer_main, q) == 0;
  if (!q->timer_started) {
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

/* Adds a job of the catalogue to the table. Takes ownership of the row. */
static store_result load(queue *q, job_row *row) {
  job *j = calloc(1, sizeof *j);
  if (!j) {
    job_row_free(row);
    return STORE_ERROR;
  }
  j->row = *row;
  j->refs = 1;
  j->committed = 1;
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
  table_add(q, j);
  pthread_mutex_unlock(&q->lock);
  return STORE_OK;
}

store_result queue_recover(queue *q, int isolated) {
  api_problem problem = {0};
  api_text text = {0};
  api_refuse(
      &problem, "crashed",
      "The daemon crashed %d times while this job ran alone; the job is not retried. Please report this as a bug, "
      "with its meshes.",
      MOST_CRASHES);
  api_problem_write(&problem, &text);
  store_result result =
      text.failed ? STORE_ERROR : catalogue_recover(q->cat, isolated ? 0 : MOST_CRASHES, unix_ms(), text.data);
  api_text_free(&text);
  api_problem_free(&problem);
  FAULT_POINT("recovered");
  q->isolated = isolated;
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
  for (job *j = q->first; j && now; j = j->next) {
    if (j->ctx) {
      orb_context_cancel(j->ctx);
    }
  }
  pthread_cond_broadcast(&q->work);
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
