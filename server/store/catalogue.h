/* The catalogue: rows about meshes, embeddings, supermeshes, jobs and their events, in SQLite.
 *
 * Contract. ONE connection writes and checkpoints, owned by one thread (SQLite before 3.51.3 can lose a WAL reset with
 * two). Writes are handed to it as functions; it runs all that wait in one transaction (group commit), each in a
 * savepoint of its own, with synchronous=FULL, and answers after the commit. catalogue_write() blocks until then and
 * must not be called by a thread that serves connections. Readers have connections of their own that never write nor
 * checkpoint.
 */
#ifndef ORB_STORE_CATALOGUE_H
#define ORB_STORE_CATALOGUE_H

#include <sqlite3.h>

#include "api/ids.h"
#include "api/job_codec.h"
#include "store/objects.h"

typedef struct catalogue catalogue;

store_result catalogue_open(const char *data, catalogue **out);
void catalogue_close(catalogue *cat); /* runs what waits, then stops the writer */

typedef enum resource_kind { RESOURCE_MESH, RESOURCE_EMBEDDING, RESOURCE_SUPERMESH, RESOURCE_KINDS } resource_kind;

/* A row of a mesh, embedding or supermesh. json is of malloc(). */
typedef struct resource {
  int64_t seq;
  resource_kind kind;
  char id[API_ID_SIZE];
  char sha[API_ID_SIZE];    /* of its object's bytes */
  char places[API_ID_SIZE]; /* of those of its places; "": none, or stored before this was noted */
  char *json;
  int64_t bytes; /* of its objects */
  int64_t created;
} resource;
void resource_free(resource *r);

store_result catalogue_get(catalogue *cat, resource_kind kind, const char *id, resource *out);
store_result catalogue_delete(catalogue *cat, resource_kind kind, const char *id);
/* The functions that list return the number filled, −1 where the rows cannot be read: nothing is filled then. */
/* The newest first, those before sequence number `before` (0: all). */
int catalogue_list(catalogue *cat, resource_kind kind, int64_t before, int limit, resource *out);
/* Least recently used derived ones first, of those last used before a unix time in ms, without the first `skip`; for
 * eviction. */
int catalogue_oldest(catalogue *cat, int64_t before, int skip, int limit, resource *out);
void catalogue_touch(catalogue *cat, resource_kind kind, const char *id); /* does not wait */
int64_t catalogue_bytes(catalogue *cat, int derived_only);                /* −1: cannot be read */

/* Random bytes that this data folder has had from the beginning. */
enum { CATALOGUE_SECRET = 16 };
store_result catalogue_secret(catalogue *cat, unsigned char out[CATALOGUE_SECRET]);

/* A row of a job. request and problem are of malloc(). */
typedef struct job_row {
  int64_t seq;
  char id[API_JOB_ID_SIZE];
  char key[API_ID_SIZE];
  api_job_kind kind;
  api_job_state state;
  int attempt;
  int crashes; /* attempts in which it ran alone and the process died */
  int suspect; /* was running when a process died: to be run alone */
  int alone;   /* the present attempt runs alone */
  int listed;  /* asked for by a caller, not only needed by another job */
  int priority;
  int64_t cost;   /* triangles */
  char owner[64]; /* the tenant who asked */
  char *request, *problem;
  int64_t created, started, finished;
} job_row;
void job_row_free(job_row *row);

/* Fills seq. Its owner owns the meshes that the request names from then on; STORE_NOT_FOUND where the job is listed and
 * one of them is gone. */
store_result catalogue_job_insert(catalogue *cat, job_row *row);
store_result catalogue_job_list_it(catalogue *cat, const char *id);
/* queued → running with the next attempt. No heartbeat follows: one process alone, by the lock of the data folder, runs
 * jobs, so what is running in the catalogue at its start belongs to a process that is dead (catalogue_recover()).
 * Several processes would need a time here that (job, attempt) renews, to tell a claim that is dead. */
store_result catalogue_job_claim(catalogue *cat, const char *id, int attempt, int alone, int64_t now);
/* running → queued again; its attempt does not count. */
store_result catalogue_job_release(catalogue *cat, const char *id, int attempt);
/* Ends it if (id, attempt) still holds, with its result (or NULL) in the same transaction. STORE_CONFLICT if not. */
store_result catalogue_job_finish(catalogue *cat, const char *id, int attempt, api_job_state state, const char *problem,
                                  int64_t now, const resource *result, int64_t event, const char *event_json);
store_result catalogue_job_get(catalogue *cat, const char *id, job_row *out);
/* owner NULL, state −1: any. */
enum { CATALOGUE_UNFINISHED = -2 }; /* as a state: queued or running */
int catalogue_job_list(catalogue *cat, const char *owner, int state, int64_t before, int limit, job_row *out);
/* After a start: marks what was running, fails what died alone for the last time; then all unfinished, oldest first. */
store_result catalogue_recover(catalogue *cat, int most_crashes, int64_t now, const char *crash_problem);
int catalogue_unfinished(catalogue *cat, int64_t after, int limit, job_row *out);

/* Ended jobs; −1: they cannot be counted. Walks an index over all of them. */
int64_t catalogue_jobs_ended(catalogue *cat);
/* Deletes the oldest ended jobs, at most `count`, with their events, in one transaction. */
store_result catalogue_jobs_forget(catalogue *cat, int count);

/* Events of a job, in order of number. */
void catalogue_event(catalogue *cat, const char *job, int64_t number, const char *type, const char *json);
typedef struct event_row {
  int64_t number;
  char type[16];
  char *json;
} event_row;
int catalogue_events(catalogue *cat, const char *job, int64_t after, int limit, event_row *out);

/* For --check-data. */
int catalogue_integrity(catalogue *cat);
/* Rows that do not say what they must; −1 where they cannot be read. */
int64_t catalogue_damaged(catalogue *cat);

#endif
