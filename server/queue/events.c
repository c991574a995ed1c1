/* Events and progress of jobs, the connections that wait for them, and the timer: it wakes waiters at their deadline
 * and workers when a retry may be due. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "queue/internal.h"
#include "wake.h"

enum { SHARED_EVENT_MS = 1000 };        /* for requests on other nodes that watch a job */
enum { TIMER_MS = 100, MOVE_MS = 300 }; /* how often waiters, and the progress of silent stages, are looked at */
#define DEPENDENCIES_SHARE 0.25         /* of the progress of a supermesh whose embeddings are made first */

static void unlist(queue *q, waiter *w) {
  *(w->previous ? &w->previous->next : &w->of->waiters) = w->next;
  if (w->next) {
    w->next->previous = w->previous;
  }
  *(w->all_previous ? &w->all_previous->all_next : &q->waiters) = w->all_next;
  if (w->all_next) {
    w->all_next->all_previous = w->all_previous;
  }
  w->of = NULL;
  q->waiter_count--;
}

static void wake(queue *q, waiter *w) {
  unlist(q, w);
  w->wake(w);
}

void wake_job(queue *q, job *j, int ended) {
  for (waiter *w = j->waiters, *next; w; w = next) {
    next = w->next;
    if (ended || w->events) {
      wake(q, w);
    }
  }
}

void queue_wake_all(queue *q) {
  pthread_mutex_lock(&q->lock);
  q->waking = 1;
  while (q->waiters) {
    wake(q, q->waiters);
  }
  pthread_mutex_unlock(&q->lock);
}

void queue_wake_once(queue *q) {
  pthread_mutex_lock(&q->lock);
  for (waiter *w = q->waiters, *next; w; w = next) {
    next = w->all_next;
    wake(q, w);
  }
  pthread_mutex_unlock(&q->lock);
}

int queue_wait(queue *q, job *j, waiter *w, int64_t after, void (*suspend)(waiter *)) {
  pthread_mutex_lock(&q->lock);
  int ready = api_job_ended(j->row.state) || q->waking || (w->events && j->last_event > after);
  if (!ready) {
    suspend(w);
    w->of = j;
    w->previous = NULL;
    w->next = j->waiters;
    if (w->next) {
      w->next->previous = w;
    }
    j->waiters = w;
    w->all_previous = NULL;
    w->all_next = q->waiters;
    if (w->all_next) {
      w->all_next->all_previous = w;
    }
    q->waiters = w;
    q->waiter_count++;
  }
  pthread_mutex_unlock(&q->lock);
  return !ready;
}

int64_t prepare_event(job *j, api_text *json) {
  api_job_view view;
  job_view(j, &view);
  api_job_write(&view, json);
  int64_t least = (int64_t)j->row.attempt * EVENT_STRIDE;
  return (j->last_event > least ? j->last_event : least) + 1;
}

void keep_event(job *j, int64_t number, const char *type, const char *json) {
  char *copy = strdup(json);
  j->last_event = number; /* the number is used even if there is no memory for the event */
  if (!copy) {
    return;
  }
  if (j->event_count == EVENTS_KEPT) {
    free(j->events[0].json);
    memmove(j->events, j->events + 1, (EVENTS_KEPT - 1) * sizeof *j->events);
    j->event_count--;
  }
  job_event *event = &j->events[j->event_count++];
  event->number = number;
  event->json = copy;
  copy_text(event->type, sizeof event->type, type);
  event->type[sizeof event->type - 1] = 0;
}

/* Until it reports again, what is left becomes less. A job that has been silent for long is likely to stay silent for
 * half as long again. */
static void show_left(job *j) {
  const int64_t now = orb_clock_ms(), left = j->ends_ms - now, silent = (now - j->reported_ms) / 2;
  const int64_t most = left > silent ? left : silent;
  j->seconds_left = j->ends_ms == 0 ? 0 : most < 1000 ? 1 : (most + 999) / 1000;
}

/* Adds an event with the job's current state; `store` also writes it to the catalogue. Not for the final event, which
 * catalogue_job_finish() writes. */
