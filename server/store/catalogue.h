/* The store: rows in SQLite or PostgreSQL (the catalogue) and files (objects). server/http, server/queue and
 * server/worker write rows and bytes and read them back, also after a crash.
 *
 * Reading order:
 *   catalogue.h   rows of meshes, embeddings, supermeshes, jobs and events: the interface
 *   objects.h     files, each named by a hash
 *   owners.h      which tenant owns which row
 *   tokens.h      the tokens
 *   sql.h         statements over a database; its drivers are sqlite.c and postgresql.c
 *   postgresql_connection.c, postgresql_schema.c   a connection to PostgreSQL, and the schema there
 *   database.c    connections with prepared statements, the schema and its migrations
 *   catalogue.c   the writer thread with group commit, the pool of readers
 *   rows.c        reading rows of any kind
 *   resources.c, owners.c, jobs.c, events.c, tokens.c, keys.c, webhooks.c   the SQL of each kind of row
 *   recover.c     jobs whose process or node ended
 *   lists.c       lists with a filter
 *   deliveries.c  the outbox: messages to webhooks that are not delivered yet
 *   objects.c     publishing and reading objects
 *   object_removal.c   deleting objects, quarantine, lost+found
 *   spheres.c     the file of aligned spheres
 *   alignments.c  kept alignments
 *   usage.c       what tenants use
 *   shared.c      jobs of several nodes
 *   notices.c     notices between nodes
 *   object_lock.c the lock of objects over all nodes
 *   snapshot.c    a copy of the catalogue for a backup
 *   transfer.c    objects from one folder to another
 *   move.c        a whole deployment from one place to another
 *
 * Contract. ONE connection writes and checkpoints, and one thread owns it (SQLite before 3.51.3 can lose a WAL reset
 * with two). Writes are passed to it as functions. It runs all waiting writes in one transaction (group commit), each
 * in its own savepoint, with synchronous=FULL, and reports their results after the commit. catalogue_write() blocks
 * until then, so a thread that serves connections must not call it. Readers have their own connections, which never
 * write or checkpoint.
 */
#ifndef ORB_STORE_CATALOGUE_H
#define ORB_STORE_CATALOGUE_H

#include "api/ids.h"
#include "api/job_codec.h"
#include "store/objects.h"
#include "trace/trace.h"

typedef struct catalogue catalogue;

/* where: the data folder, or the URL of a database in PostgreSQL. */
store_result catalogue_open(const char *where, catalogue **out);
/* shared: further nodes use this database in PostgreSQL at the same time (shared.h). */
store_result catalogue_open_shared(const char *where, int shared, catalogue **out);
int catalogue_is_shared(const catalogue *cat);
/* Whether it is in PostgreSQL and PostgreSQL does not answer. */
int catalogue_is_away(const catalogue *cat);
/* Whether any statement has met a damaged page of the file since the daemon started; PostgreSQL: never. */
int catalogue_is_damaged(const catalogue *cat);
/* Whether another daemon has used it since this one opened it: this one must be restarted. */
int catalogue_is_taken(const catalogue *cat);
/* Whether it has failed to answer at some time since `since` (orb_clock_ms()). */
int catalogue_was_away(const catalogue *cat, int64_t since);
void catalogue_close(catalogue *cat); /* completes all waiting writes, then stops the writer */

/* The catalogue stores these numbers. */
typedef enum resource_kind {
  RESOURCE_MESH,
  RESOURCE_EMBEDDING,
  RESOURCE_SUPERMESH,
  RESOURCE_LANDMARKS, /* a row alone, without an object */
  RESOURCE_ALIGNMENT, /* no caller sees it; it counts for the tenant whose job made it */
  RESOURCE_KINDS
} resource_kind;

/* Embeddings, supermeshes and alignments: a job can make them again, so they may be evicted. */
static inline int resource_is_derived(resource_kind kind) {
  return kind == RESOURCE_EMBEDDING || kind == RESOURCE_SUPERMESH || kind == RESOURCE_ALIGNMENT;
}

/* Profiles of an asset that are objects of their own, in the order of orb_profile. */
enum { PROFILES_STORED = 2 };
static inline object_kind object_of_profile(int profile) { /* 0 to PROFILES_STORED − 1 */
  return profile == 0 ? OBJECT_QUANTIZED : OBJECT_MESHOPT;
}

/* A row of a resource. json is allocated with malloc(). */
typedef struct resource {
  int64_t seq;
  resource_kind kind;
  char id[API_ID_SIZE];
  char sha[API_ID_SIZE];    /* SHA-256 of its object; landmarks: their id */
  char places[API_ID_SIZE]; /* SHA-256 of its places object, or RESOURCE_PLACES_JOINED; "": none, or stored before this
                             * column existed */
  char profiles[PROFILES_STORED][API_ID_SIZE]; /* SHA-256 of the profiles of its asset; "": not made */
  char *json;                                  /* its description */
  int64_t bytes;                               /* of its objects */
  int64_t created;
} resource;

