/* The parts of the daemon: store, queue, pools of threads, workers, port, background work. */
#ifndef ORB_PARTS_H
#define ORB_PARTS_H

#include "http/http.h"
#include "worker/pool.h"

/* Starts all parts in order, as srv->options says; parts_stop() stops them, also those of a start that failed. *workers
 * is NULL in the role serve. 0: a part failed, and the log says which. */
int parts_start(server *srv, worker_pool **workers);
/* Stops the parts that were started; waits for running jobs, which it interrupts. */
void parts_stop(server *srv, worker_pool *workers);
/* Reads the tokens and keys again. 0: they could not be read, and the previous ones stay valid. */
int parts_reload_callers(server *srv);

#endif