static void add_event(queue *q, job *j, const char *type, int store) {
  api_text json = {0};
  show_left(j);
  int64_t number = prepare_event(j, &json);
  if (!json.failed) {
    keep_event(j, number, type, json.data);
    if (store || (q->shared && orb_clock_ms() - j->stored_event_ms >= SHARED_EVENT_MS)) {
      j->stored_event_ms = orb_clock_ms();
      catalogue_event(q->cat, j->row.id, number, type, json.data);
    }
  }
  j->last_event_ms = orb_clock_ms();
  api_text_free(&json);
  wake_job(q, j, 0);
}

void event_write(api_text *out, int64_t number, const char *type, const char *json) {
  api_text_printf(out, "id: %lld\nevent: %s\ndata: ", (long long)number, type);
  api_text_add(out, json);
  api_text_add(out, "\n\n");
}

int64_t queue_events_write(queue *q, job *j, int64_t after, api_text *out, int *ended) {
  pthread_mutex_lock(&q->lock);
  *ended = api_job_ended(j->row.state);
  /* An attempt that another node gave back had sent more events than it stored, and their numbers were used again. */
  after = *ended && after > j->last_event ? j->last_event - 1 : after;
  for (int i = 0; i < j->event_count; i++) {
    if (j->events[i].number > after) {
      event_write(out, j->events[i].number, j->events[i].type, j->events[i].json);
      after = j->events[i].number;
    }
  }
  after = j->last_event > after ? j->last_event : after; /* an event may be missing for lack of memory */
  pthread_mutex_unlock(&q->lock);
  return after;
}

int64_t queue_events_after(queue *q, job *j, int64_t seen, int *over) {
  pthread_mutex_lock(&q->lock);
  *over = api_job_ended(j->row.state) && seen == j->last_event;
  /* Another node may have sent more events of this attempt than it stored. */
  int elsewhere = q->shared && !j->taken && !api_job_ended(j->row.state);
  int64_t known = elsewhere ? (j->row.attempt + 1) * EVENT_STRIDE : j->last_event;
  int64_t after = seen > j->last_event && seen > known ? 0 : seen;
  pthread_mutex_unlock(&q->lock);
  return after;
}

/* Shows more progress, which never decreases. */
static void advance(job *j, double shown) {
  j->progress = shown > j->progress ? shown : j->progress;
}

/* Shows progress that the job has made, and estimates its end: the rest takes as long for its size as what this attempt
 * has made. The size of a file that is fetched is not known. */
static void report(job *j, double made) {
  static const double LEAST = 0.05; /* progress from which the time can be told; less would make it jump */
  enum { LEAST_MS = 1000 };
  const int64_t now = orb_clock_ms();
  advance(j, made);
  if (j->began_ms == 0) {
    j->began_ms = now;
    j->began_at = j->reported = made;
  }
  j->reported = made > j->reported ? made : j->reported;
  j->reported_ms = now;
  const double done = j->reported - j->began_at, ms = (double)(now - j->began_ms);
  if (done >= LEAST && ms >= LEAST_MS && !fetches(j)) {
    j->ends_ms = now + (int64_t)(ms * (1 - j->reported) / done);
  }
}

/* A job that waits shows the progress of the jobs that it needs as the first share of its own. */
static void show_to_dependents(queue *q, const job *of, const char *stage, double fraction, int is_guess) {
  for (job *j = q->first; j; j = j->next) {
    for (int d = 0; j->waits_for && d < j->dependency_count; d++) {
      if (is_for(of, j->dependencies[d], j->row.owner)) {
        j->row.state = API_JOB_RUNNING;
        if (!j->row.started) {
          j->row.started = unix_ms();
        }
        double base = (double)(j->dependency_count - j->waits_for);
        double shown = DEPENDENCIES_SHARE * (base + fraction) / (double)j->dependency_count;
        int stage_changed = strcmp(j->stage, stage) != 0;
        if (is_guess) {
          advance(j, shown);
        } else {
          report(j, shown);
        }
        copy_text(j->stage, sizeof j->stage, stage);
        if (stage_changed || orb_clock_ms() - j->last_event_ms >= 250) {
          add_event(q, j, "progress", stage_changed);
        }
      }
    }
  }
}

