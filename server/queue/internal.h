/* The inside of the queue, shared by its files. queue.lock guards everything unless a comment says otherwise. */
#ifndef ORB_QUEUE_INTERNAL_H
#define ORB_QUEUE_INTERNAL_H

#include <pthread.h>

#include <string.h>

#include "queue/queue.h"

enum { BUCKETS = 8192, KEEP_ENDED = 512, EVENTS_KEPT = 64, OWNERS = 1100, DEPENDENCIES = 16 };
static const int64_t LARGE = 300000; /* a job with more triangles than this is large */
/* Estimate of a running job's memory: a base and so many bytes for each triangle, but at most a share of what all jobs
 * may have. A job that needs more runs again with all of it. */
static const int64_t BYTES_A_TRIANGLE = 1024, BYTES_OF_JOB = INT64_C(64) << 20, SHARE_OF_JOB = 8;
static const int64_t TRIANGLES_A_MS = 100; /* estimate of a worker's speed, charged until the time is known */
/* How long a job waits in the queue after the store failed to record its end, and after it failed to record its start.
 */
static const int64_t RETRY_AFTER_STORE_MS = 5000, RETRY_SOON_MS = 1000;
/* How long a suspect with a process of its own keeps other jobs waiting before it begins, and once it has begun: half a
 * minute, in which the kernel kills most jobs that need more memory than there is, and in which others wait for an
 * ordinary job as well. */
static const int64_t SUSPECT_MS = 30000;
/* The end of a job's process that is hardly ever its fault counts from this attempt on, which ends a job that takes
 * each of its nodes, or the process that forks all others, along. */
enum { ATTEMPTS_BORNE = 20 };
static const int64_t EVENT_STRIDE = 1000000; /* event numbers of an attempt start above attempt times this */

typedef struct job_event {
  int64_t number;
  char type[16];
  char *json;
} job_event;

struct job {
  job_row row;  /* its request: only while a worker has the job */
  char *meshes; /* that the request names, one after another; NULL: not known */
  char stage[24];
  double progress, embed_ms;
  int64_t began_ms;     /* when this attempt first reported progress, orb_clock_ms(); 0: it has not */
  double began_at;      /* how much that was */
  double reported;      /* the most that this attempt has reported */
  int64_t reported_ms;  /* when it last did */
  int64_t ends_ms;      /* the estimated end, orb_clock_ms(); 0: not known */
  int64_t seconds_left; /* as last shown; 0: not known */
  int committed;        /* its row is in the catalogue */
  int dead;             /* its row could not be written */
  int taken;            /* by a worker, or by a thread that ends it */
  int running;          /* claimed */
  int cancel;
  int adopters;  /* requests that are making it a listed job */
  int waits_for; /* number of unfinished jobs that it needs */
  char dependencies[DEPENDENCIES][API_ID_SIZE];
  int dependency_count;
  char *dependency_problem;
  int64_t taken_at;    /* by a worker, orb_clock_ms(); 0: by none */
  int64_t charged;     /* milliseconds that its owner is charged for it since taken_at */
  int is_guest;        /* see queue.h */
  int64_t memory;      /* taken from the budget; 0: none */
  int needs_all;       /* of the memory that jobs may have */
  int64_t ready;       /* since when it could be taken, Unix time in ms */
  int64_t retry_at;    /* not chosen before this time, orb_clock_ms() */
  int64_t alone_until; /* a suspect: others wait for it until this time, orb_clock_ms() */
  orb_context *ctx;
  int64_t last_event, last_event_ms, stored_event_ms;
  job_event events[EVENTS_KEPT];
  int event_count;
  waiter *waiters;
  int refs;
  int owner;               /* index into queue.owners, while unfinished */
  job *next_id, *next_key; /* in the hash buckets */
  job *previous, *next;    /* in the list of unfinished jobs, oldest first */
  job *newer_ended;        /* in the list of ended jobs, oldest first */
};

struct queue {
  pthread_mutex_t lock;
  pthread_cond_t work, guest_work, fetch_work; /* for the threads of each lane; where jobs are shared, `work` for all */
  pthread_cond_t committed, timer_wake;
  queue_options options;
  catalogue *cat;
  job *by_id[BUCKETS], *by_key[BUCKETS];
  job *first, *last;
  job *oldest_ended, *newest_ended;
  int ended_count, unfinished, unfinished_fetches;
  int running, running_large, fetching; /* fetching: of those that run */
  const job *alone;                     /* a suspect that runs, and beside which only guests have run; NULL: none */
  int isolated;                         /* jobs have processes of their own */
  int guests;                           /* of those that run */
  int stopping, stopping_now, waking;
  budget_claim claim;     /* of a job that a worker waits for */
  struct sharing *shared; /* with other nodes; NULL: this process alone runs the jobs */
  struct {
    char name[64];
    int64_t service;       /* milliseconds of workers, for running jobs at least the estimate */
    int unfinished;        /* jobs */
    int fetching, running; /* jobs that a worker has; running: without those that fetch */
    int runnable;          /* a job of this owner can run; set by choose() */
  } owners[OWNERS];
  int owner_count;
  waiter *waiters;
  int waiter_count;
  pthread_t timer;
  int timer_started, timer_stop;
  int64_t ended[API_JOB_CANCELLED + 1];
  void (*on_end)(void *user);
  void *on_end_user;
};

