/* What the daemon does once a second to keep within derived-bytes and keep-jobs. With several nodes, only the node that
 * does the housekeeping does this (queue_does_housekeeping()). */
#ifndef ORB_HOUSEKEEPING_H
#define ORB_HOUSEKEEPING_H

#include "http/http.h"
#include "trim.h"

/* Ended jobs in the catalogue. */
typedef struct ended_jobs {
  int counted;
  int64_t before; /* those from before this process started, less those forgotten since */
  int64_t at;     /* when they were counted, orb_clock_ms() */
} ended_jobs;

typedef struct housekeeping {
  int64_t seen; /* results made by the last round of eviction */
  int over;     /* that round could not evict enough */
  ended_jobs jobs;
  trim_state trimmed;
} housekeeping;

#define HOUSEKEEPING_START ((housekeeping){.seen = -1})

/* Deletes what a backup kept. Evicts derived objects beyond derived-bytes, after jobs succeeded, profiles were made, or
 * when the last round could not evict enough. Objects made or used in the last 5 s stay, so that a waiting client can
 * fetch them. Blocks for commits. */
void housekeeping_budget(const server *srv, housekeeping *done);
/* Deletes the oldest ended jobs beyond keep-jobs, in small batches so that other writes are not delayed. Counts the
 * catalogue's ended jobs once; after that, the queue's counts suffice. */
void housekeeping_jobs(const server *srv, housekeeping *done);

#endif
