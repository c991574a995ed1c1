/* Submitting: a request becomes a job, or joins the owner's unfinished job with the same key. */
#include <stdlib.h>
#include <string.h>

#include "faults.h"
#include "queue/internal.h"
#include "queue/shared.h"
#include "store/deliveries.h"

/* Whether a job of this owner has room beside its unfinished ones. */
static int has_room(const queue *q, const queue_request *request) {
  for (const job *j = q->first; request->room && j; j = j->next) {
    if (strcmp(j->row.owner, request->owner) == 0) {
      *request->room -= j->row.request_bytes + (fetches(j) ? 0 : queue_bytes_of(j->row.cost));
    }
  }
  return !request->room || *request->room >= queue_needs_of(request);
}

/* The owner's unfinished job with the same key, with a reference; or NULL, and *mine is the number of the owner's
 * listed jobs. Skips cancelled jobs, also one that is cancelled while this waits for its commit. */
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
    while (!j->committed && !j->dead) { /* until then, the thread that commits the row reads it without the lock */
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
  if (request->is_disk_full) {
    return QUEUE_STORE_FULL;
  }
  if (request->listed && q->unfinished >= q->options.limit) {
    return QUEUE_FULL;
  }
  if (request->owner_limit > 0 && mine >= request->owner_limit) {
    return QUEUE_QUOTA;
  }
  if (!has_room(q, request)) {
    return QUEUE_ROOM;
  }
  j = job_create(q, request);
  if (!j) {
    return QUEUE_ERROR;
  }
  *out = j;
  *fresh = 1;
  return QUEUE_OK;
}

queue_result queue_submit(queue *q, const queue_request *request, job **out, int *fresh) {
  int is_fresh = 0, make_listed = 0;
  if (q->shared) {
    return shared_submit(q, request, out, fresh);
  }
  pthread_mutex_lock(&q->lock);
  queue_result result = submit_locked(q, request, out, &is_fresh);
  if (result == QUEUE_OK && !is_fresh && request->listed && !(*out)->row.listed) {
    make_listed = 1;
    (*out)->adopters++; /* keeps cancel_needless() away from it */
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
  if (!is_fresh && result == QUEUE_OK && request->hook) {
    store_result stored = catalogue_job_subscribe(q->cat, (*out)->row.id, request->hook);
    result = stored == STORE_OK         ? QUEUE_OK
             : stored == STORE_CONFLICT ? QUEUE_WEBHOOKS
             : stored == STORE_FULL     ? QUEUE_STORE_FULL
                                        : QUEUE_ERROR;
  }
  if (!is_fresh) {
    return result;
  }
  job *j = *out;
  FAULT_POINT("before-accept");
  job_row row = j->row;
  row.request = (char *)(uintptr_t)request->request;
  store_result stored = catalogue_job_insert(q->cat, &row, request->hook);
  FAULT_POINT("after-accept");
  pthread_mutex_lock(&q->lock);
  if (stored == STORE_OK) {
    j->row.seq = row.seq;
    j->committed = 1;
    wake_workers(q); /* only some of those that wait may take it */
  } else {
    j->dead = 1;
    j->row.state = API_JOB_FAILED;
    table_drop_key(q, j);
    j->committed = 0;
    table_ended(q, j);
    job_unref(j);
    *out = NULL;
    result = stored == STORE_FULL        ? QUEUE_STORE_FULL
             : stored == STORE_NOT_FOUND ? QUEUE_MESH_GONE
             : stored == STORE_CONFLICT  ? QUEUE_CRASHED
                                         : QUEUE_ERROR;
  }
  pthread_cond_broadcast(&q->committed);
  pthread_mutex_unlock(&q->lock);
  return result;
}