int64_t unix_ms(void);
/* Whether the job makes this key for this owner. */
static inline int is_for(const job *j, const char *key, const char *owner) {
  return strcmp(j->row.key, key) == 0 && strcmp(j->row.owner, owner) == 0;
}
static inline int fetches(const job *j) {
  return j->row.kind == API_JOB_FETCH;
}
/* How long a worker has had the job. */
static inline int64_t used_ms(const job *j, int64_t now) {
  return now > j->taken_at ? now - j->taken_at : 0;
}
/* Something may be there to take. All threads of a lane may take the same jobs, so one of them looks. If it takes a
 * job, it wakes the next. */
static inline void wake_workers(queue *q) {
  if (q->shared || q->stopping) {
    pthread_cond_broadcast(&q->work);
    pthread_cond_broadcast(&q->guest_work);
    pthread_cond_broadcast(&q->fetch_work);
    return;
  }
  if (q->unfinished > q->unfinished_fetches) {
    pthread_cond_signal(&q->work);
    pthread_cond_signal(&q->guest_work);
  }
  if (q->unfinished_fetches > 0) {
    pthread_cond_signal(&q->fetch_work);
  }
}
void owner_enter(queue *q, job *j); /* sets j->owner */
void owner_leave(queue *q, const job *j);
void owner_charge(queue *q, job *j, int64_t ms); /* replaces what its owner is charged for it */
void owners_charge(queue *q);                    /* brings the service of all owners up to date; O(unfinished jobs) */
void schedule_leave(queue *q, job *j);           /* undoes what queue_take() counted */
void crash_problem(api_text *text);              /* of a job that crashed alone too often */
job *schedule_choose(queue *q, queue_lane lane); /* the next job for a worker, or NULL */
/* The number of jobs besides this one that could run now. O(unfinished jobs). */
int schedule_beside(const queue *q, const job *chosen, int64_t now);
/* Whether jobs that are no guests wait for the suspect that runs. */
int schedule_is_kept(const queue *q, int64_t now);
/* Until when others wait for a suspect that is one from now on, or begins now. */
int64_t schedule_alone_until(const queue *q);
/* Counts a job that a worker of this lane takes. */
void schedule_enter(queue *q, queue_lane lane, job *j, int64_t now);
/* The threads of a job that was entered: its part of the cores. beside: the jobs that could run now as well. */
int schedule_threads(const queue *q, const job *j, int64_t beside);
int schedule_take_memory(queue *q, queue_lane lane, job *j);
/* The most triangles of a job for which the lane has memory, −1: none; *big: also for one that needs all. */
int64_t schedule_room(const queue *q, queue_lane lane, int *big);
void table_add(queue *q, job *j);
job *table_with_id(const queue *q, const char *id); /* also one that is not committed; NULL: not in memory */
void table_forget(queue *q, job *j);                /* an unfinished job that nobody here wants */
void table_drop_key(queue *q, job *j);              /* removes an ended job from the unfinished ones */
void table_ended(queue *q, job *j);
/* No worker waits for the memory that is claimed. */
void table_drop_claim(queue *q);
job *table_find(queue *q, const char *key, const char *owner); /* an unfinished job, or NULL */
int table_key_taken(const queue *q, const job *by_other);      /* a worker has another job with the same key */
/* The ids of the meshes that a request names, one after another, of malloc(); NULL: out of memory. */
char *meshes_of(const char *request);
/* A job for a request, in the table, not yet committed, with a reference for the caller; NULL: out of memory. */
job *job_create(queue *q, const queue_request *request);
void job_unref(job *j);
void job_view(const job *j, api_job_view *view);
void wake_job(queue *q, job *j, int ended);
/* Writes the JSON of the next event and returns its number. */
int64_t prepare_event(job *j, api_text *json);
void keep_event(job *j, int64_t number, const char *type, const char *json);
void *timer_main(void *argument);

/* Copies a string, truncated to the destination. */
static inline void copy_text(char *to, size_t room, const char *from) {
  size_t length = strnlen(from, room - 1);
  memcpy(to, from, length);
  to[length] = 0;
}

#endif
