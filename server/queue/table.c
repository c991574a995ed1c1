/* Jobs by id and by key, references, counts, and the ended jobs that stay in memory. */
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "hash.h"
#include "log.h"
#include "queue/internal.h"
#include "store/shared.h"

int64_t unix_ms(void) {
  struct timespec now;
  clock_gettime(CLOCK_REALTIME, &now);
  return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

/* A sphere has 52 bytes per vertex, 13 per triangle, and a head. Results of merges are of this order. */
enum { BYTES_OF_TRIANGLE = 39, BYTES_OF_HEAD = 512 };

int64_t queue_bytes_of(int64_t cost) {
  return BYTES_OF_HEAD + BYTES_OF_TRIANGLE * cost;
}

int64_t queue_needs_of(const queue_request *request) {
  return (int64_t)strlen(request->request) + (request->kind == API_JOB_FETCH ? 0 : queue_bytes_of(request->cost));
}

char *meshes_of(const char *request) {
  static const char member[] = "\"mesh\":\"";
  enum { MEMBER = sizeof member - 1, ID = API_ID_SIZE - 1 };
  size_t count = 0;
  for (const char *at = request; (at = strstr(at, member)); at += MEMBER) {
    count++;
  }
  char *ids = malloc(count * ID + 1), *to = ids;
  for (const char *at = request; ids && (at = strstr(at, member));) {
    at += MEMBER;
    const size_t length = strnlen(at, ID);
    memcpy(to, at, length);
    to += length;
  }
  if (ids) {
    *to = 0;
  }
  return ids;
}

static unsigned bucket(const char *hex) {
  return (unsigned)(keyed_hash(hex, strlen(hex)) % BUCKETS);
}

void table_add(queue *q, job *j) {
  unsigned at = bucket(j->row.id);
  j->next_id = q->by_id[at];
  q->by_id[at] = j;
  at = bucket(j->row.key);
  j->next_key = q->by_key[at];
  q->by_key[at] = j;
  j->previous = q->last;
  *(q->last ? &q->last->next : &q->first) = j;
  q->last = j;
  q->unfinished++;
  q->unfinished_fetches += fetches(j);
  owner_enter(q, j);
}

void table_drop_claim(queue *q) {
  if (q->claim.bytes > 0) {
    budget_claim_bytes(q->options.memory, &q->claim, 0);
    budget_tell(q->options.memory, q);
  }
}

void table_drop_key(queue *q, job *j) {
  for (job **at = &q->by_key[bucket(j->row.key)]; *at; at = &(*at)->next_key) {
    if (*at == j) {
      *at = j->next_key;
      break;
    }
  }
  *(j->previous ? &j->previous->next : &q->first) = j->next;
  *(j->next ? &j->next->previous : &q->last) = j->previous;
  q->unfinished--;
  q->unfinished_fetches -= fetches(j);
  owner_leave(q, j);
  if (q->claim.bytes > 0) { /* perhaps for this job */
    table_drop_claim(q);
    wake_workers(q);
  }
}

job *table_with_id(const queue *q, const char *id) {
  job *j = q->by_id[bucket(id)];
  while (j && strcmp(j->row.id, id) != 0) {
    j = j->next_id;
  }
  return j;
}

job *job_create(queue *q, const queue_request *request) {
  job *j = calloc(1, sizeof *j);
  char *meshes = meshes_of(request->request);
  if (!j || !meshes) {
    free(j);
    free(meshes);
    return NULL;
  }
  j->refs = 2; /* one of the table, one of the caller */
  j->meshes = meshes;
  j->row.request_bytes = (int64_t)strlen(request->request);
  j->row.kind = request->kind;
  j->row.cost = request->cost;
  j->row.priority = request->priority;
  j->row.listed = request->listed;
  j->row.created = j->ready = unix_ms();
  copy_text(j->row.trace, sizeof j->row.trace, request->trace ? request->trace : "");
  api_random_id(j->row.id);
  copy_text(j->row.key, sizeof j->row.key, request->key);
  copy_text(j->row.owner, sizeof j->row.owner, request->owner);
  copy_text(j->row.charged, sizeof j->row.charged, request->charged ? request->charged : "");
  table_add(q, j);
  return j;
}

static void drop_id(queue *q, job *j) {
  for (job **at = &q->by_id[bucket(j->row.id)]; *at; at = &(*at)->next_id) {
    if (*at == j) {
      *at = j->next_id;
      return;
    }
  }
}

void table_forget(queue *q, job *j) {
  table_drop_key(q, j);
  drop_id(q, j);
  job_unref(j);
}

/* The table's reference moves to the list of ended jobs. */
void table_ended(queue *q, job *j) {
  *(q->newest_ended ? &q->newest_ended->newer_ended : &q->oldest_ended) = j;
  q->newest_ended = j;
  j->newer_ended = NULL;
  if (++q->ended_count > KEEP_ENDED || j->dead) {
    job *old = q->oldest_ended;
    q->oldest_ended = old->newer_ended;
    if (!q->oldest_ended) {
      q->newest_ended = NULL;
    }
    q->ended_count--;
    drop_id(q, old);
    job_unref(old);
  }
}

void job_unref(job *j) {
  if (--j->refs > 0) {
    return;
  }
  for (int i = 0; i < j->event_count; i++) {
    free(j->events[i].json);
  }
  free(j->dependency_problem);
  free(j->meshes);
  job_row_free(&j->row);
  free(j);
}

job *queue_find(queue *q, const char *id) {
  pthread_mutex_lock(&q->lock);
  job *j = table_with_id(q, id);
  if (j && (!j->committed || (q->shared && !j->taken && !api_job_ended(j->row.state)))) {
    j = NULL;
  }
  if (j) {
    j->refs++;
  }
  pthread_mutex_unlock(&q->lock);
  return j;
}

job *table_find(queue *q, const char *key, const char *owner) {
  job *j = q->by_key[bucket(key)];
  while (j && (strcmp(j->row.key, key) != 0 || strcmp(j->row.owner, owner) != 0)) {
    j = j->next_key;
  }
  return j;
}

int table_key_taken(const queue *q, const job *by_other) {
  const job *j = q->by_key[bucket(by_other->row.key)];
  while (j && (j == by_other || !j->taken || strcmp(j->row.key, by_other->row.key) != 0)) {
    j = j->next_key;
  }
  return j != NULL;
}

void queue_release(queue *q, job *j) {
  if (j) {
    pthread_mutex_lock(&q->lock);
    job_unref(j);
    pthread_mutex_unlock(&q->lock);
  }
}

const char *job_id(const job *j) {
  return j->row.id;
}
const char *job_key(const job *j) {
  return j->row.key;
}
api_job_kind job_kind(const job *j) {
  return j->row.kind;
}
const char *job_trace(const job *j) {
  return j->row.trace;
}
const char *job_charged(const job *j) {
  return j->row.charged;
}
const char *job_owner(const job *j) {
  return j->row.owner;
}
const char *job_result(const job *j) {
  return j->row.result[0] ? j->row.result : j->row.key;
}
const char *job_request(const job *j) {
  return j->row.request;
}

void job_view(const job *j, api_job_view *view) {
  *view = (api_job_view){.id = j->row.id,
                         .result = j->row.result[0] ? j->row.result : j->row.key,
                         .stage = j->stage,
                         .problem = j->row.problem,
                         .kind = j->row.kind,
                         .state = j->row.state,
                         .progress = j->progress,
                         .seconds_left = j->seconds_left,
                         .attempt = j->row.attempt,
                         .created = j->row.created,
                         .started = j->row.started,
                         .finished = j->row.finished};
}

api_job_state queue_job_write(queue *q, job *j, api_text *out) {
  api_job_view view;
  pthread_mutex_lock(&q->lock);
  job_view(j, &view);
  api_job_write(&view, out);
  api_job_state state = j->row.state;
  pthread_mutex_unlock(&q->lock);
  return state;
}

int queue_needs_mesh(queue *q, const char *mesh, const char *owner) {
  int needed = 0;
  if (q->shared) {
    return catalogue_needs_mesh(q->cat, mesh, owner);
  }
  pthread_mutex_lock(&q->lock);
  for (job *j = q->first; j && !needed; j = j->next) {
    needed = (!owner || strcmp(j->row.owner, owner) == 0) && j->meshes && strstr(j->meshes, mesh) != NULL;
  }
  pthread_mutex_unlock(&q->lock);
  return needed;
}

int64_t queue_ended(queue *q, api_job_state state) {
  pthread_mutex_lock(&q->lock);
  int64_t ended = q->ended[state];
  pthread_mutex_unlock(&q->lock);
  return ended;
}

char *queue_failure(queue *q, const char *key, const char *owner, int64_t since) {
  const job *newest = NULL;
  if (q->shared) {
    return catalogue_failure(q->cat, key, owner, since);
  }
  pthread_mutex_lock(&q->lock);
  for (const job *j = q->oldest_ended; j; j = j->newer_ended) {
    if (is_for(j, key, owner) && j->row.finished > since) {
      newest = j;
    }
  }
  char *problem =
      newest && newest->row.state == API_JOB_FAILED && newest->row.problem ? strdup(newest->row.problem) : NULL;
  pthread_mutex_unlock(&q->lock);
  return problem;
}

char *queue_job_problem(queue *q, job *j) {
  pthread_mutex_lock(&q->lock);
  char *problem = j->row.state == API_JOB_FAILED && j->row.problem ? strdup(j->row.problem) : NULL;
  pthread_mutex_unlock(&q->lock);
  return problem;
}