/* The places of a supermesh are in its file of aligned spheres (store/spheres.h). */
#define RESOURCE_PLACES_JOINED "spheres"
int resource_places_are_joined(const resource *row);
void resource_free(resource *r);

/* The kind of the row that names an object. */
resource_kind resource_of_object(object_kind kind);
/* An object that a row names. */
typedef struct named_object {
  object_kind kind;
  const char *what; /* for messages: "its object" */
  const char *sha;  /* of the row; "": the row has no hash of it */
} named_object;
enum { RESOURCE_OBJECTS = 3 + PROFILES_STORED };
/* The number of objects that a row names. */
int resource_objects(const resource *row, named_object out[RESOURCE_OBJECTS]);

store_result catalogue_get(catalogue *cat, resource_kind kind, const char *id, resource *out);
typedef struct resource_key {
  resource_kind kind;
  char id[API_ID_SIZE];
} resource_key;
/* The same for several, each named once; json NULL: there is no such row. STORE_ERROR: none is read. */
store_result catalogue_get_all(catalogue *cat, const resource_key *keys, int count, resource *out);
store_result catalogue_delete(catalogue *cat, resource_kind kind, const char *id);
/* Functions that list return the number of rows filled, or −1, and fill nothing, if the rows cannot be read. */
/* Lists the newest rows first, and only those before sequence number `before` (0: all). Landmarks come without their
 * places. */
int catalogue_list(catalogue *cat, resource_kind kind, int64_t before, int limit, resource *out);
/* Which rows a list has. NULL: no condition. */
typedef struct list_filter {
  const char *prefix;      /* of the id: hexadecimal digits */
  const char *mesh, *name; /* supermeshes with a shape of this mesh, and with one of this name */
} list_filter;
/* Like catalogue_list(), but lists only rows that match the filter and, unless view is "", that this tenant owns. Reads
 * only matching rows, through an index; with a mesh and a name, the rows of that mesh. */
int catalogue_list_some(catalogue *cat, resource_kind kind, const char *view, const list_filter *filter, int64_t before,
                        int limit, resource *out);
/* For eviction: lists the derived resources that were last used before a Unix time in ms, least recently used first.
 * Passes over the first `skip`. */
int catalogue_oldest(catalogue *cat, int64_t before, int skip, int limit, resource *out);
void catalogue_touch(catalogue *cat, resource_kind kind, const char *id); /* does not wait for the commit */
/* Notes that a profile of a supermesh's asset has become an object, and adds its bytes to the row's. STORE_NOT_FOUND:
 * the supermesh has been deleted. */
store_result catalogue_add_profile(catalogue *cat, const char *id, int profile, const char *sha, int64_t bytes);
int64_t catalogue_bytes(catalogue *cat, int derived_only); /* −1: cannot be read */

/* Random bytes of this data folder, fixed when its catalogue is created. */
enum { CATALOGUE_SECRET = 16 };
store_result catalogue_secret(catalogue *cat, unsigned char out[CATALOGUE_SECRET]);
/* What is known of a catalogue in PostgreSQL before it is opened, which writes: it migrates the schema. */
typedef struct catalogue_glance {
  unsigned char secret[CATALOGUE_SECRET];
  int names_objects; /* it has rows that do */
} catalogue_glance;
/* STORE_NOT_FOUND: the database has no catalogue yet. Other errors are logged, with the results of catalogue_open(). */
store_result catalogue_peek(const char *url, catalogue_glance *out);

/* A row of a job. request and problem are allocated with malloc(). The row keeps the request until the job ends; no
 * function here reads it but catalogue_job_request() and catalogue_claim_next(). */
typedef struct job_row {
  int64_t seq;
  char id[API_JOB_ID_SIZE];
  char key[API_ID_SIZE];
  api_job_kind kind;
  api_job_state state;
  int attempt;
  int crashes; /* attempts in which it ran alone and the process died */
  int suspect; /* it was running when the process died; it must run alone */
  int alone;   /* the current attempt runs alone */
  int listed;  /* a caller requested it, as opposed to another job that needs it */
  int priority;
  int64_t cost;             /* triangles */
  char owner[64];           /* the tenant that requested it */
  char trace[TRACE_PARENT]; /* the span of the request; "": none */
  char charged[64];         /* the signing key whose limits its work counts against; "": none */
  char result[API_ID_SIZE]; /* of a mesh from a URL that is stored; "": the key is the id of the result */
  char *request, *problem;
  int64_t request_bytes; /* of the request; they count for the owner. 0: the job has ended */
  int64_t created, started, finished;
} job_row;
void job_row_free(job_row *row);

