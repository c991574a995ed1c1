/* The inside of the queue, shared by its files. Everything is guarded by queue.lock unless said. */
#ifndef ORB_QUEUE_INTERNAL_H
#define ORB_QUEUE_INTERNAL_H

#include <pthread.h>

#include <string.h>

#include "queue/queue.h"

enum { BUCKETS = 8192, KEEP_ENDED = 512, EVENTS_KEPT = 64, OWNERS = 1100, DEPENDENCIES = 16 };
static const int64_t LARGE = 300000;          /* triangles from which a job is large */
static const int64_t BYTES_A_TRIANGLE = 1024; /* estimate of a running job's memory */
static const int64_t EVENT_STRIDE = 1000000;  /* event numbers of an attempt start at attempt times this */

typedef struct job_event {
  int64_t number;
  char type[16];
  char *json;
} job_event;

struct job {
  job_row row;
  char stage[24];
  double progress, embed_ms;
  int committed; /* its row is in the catalogue */
  int dead;      /* the row could not be written */
  int taken;     /* by a worker, or by one who ends it */
  int running;   /* claimed */
  int cancel;
  int adopters;  /* requests that are making it listed */
  int waits_for; /* unfinished jobs that it needs */
  char dependencies[DEPENDENCIES][API_ID_SIZE];
  int dependency_count;
  char *dependency_problem;
  int64_t retry_at; /* not before, orb_clock_ms() */
  orb_context *ctx;
  int64_t last_event, last_event_ms;
  job_event events[EVENTS_KEPT];
  int event_count;
  waiter *waiters;
  int refs;
  int owner;               /* in queue.owners, while unfinished */
  job *next_id, *next_key; /* buckets */
  job *previous, *next;    /* of the unfinished, oldest first */
  job *newer_ended;        /* of the ended, oldest first */
};

struct queue {
  pthread_mutex_t lock;
  pthread_cond_t work, committed, timer_wake;
  queue_options options;
  catalogue *cat;
  job *by_id[BUCKETS], *by_key[BUCKETS];
  job *first, *last;
  job *oldest_ended, *newest_ended;
  int ended_count, unfinished;
  int running, running_large, exclusive;
  int64_t running_cost;
  int stopping, waking;
  struct {
    char name[64];
    double service; /* triangles worked for this owner */
    int unfinished;
  } owners[OWNERS];
  int owner_count;
  waiter *waiters;
  int waiter_count;
  pthread_t timer;
  int timer_started, timer_stop;
  int64_t ended[API_JOB_CANCELLED + 1];
};

int64_t unix_ms(void);
/* Whether the job makes what an owner wants under this key. */
static inline int is_for(const job *j, const char *key, const char *owner) {
  return strcmp(j->row.key, key) == 0 && strcmp(j->row.owner, owner) == 0;
}
/* Counts the job with its owner. */
void owner_enter(queue *q, job *j);
void owner_leave(queue *q, const job *j);
void schedule_leave(queue *q, job *j); /* undoes what queue_take() counted */
void table_add(queue *q, job *j);
void table_drop_key(queue *q, job *j); /* when it ends */
void table_ended(queue *q, job *j);
job *table_find(queue *q, const char *key, const char *owner); /* an unfinished one */
int table_key_taken(const queue *q, const job *by_other);      /* another job for the same result is being worked on */
void job_unref(job *j);
void job_view(const job *j, api_job_view *view);
void wake_job(queue *q, job *j, int ended);
/* Makes an event of the job's present state. Not for final ones, which the catalogue writes with the end. */
void add_event(queue *q, job *j, const char *type, int store);
int64_t prepare_event(job *j, api_text *json);
void keep_event(job *j, int64_t number, const char *type, const char *json);
void *timer_main(void *argument);

/* Copies a text, cut to the room there is. */
static inline void copy_text(char *to, size_t room, const char *from) {
  size_t length = strnlen(from, room - 1);
  memcpy(to, from, length);
  to[length] = 0;
}

#endif