/* The part of a job's progress that a stage covers. Alignment is by far the longest stage of a supermesh. */
typedef struct stage_span {
  api_job_kind kind;
  const char *stage;
  double from, to;
} stage_span;

static const stage_span *span_of(const job *j, const char *stage) {
  static const stage_span spans[] = {
      {API_JOB_EMBEDDING, "read", 0, 0.05},
      {API_JOB_EMBEDDING, "check", 0.05, 0.1},
      {API_JOB_EMBEDDING, "simplify", 0.1, 0.3},
      {API_JOB_EMBEDDING, "embed", 0.3, 0.9},
      {API_JOB_EMBEDDING, "certify", 0.9, 0.97},
      {API_JOB_EMBEDDING, "store", 0.97, 1},
      {API_JOB_SUPERMESH, "read", DEPENDENCIES_SHARE, 0.27},
      {API_JOB_SUPERMESH, "align", 0.27, 0.85},
      {API_JOB_SUPERMESH, "remesh", 0.85, 0.93},
      {API_JOB_SUPERMESH, "transfer", 0.93, 0.96},
      {API_JOB_SUPERMESH, "write", 0.96, 0.98},
      {API_JOB_SUPERMESH, "store", 0.98, 1},
      {API_JOB_FETCH, "download", 0, 0.7},
      {API_JOB_FETCH, "check", 0.7, 1},
  };
  for (size_t i = 0; i < sizeof spans / sizeof spans[0]; i++) {
    if (spans[i].kind == j->row.kind && strcmp(spans[i].stage, stage) == 0) {
      return &spans[i];
    }
  }
  return NULL;
}

/* Core reports a stage at points that may lie minutes apart. In between, progress approaches the end of the stage, the
 * more slowly the larger the job, and never reaches it. */
static void move_on(queue *q, job *j, int64_t now) {
  enum { SILENCE_MS = 600 };
  const stage_span *span = j->running ? span_of(j, j->stage) : NULL;
  const double seconds = 1e-3 * (double)(now - j->last_event_ms);
  if (!span || span->kind == API_JOB_FETCH || j->progress >= span->to || seconds < 1e-3 * SILENCE_MS) {
    return;
  }
  const double expected = 2 + 1e-3 * (double)j->row.cost; /* seconds, by triangles */
  advance(j, j->progress + (span->to - j->progress) * seconds / (seconds + expected));
  add_event(q, j, "progress", 0);
  if (j->row.kind == API_JOB_EMBEDDING) {
    show_to_dependents(q, j, j->stage, j->progress, 1);
  }
}

void *timer_main(void *argument) {
  queue *q = argument;
  int64_t moved = 0;
  pthread_mutex_lock(&q->lock);
  while (!q->timer_stop) {
    wake_wait_ms(&q->timer_wake, &q->lock, TIMER_MS);
    int64_t now = orb_clock_ms();
    for (waiter *w = q->waiters, *next; w; w = next) {
      next = w->all_next;
      if (w->deadline <= now) {
        wake(q, w);
      }
    }
    for (job *j = now - moved >= MOVE_MS ? q->first : NULL; j; j = j->next) {
      moved = now;
      move_on(q, j, now);
    }
    wake_workers(q); /* the retry_at of a job may have passed */
  }
  pthread_mutex_unlock(&q->lock);
  return NULL;
}

void queue_progress(queue *q, job *j, const char *stage, double fraction) {
  pthread_mutex_lock(&q->lock);
  const stage_span *span = span_of(j, stage);
  double shown = span ? span->from + fraction * (span->to - span->from) : 0;
  int stage_changed = strncmp(j->stage, stage, sizeof j->stage - 1) != 0;
  report(j, shown);
  copy_text(j->stage, sizeof j->stage, stage);
  if (stage_changed || orb_clock_ms() - j->last_event_ms >= 250) {
    add_event(q, j, "progress", stage_changed);
    if (j->row.kind == API_JOB_EMBEDDING) {
      show_to_dependents(q, j, j->stage, j->progress, 0);
    }
  }
  pthread_mutex_unlock(&q->lock);
}
