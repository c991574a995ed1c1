/* The queue: all unfinished jobs in memory, the connections that wait for them, and the choice of the next job to run.
 * Where several nodes share the jobs, the catalogue has them, and makes the choice by the same rules (shared.h). In:
 * requests from server/http. Out: jobs for server/worker, events and ended jobs for waiting connections.
 *
 * Reading order:
 *   internal.h      the structs
 *   submit.c        a request becomes a job, or joins the unfinished job with the same key
 *   take.c, schedule.c   taking, choosing and claiming a job       owners.c   fairness between owners
 *   dependencies.c  a supermesh waits for its embeddings
 *   finish.c        the end of a job, cancelling, retry
 *   events.c        events, progress, waiters, the timer
 *   table.c         lookup by id and key, references         numbers.c  counts
 *   shared.h        the same among several nodes: sharing.c, claims.c, watched.c
 *   lifecycle.c     start, recovery after a crash, stop
 *
 * The retry of a job. A job that fails is not retried. The queue runs a job again in two cases. After the store fails,
 * queue_finish(), queue_give_back() and queue_put_off() in finish.c and queue_wait_for() in dependencies.c set
 * retry_at, before which schedule.c does not choose the job. After the job's process dies, queue_crashed() in finish.c
 * counts the death and queues the job again, until it has died CRASHES_MOST times. With isolate = off the daemon dies,
 * too: then queue_recover() in lifecycle.c queues what was running, and catalogue_recover() in store/recover.c counts.
 * With several nodes (shared.h), the others do that for a node whose lease expired: catalogue_recover_lost() in
 * store/recover.c; a lost node counts from the job's 20th attempt on. New requests for work whose processes died
 * CRASHES_MOST times are refused (store/crashes.h).
 *
 * Memory. The text of a request may be large, so only the catalogue has it: a worker reads it when it takes the job,
 * and drops it with the job. For the whole queue, memory has what queue_needs_mesh() asks for, the ids of its meshes.
 *
 * Contract. One lock guards all of it; it is held for short steps only, never during input or output. The catalogue is
 * authoritative: the queue shows a job as accepted, running or ended only after its row was committed, so everything a
 * caller has seen survives a crash. A key (the id of the result) has at most one unfinished job for each owner. A
 * second request of the same owner gets the first one's job. Jobs of different owners with the same key run one after
 * another: the work is done once, and no owner can see or cancel another's job. Up to KEEP_ENDED ended jobs stay in
 * memory; the one that ended first leaves first.
 *
 * Waiters are suspended connections. They are listed and woken under the lock; `wake` must not call into the queue.
 * Every waiter is woken at its deadline at the latest.
 *
 * Fairness. Among runnable jobs the highest class goes first, then owners that run fewer jobs than their share of the
 * workers, then the owner with the least worker time so far (an owner that returns after a pause starts level with the
 * least served of the others), then that owner's most urgent job, then the oldest. A running job is charged the time
 * that it has taken, or an estimate where that is more; when it leaves its worker, the measured time replaces both.
 * Guests: if all workers are busy or their memory is in use, a small job of an owner that runs nothing runs beside
 * them, on one thread. At most QUEUE_GUESTS_MAX guests run at once, within the memory of checks (budget.h). Large jobs
 * never occupy all workers: one stays free for small jobs. A suspect (a job that may be why a process died) runs
 * alone. Where jobs have processes of their own, guests of other owners run beside it, and do not wait for it; all
 * others wait no longer than SUSPECT_MS until it can begin, and again until it ends. Then it is like any other job.
 */
#ifndef ORB_QUEUE_H
#define ORB_QUEUE_H

#include "budget.h"
#include "orbmorph/context.h"
#include "store/catalogue.h"
#include "store/crashes.h"

/* A priority is QUEUE_URGENCIES · class + urgency. Classes come from tokens and order all jobs; urgencies order the
 * jobs of one owner. */
enum { QUEUE_URGENCIES = 8 };

typedef struct queue queue;
typedef struct job job;

typedef struct waiter {
  struct waiter *previous, *next;         /* in the job's list */
  struct waiter *all_previous, *all_next; /* in the queue's list */
  job *of;                                /* NULL: not listed */
  int64_t deadline;                       /* orb_clock_ms() */
  int events;                             /* wake at each event, not only at the end */
  void (*wake)(struct waiter *self);
} waiter;

/* Several nodes run the jobs of one catalogue in PostgreSQL. */
typedef struct queue_sharing {
  const char *url;  /* of the catalogue */
  const char *data; /* the data folder remembers this node's name */
  int works;        /* this node runs jobs */
  int64_t lease_ms; /* after which other nodes take over the jobs of a node that is silent */
  /* Another node, or this one, changed a row: 'r', its kind and id; tokens or keys: 't'; or anything: '*'. */
  void (*changed)(void *user, const char *what);
  void *user;
} queue_sharing;

typedef struct queue_options {
  int workers, cores, limit;
  memory_budget *memory;        /* of running jobs; NULL: does not count */
  const queue_sharing *sharing; /* NULL: this process alone runs them */
} queue_options;

