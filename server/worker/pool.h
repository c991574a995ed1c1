/* The workers: threads that take jobs from the queue and run them with the library.
 *
 * Contract. A worker first looks at what the job needs: a supermesh whose embeddings are not all there is put back to
 * wait for them. Else it claims the job (a commit), runs it with a context of its own (memory, time, threads), writes
 * the objects, and ends the job with its result in one commit.
 */
#ifndef ORB_WORKER_POOL_H
#define ORB_WORKER_POOL_H

#include "queue/queue.h"

typedef struct worker_options {
  int workers;
  int nice;                                  /* of the workers and of the threads that their jobs start; 0 to 19 */
  int64_t job_memory, job_ms, max_triangles; /* limits of one job */
} worker_options;

typedef struct worker_pool worker_pool;

worker_pool *worker_pool_start(const worker_options *options, queue *q, catalogue *cat, objects *store);
/* queue_stop() comes first. */
void worker_pool_join(worker_pool *pool);

#endif
