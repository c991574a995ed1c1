/* Jobs in memory that run on other nodes, and what other nodes did to those that run here. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/json.h"
#include "log.h"
#include "queue/internal.h"
#include "queue/shared.h"

enum { PAGE = 64, MARKS = 50 };

/* Takes stage and progress from the newest event. */
static void show_event(job *j, const char *json) {
  api_json_error error;
  cJSON *event = api_json_parse(json, strlen(json), &error);
  const cJSON *stage = cJSON_GetObjectItemCaseSensitive(event, "stage");
  const cJSON *progress = cJSON_GetObjectItemCaseSensitive(event, "progress");
  const cJSON *left = cJSON_GetObjectItemCaseSensitive(event, "seconds_left");
  if (cJSON_IsNumber(progress)) {
    j->progress = progress->valuedouble;
  }
  j->seconds_left = cJSON_IsNumber(left) && left->valuedouble < 1e9 ? (int64_t)left->valuedouble : 0;
  copy_text(j->stage, sizeof j->stage, cJSON_IsString(stage) ? stage->valuestring : "");
  cJSON_Delete(event);
}

/* Brings a job up to date with its row. The job does not run here and has not ended in memory. */
static void take_row(queue *q, job *j, job_row *row) {
  j->row.state = row->state;
  j->row.attempt = row->attempt;
  j->row.crashes = row->crashes;
  j->row.suspect = row->suspect;
  j->row.listed = row->listed;
  j->row.priority = row->priority;
  j->row.started = row->started;
  if (!api_job_ended(row->state)) {
    return;
  }
  memcpy(j->row.result, row->result, sizeof j->row.result);
  j->row.finished = row->finished;
  free(j->row.problem);
  j->row.problem = row->problem;
  row->problem = NULL;
  j->progress = row->state == API_JOB_SUCCEEDED ? 1 : j->progress;
  table_drop_key(q, j);
  wake_job(q, j, 1);
  table_ended(q, j);
}

/* Adds the events that are stored and not in memory; returns their number, −1 if they cannot be read. */
static int take_events(queue *q, job *j, int64_t after) {
  event_row events[PAGE];
  int taken = 0, n = PAGE;
  while (n == PAGE) {
    n = catalogue_events(q->cat, j->row.id, after, PAGE, events);
    pthread_mutex_lock(&q->lock);
    for (int i = 0; i < n; i++) {
      after = events[i].number;
      if (!j->taken && events[i].number > j->last_event) {
        keep_event(j, events[i].number, events[i].type, events[i].json);
        show_event(j, events[i].json);
        taken++;
      }
      free(events[i].json);
    }
    pthread_mutex_unlock(&q->lock);
  }
  return n < 0 ? -1 : taken;
}

static int is_elsewhere(const job *j) {
  return j && !j->taken && !j->dead && !api_job_ended(j->row.state);
}

void shared_refresh(queue *q, const char *id) {
  job_row row;
  pthread_mutex_lock(&q->lock);
  job *j = table_with_id(q, id);
  int64_t after = j ? j->last_event : 0;
  j = is_elsewhere(j) ? j : NULL;
  if (j) {
    j->refs++;
  }
  pthread_mutex_unlock(&q->lock);
  if (!j) {
    return;
  }
  store_result found = catalogue_job_get(q->cat, id, &row); /* before the events: an end has its event */
  int events = found == STORE_OK ? take_events(q, j, after) : 0;
  pthread_mutex_lock(&q->lock);
  if (found == STORE_NOT_FOUND && j->committed && is_elsewhere(j)) { /* forgotten: it ended long ago */
    row = (job_row){.state = API_JOB_CANCELLED, .attempt = j->row.attempt};
    take_row(q, j, &row);
  } else if (found == STORE_OK && events >= 0 && is_elsewhere(j)) {
    take_row(q, j, &row);
    if (events > 0 && !api_job_ended(j->row.state)) {
      wake_job(q, j, 0);
    }
  }
  job_unref(j);
  pthread_mutex_unlock(&q->lock);
  if (found == STORE_OK) {
    job_row_free(&row);
  }
}

static void interrupt(job *j, int cancel) {
  j->cancel |= cancel;
  if (j->ctx) {
    orb_context_cancel(j->ctx);
  }
}

void shared_cancelled(queue *q, const char *id) {
  pthread_mutex_lock(&q->lock);
  job *j = table_with_id(q, id);
  if (j) {
    interrupt(j, 1); /* one that does not run here may be claimed at this moment */
  }
  pthread_mutex_unlock(&q->lock);
}

/* A job whose row this node compares. */
typedef struct compared {
  char id[API_JOB_ID_SIZE];
  int attempt, here;
} compared;

/* Whether the job must be read again. */
static int compare(queue *q, const compared *was, const job_mark *mark) {
  int differs = 0;
  pthread_mutex_lock(&q->lock);
  job *j = table_with_id(q, was->id);
  if (j && was->here && j->taken && j->running && j->row.attempt == was->attempt) {
    int lost = mark->queued || api_job_ended((api_job_state)mark->state) || mark->attempt != was->attempt;
    if (lost && j->ctx) {
      log_warn("job %s, attempt %d: this node was silent beyond its lease and has lost it", was->id, was->attempt);
    }
    if (lost || mark->cancel) {
      interrupt(j, mark->cancel && !lost);
    }
  } else if (j && !was->here) {
    differs = (int)j->row.state != mark->state || j->row.attempt != mark->attempt || j->last_event < mark->last_event;
  }
  pthread_mutex_unlock(&q->lock);
  return differs;
}

static void compare_page(queue *q, const compared *page, int count) {
  char ids[MARKS * API_JOB_ID_SIZE + 1] = "";
  job_mark marks[MARKS];
  size_t at = 0;
  for (int i = 0; i < count; i++) {
    at += (size_t)snprintf(ids + at, sizeof ids - at, "%s%s", i ? "," : "", page[i].id);
  }
  int n = catalogue_job_marks(q->cat, ids, MARKS, marks);
  for (int i = 0; i < count && n >= 0; i++) {
    int k = 0;
    while (k < n && strcmp(marks[k].id, page[i].id) != 0) {
      k++;
    }
    if (k == n || compare(q, &page[i], &marks[k])) {
      shared_refresh(q, page[i].id);
    }
  }
}

void shared_refresh_all(queue *q) {
  int room = 0, count = 0;
  pthread_mutex_lock(&q->lock);
  compared *all = calloc((size_t)q->unfinished + 1, sizeof *all);
  room = all ? q->unfinished : 0;
  for (job *j = q->first, *next; j; j = next) {
    next = j->next;
    if (!j->taken && j->refs == 1 && j->committed) {
      table_forget(q, j);
    } else if (j->committed && count < room) {
      compared *one = &all[count++];
      memcpy(one->id, j->row.id, sizeof one->id);
      one->attempt = j->row.attempt;
      one->here = j->taken;
    }
  }
  pthread_mutex_unlock(&q->lock);
  for (int i = 0; i < count; i += MARKS) {
    compare_page(q, all + i, count - i < MARKS ? count - i : MARKS);
  }
  free(all);
}