queue *queue_create(const queue_options *options, catalogue *cat);
/* Sets a function that is called after each end of a job. Before the workers start; not under the queue's lock. */
void queue_on_end(queue *q, void (*ended)(void *user), void *user);
void queue_destroy(queue *q);
void queue_set_limit(queue *q, int limit);
/* Recovers from a crash and loads the unfinished jobs of the catalogue. isolated: jobs had processes of their own, so
 * the end of the service is not their crash. */
store_result queue_recover(queue *q, int isolated);
/* Stops handing out jobs and wakes the workers. With `now`, also interrupts the running jobs, which their workers then
 * give back. */
void queue_stop(queue *q, int now);
int queue_running(queue *q);
/* Wakes every waiter and accepts no new ones. */
void queue_wake_all(queue *q);
/* Wakes every waiter so that it checks its state again. */
void queue_wake_once(queue *q);

/* A request for a job. queue_submit() copies its strings; the text of the request goes to the catalogue only. */
typedef struct queue_request {
  api_job_kind kind;
  const char *key, *request, *owner;
  const char *charged; /* the signing key that its work counts for; NULL: none */
  int64_t cost;
  int priority, listed;
  int64_t owner_limit; /* of the owner's listed unfinished jobs; 0: no limit */
  int64_t
      *room; /* bytes that jobs of the owner may add; NULL: no limit. Becomes those that its unfinished jobs leave */
  const struct job_webhook *hook; /* that the request names; NULL: none */
  const char *trace;              /* the span that it belongs to; NULL or "": none */
  int is_disk_full; /* a new job gets QUEUE_STORE_FULL; not where nodes share a catalogue, which lies elsewhere */
} queue_request;
typedef enum queue_result {
  QUEUE_OK,
  QUEUE_FULL,
  QUEUE_QUOTA,
  QUEUE_ROOM, /* the request and the result have no room */
  QUEUE_STOPPING,
  QUEUE_STORE_FULL,
  QUEUE_MESH_GONE, /* a mesh that the request names has been deleted */
  QUEUE_CRASHED,   /* processes that did this work died, see store/crashes.h */
  QUEUE_WEBHOOKS,  /* the job has as many webhooks as it may have */
  QUEUE_ERROR
} queue_result;
/* An estimate of the bytes that the result of a job of this cost has. */
int64_t queue_bytes_of(int64_t cost);
/* The bytes that a job needs of its owner's room: of its request until it ends, then of its result. */
int64_t queue_needs_of(const queue_request *request);
/* Blocks for the commit. Adds a reference to *out. *fresh (may be NULL): 1 for a new job, 0 for one that existed. */
queue_result queue_submit(queue *q, const queue_request *request, job **out, int *fresh);

/* References. */
job *queue_find(queue *q, const char *id); /* NULL: not in memory, or another node may have changed it */
/* The same, also for a job of another node, as it is in the catalogue now; blocks. NULL: it has ended, or does not
 * exist. */
job *queue_follow(queue *q, const char *id);
/* Whether this process does what only one node may do. */
int queue_does_housekeeping(queue *q);
void queue_release(queue *q, job *j);

const char *job_id(const job *j);
const char *job_key(const job *j);
api_job_kind job_kind(const job *j);
const char *job_result(const job *j); /* the id of the result of a job that has succeeded */
/* The request of a job that a worker has, after queue_read_request(). */
const char *job_request(const job *j);
const char *job_charged(const job *j); /* the signing key that its work counts for; "": none */
const char *job_trace(const job *j);   /* the span of the request; "": none */
const char *job_owner(const job *j);   /* the tenant that requested it; "" if no token was needed */
/* Appends the job as JSON; returns its state. */
api_job_state queue_job_write(queue *q, job *j, api_text *out);

/* The problem of a failed job that this process remembers, allocated with malloc(): of the newest with this key and
 * owner that ended after a Unix time in ms. NULL: none. O(ended jobs in memory). */
char *queue_failure(queue *q, const char *key, const char *owner, int64_t since);
/* The problem of a failed job, allocated with malloc(); NULL if it has none. */
char *queue_job_problem(queue *q, job *j);

/* 1: the connection must wait; `suspend` was called under the lock and the waiter is listed. 0: the job has ended, or
 * w->events is set and the job has an event after `after`. */
int queue_wait(queue *q, job *j, waiter *w, int64_t after, void (*suspend)(waiter *));
/* Appends the events after number `after` as an event stream and returns the last number. *ended: the job has ended. */
int64_t queue_events_write(queue *q, job *j, int64_t after, api_text *out, int *ended);
/* Where a client that last saw `seen` resumes. A number beyond the job's last event is unknown: the client gets all
 * events. *over: the job has ended and the client has seen its end. */
int64_t queue_events_after(queue *q, job *j, int64_t seen, int *over);
void event_write(api_text *out, int64_t number, const char *type, const char *json);

