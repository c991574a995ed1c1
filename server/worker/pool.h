/* The workers: threads that take jobs from the queue and run them with core. In: jobs, and meshes and embeddings from
 * the store. Out: objects and rows in the store; progress and the end of each job to the queue.
 *
 * Reading order:
 *   pool.c            the thread, the life of a job: plan, claim, run, end
 *   run_embedding.c   an embedding: mesh → sphere        sphere.c    reading a stored sphere
 *   run_supermesh.c   a supermesh: embeddings and landmarks → asset, places, aligned spheres
 *   load.c            inputs that both read
 *   run_fetch.c       a mesh from a URL
 *   places.c          the file of places
 *
 * Contract. A worker first plans the job: a supermesh that lacks embeddings goes back to the queue to wait for them.
 * Otherwise the worker claims the job (a commit), runs it with a context of its own (memory, time, threads), publishes
 * the objects, and ends the job with its result in one commit. Retry: queue/queue.h. Jobs that fetch have threads of
 * their own, because they wait for servers; at most as many of them as there are workers check a mesh at once.
 */
#ifndef ORB_WORKER_POOL_H
#define ORB_WORKER_POOL_H

#include "worker/run.h"

typedef struct worker_options {
  int workers;
  int nice;                                  /* of the workers and the threads that their jobs start; 0 to 19 */
  int64_t job_memory, job_ms, max_triangles; /* limits of one job */
  fetch_options fetch;
} worker_options;

typedef struct worker_pool worker_pool;

worker_pool *worker_pool_start(const worker_options *options, queue *q, catalogue *cat, objects *store);
/* Joins and frees the workers. Call queue_stop() first. */
void worker_pool_join(worker_pool *pool);

#endif
