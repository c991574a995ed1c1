/* The queue: every unfinished job in memory, who waits for it, and which is to run next.
 *
 * Contract. One lock guards all of it; it is held for short steps only, never over input or output. The catalogue is
 * the truth: a job is taken, shown as accepted, or shown as ended only after the row was committed, so what a caller
 * was told survives the process. A key (the id of the result) has at most one unfinished job for each owner: a second
 * request of the owner gets the first one's job, and those of different owners run one after another, so that the work
 * is done once and nobody can tell, or cancel, the other's. Ended jobs stay in memory for a while, least recently ended
 * leave first.
 *
 * Waiters are suspended connections. They are listed and woken under the lock; `wake` must not call back into the
 * queue. Every waiter is woken by its deadline at the latest.
 *
 * Fairness. Among runnable jobs the highest class goes first, then the owner who has had the least work so far (one
 * who comes back after a pause starts level with those who are there), then that owner's most urgent, then the oldest.
 * Large jobs never take all workers: one stays for small ones. A suspect (it was running when the process died) runs
 * with nothing beside it.
 */
#ifndef ORB_QUEUE_H
#define ORB_QUEUE_H

#include "orbmorph/context.h"
#include "store/catalogue.h"

/* A priority is QUEUE_URGENCIES · class + urgency: classes (of tokens) go before everything, urgencies order the jobs
 * of one owner. */
enum { QUEUE_URGENCIES = 8 };

typedef struct queue queue;
typedef struct job job;

typedef struct waiter {
  struct waiter *previous, *next;         /* of the job */
  struct waiter *all_previous, *all_next; /* of the queue */
  job *of;                                /* NULL: not listed */
  int64_t deadline;                       /* orb_clock_ms() */
  int events;                             /* wake at each event, not only at the end */
  void (*wake)(struct waiter *self);
} waiter;

typedef struct queue_options {
  int workers, cores, limit;
  int64_t memory; /* bytes that running jobs may need together, by estimate */
} queue_options;

queue *queue_create(const queue_options *options, catalogue *cat);
void queue_destroy(queue *q);
void queue_set_limit(queue *q, int limit);
/* Loads what is unfinished. */
store_result queue_recover(queue *q);
/* No more jobs are taken; wakes the workers. With `now`, running ones are cancelled to be queued again. */
void queue_stop(queue *q, int now);
int queue_running(queue *q);
/* Wakes every waiter, at once and from now on. */
void queue_wake_all(queue *q);
/* Wakes every waiter to look again. */
void queue_wake_once(queue *q);

/* Submitting. Blocks for the commit. owner and request are copied. */
typedef struct queue_request {
  api_job_kind kind;
  const char *key, *request, *owner;
  int64_t cost;
  int priority, listed;
  int64_t owner_limit; /* of the owner's unfinished jobs that are listed; 0: none */
} queue_request;
typedef enum queue_result {
  QUEUE_OK,
  QUEUE_FULL,
  QUEUE_QUOTA,
  QUEUE_STOPPING,
  QUEUE_STORE_FULL,
  QUEUE_MESH_GONE, /* one that the request names was deleted meanwhile */
  QUEUE_ERROR
} queue_result;
/* *out is referenced. *fresh (may be NULL): 0 where the job was there. */
queue_result queue_submit(queue *q, const queue_request *request, job **out, int *fresh);

/* References. */
job *queue_find(queue *q, const char *id); /* NULL: not in memory */
void queue_release(queue *q, job *j);

const char *job_id(const job *j);
const char *job_key(const job *j);
api_job_kind job_kind(const job *j);
const char *job_request(const job *j);
const char *job_owner(const job *j); /* the tenant that asked; "" where no token was needed */
/* Appends the job as JSON; returns its state. */
api_job_state queue_job_write(queue *q, job *j, api_text *out);

/* 1 if the connection is to wait: `suspend` was called under the lock and the waiter is listed. 0 if the job has
 * ended already (or has an event after `after` where events are wanted). */
int queue_wait(queue *q, job *j, waiter *w, int64_t after, void (*suspend)(waiter *));
/* Appends events after number `after` as an event stream; returns the last number; *ended when the last was final. */
int64_t queue_events_write(queue *q, job *j, int64_t after, api_text *out, int *ended);
/* Where to go on for who has seen events up to number `seen`: one that is beyond the last of this job was of none that
 * is known here, and he gets all. *over: the job has ended, and he has seen its end. */
int64_t queue_events_after(queue *q, job *j, int64_t seen, int *over);
void event_write(api_text *out, int64_t number, const char *type, const char *json);

/* Asks a job to end. Blocks for the commit where it was not running. */
store_result queue_cancel(queue *q, job *j);
/* True if an unfinished job names the mesh; one of `owner`, where that is not NULL. */
int queue_needs_mesh(queue *q, const char *mesh, const char *owner);

/* For the workers. */
/* Waits for a job; 0 when the queue stops. small_only: for the lane that large jobs cannot block. */
int queue_take(queue *q, int small_only, job **out, int *threads);
/* Makes a taken job wait until the jobs of these keys have ended. */
queue_result queue_wait_for(queue *q, job *j, char (*keys)[API_ID_SIZE], const char *const *requests,
                            const int64_t *costs, int count);
/* Why a job that it waited for failed, in malloc() memory; NULL if none did. */
char *queue_dependency_problem(queue *q, job *j);
store_result queue_claim(queue *q, job *j);
void queue_set_context(queue *q, job *j, orb_context *ctx);
int queue_cancel_wanted(queue *q, job *j);
void queue_progress(queue *q, job *j, const char *stage, double fraction);
void queue_add_embed_ms(queue *q, job *j, double ms);
double queue_embed_ms(queue *q, job *j);
/* Ends a taken job with its result, or problem. On a store that fails the job is queued again after a while. */
void queue_finish(queue *q, job *j, api_job_state state, const char *problem, const resource *result);
/* Gives a taken job back to be taken a second later, because the store did not answer. */
void queue_put_off(queue *q, job *j);
/* Gives a taken job back. */
void queue_give_back(queue *q, job *j);

/* Numbers for /metrics. */
typedef struct queue_numbers {
  int queued, waiting, running, waiters;
  struct {
    char name[24];
    int jobs;
  } stages[16]; /* of the running; the rest is empty */
  int64_t oldest_ms;
  int64_t ended[API_JOB_CANCELLED + 1]; /* by state, since the start */
} queue_numbers;
void queue_count(queue *q, queue_numbers *out); /* walks all unfinished jobs */
/* Jobs that ended since the start, in this state. */
int64_t queue_ended(queue *q, api_job_state state);

#endif