/* Cancels a job. If a worker runs it, the worker ends it later; else blocks for the commit. */
store_result queue_cancel(queue *q, job *j);
/* True if an unfinished job (of `owner`, unless NULL) names the mesh. */
int queue_needs_mesh(queue *q, const char *mesh, const char *owner);

/* For the workers. A worker takes a job, then ends it with queue_finish(), or returns it with queue_wait_for(),
 * queue_put_off() or queue_give_back(). Each of these releases the worker's reference. */
/* Which jobs a worker takes: those that compute, only guests and, with one worker, small jobs beside a large one, or
 * those that fetch. */
typedef enum queue_lane { QUEUE_COMPUTES, QUEUE_GUESTS, QUEUE_FETCHES } queue_lane;
enum { QUEUE_GUESTS_MAX = 4 };
/* Waits for a job; 0 when the queue stops. *threads: the job's share of the cores. At most QUEUE_FETCHES_OF_OWNER jobs
 * of an owner fetch at once. */
enum { QUEUE_FETCHES_OF_OWNER = 4 };
int queue_take(queue *q, queue_lane lane, job **out, int *threads);
/* Reads the request of a taken job, which memory has only as long as a worker has the job. Blocks. 0: it cannot be
 * read; try later. */
int queue_read_request(queue *q, job *j);
/* The bytes of memory that a taken job may use; 0: not limited here. */
int64_t queue_memory_of(queue *q, job *j);
/* The taken job needs more memory: returns it, to run with all that jobs may have. Its attempt does not count. 0: it
 * had that already. */
int queue_needs_memory(queue *q, job *j);
/* Shows a taken job as running before it is claimed: a job that downloads. If the process dies, the job is not suspect.
 */
void queue_show_running(queue *q, job *j);
/* Returns a taken job to wait until the jobs of these keys have ended; submits those jobs. */
queue_result queue_wait_for(queue *q, job *j, char (*keys)[API_ID_SIZE], const char *const *requests,
                            const int64_t *costs, int count);
/* The problem of a job that this one waited for and that failed, allocated with malloc(); NULL if none failed. */
char *queue_dependency_problem(queue *q, job *j);
/* When a taken job became ready to be taken, Unix time in ms. */
int64_t queue_ready_ms(queue *q, const job *j);
/* Which attempt a taken job is in. */
int queue_attempt(queue *q, const job *j);
/* Marks a taken job as running, in memory and in the catalogue. Blocks for the commit. */
store_result queue_claim(queue *q, job *j);
void queue_set_context(queue *q, job *j, orb_context *ctx);
int queue_cancel_wanted(queue *q, job *j);
void queue_progress(queue *q, job *j, const char *stage, double fraction);
void queue_add_embed_ms(queue *q, job *j, double ms);
double queue_embed_ms(queue *q, job *j);
/* Ends a taken job that made nothing, or whose result was there. If the store fails, the job is queued again and
 * retried later. */
void queue_finish(queue *q, job *j, api_job_state state, const char *problem);
/* Ends a taken job that made a result while it held the store of objects. If that hold was lost, published() takes it
 * again and says whether the objects of the result are still there; if they are not, the job is queued again. */
typedef struct queue_made {
  const resource *result;
  int (*published)(void *user);
  void *user;
} queue_made;
void queue_finish_made(queue *q, job *j, const queue_made *made);
/* Ends a taken job that fetched a mesh, which is stored. */
void queue_finish_mesh(queue *q, job *j, const char *mesh);
/* Returns a taken job that was not claimed; it is retried after a second. For a store that fails. */
void queue_put_off(queue *q, job *j);
/* Returns a taken job; its attempt does not count. */
void queue_give_back(queue *q, job *j);
/* Whether a job is the cause of the end of its process: no; perhaps, so that it is a suspect next time; or it alone. */
typedef enum queue_blame { QUEUE_NOT_BLAMED, QUEUE_SUSPECTED, QUEUE_BLAMED } queue_blame;
/* The process of a claimed job died. Its attempt counts; late ones count as blamed in any case, so that no job repeats
 * for ever. Returns 0 if the job is queued again; the worker's reference is released. 1: it has died CRASHES_MOST
 * times; the worker must end it. */
int queue_crashed(queue *q, job *j, queue_blame blame);
/* Whether no other job has run on a worker beside this one. */
int queue_runs_alone(queue *q, job *j);

/* Numbers for /metrics and /readyz?verbose. */
typedef struct queue_numbers {
  int queued, waiting, running, waiters;
  struct {
    char name[24];
    int jobs;
  } stages[16];                         /* running jobs by stage; unused entries have 0 jobs */
  int64_t oldest_ms;                    /* age of the oldest queued job */
  int64_t ended[API_JOB_CANCELLED + 1]; /* by state, since the start */
} queue_numbers;
void queue_count(queue *q, queue_numbers *out); /* O(unfinished jobs) */
/* Unfinished jobs of an owner: those that workers have, and the others. O(owners). */
void queue_count_of(queue *q, const char *owner, int *running, int *queued);
/* Jobs that have ended in this state since the start. */
int64_t queue_ended(queue *q, api_job_state state);

#endif
