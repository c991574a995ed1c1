/* Jobs that several nodes share: submitting, claims, leases, what jobs wait for. Only for a catalogue in PostgreSQL
 * that was opened with catalogue_open_shared(); the other functions of jobs are in catalogue.h.
 *
 * Contract. A node claims the job that is first in the order of fairness over all nodes; the row then says that it
 * runs, with the node and the next attempt. A node has one lease, a time of the database's clock, which it renews
 * (notices.h) for all its jobs. When the lease has expired, any node queues its jobs again (catalogue_recover_lost()).
 * A change of a job needs its (id, attempt), so a node that lost its lease gets STORE_CONFLICT. The database notifies
 * all nodes of each change by triggers, in its transaction. */
#ifndef ORB_STORE_SHARED_H
#define ORB_STORE_SHARED_H

#include "store/catalogue.h"

enum { NODE_NAME = 33 };

/* Which job a node can take. */
typedef struct claim_wish {
  const char *node;
  int fetches;       /* a job that downloads; else one that computes */
  int fetches_most;  /* downloads of an owner at once */
  int64_t most_cost; /* triangles for which this node has memory, and room beside large jobs */
  int big;           /* also a job that needs all memory */
  int alone;         /* also a suspect, because nothing else runs here */
  int64_t alone_ms;  /* for which others wait for a suspect; after that it is like any other job */
  int guest;         /* only a job of an owner that runs nothing, while all workers of all nodes are busy */
} claim_wish;
typedef struct job_claim {
  job_row row;
  int64_t last_event; /* number */
  int big, cancel;
  int64_t ready;  /* since when it could be claimed, Unix time in ms of the database's clock */
  int64_t beside; /* other jobs that are ready to run */
  int64_t others; /* those of them that other owners have */
} job_claim;
/* Claims the next job. STORE_NOT_FOUND: there is none for this node. */
store_result catalogue_claim_next(catalogue *cat, const claim_wish *wish, job_claim *out);

/* How a new job relates to the others. */
typedef enum submit_outcome { SUBMIT_FRESH, SUBMIT_KNOWN, SUBMIT_FULL, SUBMIT_QUOTA, SUBMIT_ROOM } submit_outcome;
typedef struct job_submission {
  job_row *row; /* SUBMIT_KNOWN: its id becomes that of the owner's unfinished job with the same key */
  const struct job_webhook *hook;
  int64_t limit, owner_limit; /* of unfinished jobs, if the job is listed; of the owner's listed ones, 0: no limit */
  int64_t *room;              /* for results of the owner; NULL: no limit. Becomes what its jobs leave */
  int64_t head, triangle;     /* bytes of a result, and of each of its triangles */
  int64_t needs;              /* bytes of this job: of its result and its request */
  submit_outcome outcome;
} job_submission;
/* Inserts the job unless there is one, in one transaction over all nodes. Results as of catalogue_job_insert(), and
 * STORE_FULL. */
store_result catalogue_job_submit(catalogue *cat, job_submission *s);

/* running → queued, until the jobs of these keys have ended. Inserts those of them that the owner does not have.
 * STORE_CONFLICT: the job is to be cancelled, or this node has lost it. */
typedef struct job_needs {
  const job_row *row;
  char (*keys)[API_ID_SIZE];
  const char *const *requests;
  const int64_t *costs;
  int count;
  int64_t now;
} job_needs;
store_result catalogue_job_wait(catalogue *cat, const job_needs *needs);
/* Shows a claimed supermesh as running, which catalogue_claim_next() does for other jobs: soon, with its first events.
 */
void catalogue_job_begin(catalogue *cat, const char *id, int attempt);
/* Like catalogue_job_release(), and the job needs all memory of a node from now on. */
store_result catalogue_job_release_big(catalogue *cat, const char *id, int attempt);
/* Asks for a job to be cancelled, and notifies the node that runs it. */
store_result catalogue_job_cancel(catalogue *cat, const char *id);

/* What other nodes did to jobs, for those that this node watches or runs. */
typedef struct job_mark {
  char id[API_JOB_ID_SIZE];
  int state, attempt, cancel; /* state: as callers see it */
  int queued;                 /* no node runs it */
  int64_t last_event;
} job_mark;
/* The marks of jobs whose ids are in a text, separated by commas. */
int catalogue_job_marks(catalogue *cat, const char *ids, int limit, job_mark *out);

/* Whether jobs run on nodes whose lease has expired. No lease expires while the database is unreachable, nor within one
 * lease after it is back. */
int catalogue_lost_jobs(catalogue *cat, int64_t lease_ms);

/* Numbers over all nodes. */
typedef struct shared_numbers {
  int64_t ready, waiting, running, unfinished, nodes, workers;
  int64_t oldest; /* when the oldest queued job was created; 0: there is none */
} shared_numbers;
store_result catalogue_shared_numbers(catalogue *cat, shared_numbers *out);
/* An owner's running and other unfinished jobs. */
store_result catalogue_shared_of(catalogue *cat, const char *owner, int64_t *running, int64_t *queued);
/* For --gc and --check-data: 0: another process does either on this catalogue. Else none can until this catalogue is
 * closed. Questions that read all rows may then take as long as they need. Also for a catalogue that is not shared. */
int catalogue_maintain(catalogue *cat);
/* Whether an unfinished job (of this owner, unless NULL) names a mesh. */
int catalogue_needs_mesh(catalogue *cat, const char *mesh, const char *owner);
/* The problem of the newest job with this key and owner that ended after a time, if it failed; malloc(), or NULL. */
char *catalogue_failure(catalogue *cat, const char *key, const char *owner, int64_t since);

#endif