/* Fills seq, and makes the job's owner an owner of the meshes that the request names. STORE_NOT_FOUND if the job is
 * listed and one of the meshes does not exist. hook: the webhook that the request names, or NULL. */
struct job_webhook;
store_result catalogue_job_insert(catalogue *cat, job_row *row, const struct job_webhook *hook);
store_result catalogue_job_list_it(catalogue *cat, const char *id); /* sets `listed` */
/* queued → running with the next attempt. There is no heartbeat: the lock of the data folder ensures that only one
 * process runs jobs, so any job that is running in the catalogue at the start belongs to a dead process
 * (catalogue_recover()). Several nodes claim with catalogue_claim_next() instead, which gives a lease (shared.h). */
store_result catalogue_job_claim(catalogue *cat, const char *id, int attempt, int alone, int64_t now);
/* running → queued; its attempt does not count. */
store_result catalogue_job_release(catalogue *cat, const char *id, int attempt);
/* running → queued: its process died. counts: the crash counts against the job, see queue_crashed(). */
store_result catalogue_job_crashed(catalogue *cat, const job_row *row, int counts, int suspect, int64_t now);
/* How a job ends. */
typedef struct job_end {
  api_job_state state;
  const char *problem;    /* NULL: none */
  const resource *result; /* to be stored; NULL: it is stored, or there is none */
  const char *mesh;       /* of a mesh from a URL: its id; NULL: none */
  int64_t now, event;     /* event: the number of the last event */
  const char *event_json; /* of the last event: the job */
  int64_t started;        /* of a job whose start is not in its row yet */
  const char *owner;      /* the tenant that worker_ms counts for */
  int64_t worker_ms;      /* how long a worker had it */
} job_end;
/* Ends a job, stores its result and announces it to its webhooks in the same transaction. STORE_CONFLICT if `attempt`
 * is no longer the job's current one. */
store_result catalogue_job_finish(catalogue *cat, const char *id, int attempt, const job_end *end);
store_result catalogue_job_get(catalogue *cat, const char *id, job_row *out);
/* The request of an unfinished job, allocated with malloc(); NULL if it cannot be read. */
char *catalogue_job_request(catalogue *cat, const char *id);
/* owner NULL, prefix of the id NULL, state −1: any. */
enum { CATALOGUE_UNFINISHED = -2 }; /* as a state: queued or running */
int catalogue_job_list(catalogue *cat, const char *owner, const char *prefix, int state, int64_t before, int limit,
                       job_row *out);
/* After a crash: queues the jobs that were running, as suspects, and fails those that crashed alone `most_crashes`
 * times. most_crashes 0: the jobs did not cause the crash, so they are queued without suspicion. */
store_result catalogue_recover(catalogue *cat, int most_crashes, int64_t now, const char *crash_problem);
/* Where several nodes share the jobs: queues the jobs that this node ran before its restart. last_life: its name then;
 * "": none. */
store_result catalogue_recover_own(catalogue *cat, const char *last_life);
/* The same as catalogue_recover() for jobs of nodes whose lease has expired; does not wait for the commit.
 * counted_from: the loss of a node on which a job runs alone counts as its crash from this attempt on. */
void catalogue_recover_lost(catalogue *cat, int most_crashes, int counted_from, int64_t now, const char *crash_problem);
/* Lists unfinished jobs after sequence number `after`, oldest first. */
int catalogue_unfinished(catalogue *cat, int64_t after, int limit, job_row *out);

/* The number of ended jobs, −1 if they cannot be counted. O(ended jobs), through an index. */
int64_t catalogue_jobs_ended(catalogue *cat);
/* Deletes the oldest ended jobs, at most `count`, with their events, in one transaction. */
store_result catalogue_jobs_forget(catalogue *cat, int count);

/* Stores an event; does not wait for the commit. */
void catalogue_event(catalogue *cat, const char *job, int64_t number, const char *type, const char *json);
typedef struct event_row {
  int64_t number;
  char type[16];
  char *json;
} event_row;
/* Lists the events of a job after number `after`, in order. */
int catalogue_events(catalogue *cat, const char *job, int64_t after, int limit, event_row *out);

/* For --check-data. */
int catalogue_integrity(catalogue *cat);
/* PRAGMA quick_check, at the start and in each scrub: reads the whole catalogue. 0 with the first finding in `why`. */
int catalogue_quick_check(catalogue *cat, char *why, size_t size);
/* The number of rows with invalid values; −1 if they cannot be read. */
int64_t catalogue_damaged(catalogue *cat);

#endif
