/* The queue of a node among several (store/shared.h), for the files of the queue. In memory are only the jobs that run
 * here, were requested here or are watched here; the catalogue has all of them, and chooses which one runs next.
 *
 *   sharing.c   the node's thread: lease, notices, polls, numbers
 *   claims.c    submitting, claiming, waiting for other jobs
 *   watched.c   jobs that run elsewhere, brought up to date */
#ifndef ORB_QUEUE_SHARED_H
#define ORB_QUEUE_SHARED_H

#include "queue/queue.h"
#include "store/notices.h"
#include "store/shared.h"

enum { LANES = QUEUE_FETCHES + 1 };

typedef struct sharing {
  queue_sharing options;
  char node[NODE_NAME], last_life[NODE_NAME];
  notices *bell; /* of the thread */
  pthread_t thread;
  int started, stop; /* stop: __atomic */
  int house;         /* __atomic */
  /* Under queue.lock. look: there may be a job for the lane; looking: a worker asks the catalogue. */
  int look[LANES], looking[LANES];
  int64_t hold_until; /* claims nothing before, orb_clock_ms() */
  shared_numbers numbers;
} sharing;

int shared_create(queue *q, const queue_sharing *options); /* 0: out of memory */
store_result shared_start(queue *q);
void shared_stop(queue *q);

/* Like the functions of queue.h. */
queue_result shared_submit(queue *q, const queue_request *request, job **out, int *fresh);
int shared_take(queue *q, queue_lane lane, job **out, int *threads);
queue_result shared_wait_for(queue *q, job *j, char (*keys)[API_ID_SIZE], const char *const *requests,
                             const int64_t *costs, int count);

/* Called under the lock: there may be jobs to claim, including downloads if fetches. The numbers cover all nodes. */
void shared_look(queue *q, int fetches);
void shared_count(const queue *q, int64_t now, queue_numbers *out);
/* This node claims nothing for this long. */
void shared_hold(queue *q, int64_t ms);
/* Waits a while before the store is tried again. 0: the node stops. */
int shared_pause(queue *q);
/* Brings a job up to date that is in memory and does not run here. */
void shared_refresh(queue *q, const char *id);
/* The same for all of them, and drops those that nobody watches. Interrupts jobs that this node has lost, or that are
 * to be cancelled. */
void shared_refresh_all(queue *q);
void shared_cancelled(queue *q, const char *id);

#endif
