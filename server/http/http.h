/* Serving requests over libmicrohttpd: the request, its phases, and what handlers share.
 *
 * Contract. A handler runs on a thread that serves many connections, so it only parses, looks into memory, and makes
 * a response. What needs a query, a commit, a file to be checked, or a hash over much goes away: the connection is
 * suspended, a task runs on another thread, makes the response, and resumes the connection; then the handler is called
 * again and sends it. Waiting for a job is the same with the queue in place of the task. A request belongs to exactly
 * one thread at any time, which is why it needs no lock: handler → task or queue → handler.
 */
#ifndef ORB_HTTP_H
#define ORB_HTTP_H

#include <microhttpd.h>
#include <pthread.h>

#include "api/problem.h"
#include "api/routes.h"
#include "cache.h"
#include "config.h"
#include "http/callers.h"
#include "http/decode.h"
#include "http/listen.h"
#include "http/parse.h"
#include "http/watch.h"
#include "queue/queue.h"
#include "tasks.h"

typedef struct server {
  const config *options;
  catalogue *cat;
  objects *store;
  queue *q;
  cache *descriptions;
  tasks *io, *checks, *large_checks; /* large uploads do not stand before small ones */
  listener at;
  watch *connections;
  struct MHD_Daemon *daemon;
  int ready, stopping; /* written under __atomic */
  int64_t decoding;    /* bytes that decoders of bodies hold; __atomic */
  int64_t started;
  int needs_token;
  callers *callers;
  int control; /* the descriptor of the control socket */
  unsigned char secret[CATALOGUE_SECRET];
} server;

typedef enum request_phase { PHASE_BODY, PHASE_AWAY, PHASE_WAIT, PHASE_SEND } request_phase;

typedef struct request request;
struct request {
  task away_task; /* first: a task is the request */
  void (*away)(request *r);
  server *srv;
  struct MHD_Connection *connection;
  watched *watched; /* the connection; may be NULL */
  allowance allowance;
  const route *route;
  const char *method;
  char id[API_ID_SIZE];
  int shape;       /* {k} of the path; −1: none */
  char number[24]; /* of the request, for the log and X-Request-Id */
  caller *caller;  /* referenced; NULL where no token is needed */
  int has_body, head;
  int closes; /* the connection ends with this answer */
  request_phase phase;
  int64_t began; /* µs */

  decoder *decoder;                /* NULL: the body is plain */
  int64_t decoder_bytes;           /* as counted in server.decoding */
  int64_t wire, received, dropped; /* bytes of the body: as they came, decoded, after a refusal */
  int body_done;                   /* all of it came */
  api_text body;                   /* JSON */
  api_text refusal;                /* the text of a refusal that was made while the body came */
  object_temp temp;                /* upload */
  api_hash hash;

  waiter waiter;
  job *waits_for;
  int64_t wait_until;
  int64_t preferred_ms; /* by a Prefer header */
  int wait_for_result;  /* the answer is the result where there is one in time */
  int cancels;          /* a job that waits_for names; the answer is a refusal where it ended otherwise */

  unsigned status;
  int64_t sends;          /* bytes of the response's body; streams count theirs as they go */
  char trace[TRACE_SIZE]; /* traceparent, where the caller sent a well-formed one */
  struct MHD_Response *response;
};

/* server.c */
int http_start(server *srv);
void http_stop(server *srv);

/* request.c */
/* Suspends and runs fn on a thread of the pool; fn must leave a response or PHASE_WAIT. Returns REQUEST_AWAY, which a
 * handler passes on: from here the request belongs to the task and must not be looked at. */
#define REQUEST_AWAY ((enum MHD_Result)2)
enum MHD_Result request_go_away(request *r, tasks *pool, void (*fn)(request *r));

/* guard.c: 1, or 0 with the problem. */
int guard_headers(request *r, const char *version, api_problem *problem);
const char *header_of(const request *r, const char *name);
/* Of a header that is a list, every line of it that came (RFC 9110 section 5.3), at most so many; how many. */
enum { HEADER_LINES = 16 };
int header_lines(const request *r, const char *name, const char *out[HEADER_LINES]);
const char *query_of(const request *r, const char *name);
int query_has(const request *r, const char *name); /* also without a value */

/* access.c: 1, or 0 with a response. */
int access_within_limits(request *r, const char *path);
/* RateLimit and RateLimit-Policy (draft-ietf-httpapi-ratelimit-headers) of what holds for the caller. */
void access_headers(request *r);
/* 1, or 0 with the problem. */
int access_check(request *r, const char *path, api_problem *problem);
/* Its priority in the queue: the token's, then what the Priority header says (RFC 9218, u=0 to 7). */
int access_priority(const request *r);
/* Whether it may look behind the scenes: with the scope admin, or where no token is needed. */
int access_is_operator(const request *r);
/* Tenants. Whose the caller's requests are; "" where no token is needed. */
const char *access_tenant(const request *r);
/* Through whose eyes it sees: its tenant's, or "" for all there is, with the scope admin or where no token is needed.
 */
const char *access_view(const request *r);
/* Whether it sees what a tenant asked for. What it does not see is not there for it. */
int access_sees(const request *r, const char *owner);
/* Room for an upload in the token's quota; 0 with the problem. */
int access_has_room(const request *r, int64_t bytes, api_problem *problem);

/* reply.c: each leaves a response. */
void reply_json(request *r, unsigned status, api_text *json); /* takes json */
void reply_problem(request *r, api_problem *problem);         /* frees problem */
void reply_refuse(request *r, const char *name, const char *format, ...) ORB_PRINTF(3, 4);
void reply_store(request *r, store_result result);
void reply_empty(request *r, unsigned status);
void reply_bytes(request *r, unsigned status, const char *mime, const void *bytes, size_t size); /* static bytes */
void reply_text(request *r, unsigned status, const char *mime, api_text *text);                  /* takes text */
/* The description, with ETag and 304; takes the reference. */
void reply_cached(request *r, unsigned status, const cached *entry);
void reply_header(request *r, const char *name, const char *value);
/* Conditions of the request on what has this tag (RFC 9110 section 13.2.2): 0 where it is to be done, 1 with the
 * response, 412 or 304. */
int reply_conditions(request *r, const char *etag);
/* send.c: adds the headers that every response carries and queues the response. */
enum MHD_Result reply_send(request *r);

/* pages.c: what is compiled in. */
int is_page(const char *path);
void handle_page(request *r, const char *path);

/* files.c: an object with ranges and conditions. */
void reply_object(request *r, object_kind kind, const char *id, const char *sha, const char *mime, const char *name);

/* Handlers; called when the whole body is there. */
void handle_mesh_begin(request *r); /* before the first byte of an upload */
void handle_mesh_bytes(request *r, const char *bytes, size_t size);
enum MHD_Result handle_mesh_upload(request *r);
enum MHD_Result handle_list(request *r);
enum MHD_Result handle_get(request *r);
enum MHD_Result handle_delete(request *r);
enum MHD_Result handle_file(request *r);
enum MHD_Result handle_create(request *r);
enum MHD_Result handle_job_list(request *r);
enum MHD_Result handle_job_get(request *r);
enum MHD_Result handle_job_cancel(request *r);
enum MHD_Result handle_job_events(request *r);
enum MHD_Result handle_system(request *r);
/* In PHASE_WAIT: waits on, or leaves the response. */
enum MHD_Result handle_wait(request *r);

/* Reads limit and page_token. 1, or 0 with a response. */
int read_page(request *r, int *limit, int64_t *before);
/* A page of a list: room for limit + 1 rows, and the JSON so far. */
typedef struct list_page {
  int limit;
  int64_t before;
  void *rows; /* of malloc() */
  api_text json;
} list_page;
int list_begin(request *r, const char *name, size_t row_size, list_page *page); /* 0 with a response */
/* Takes the page; last: the sequence number of its last row; count: of the rows found, −1 where they cannot be read. */
void list_end(request *r, list_page *page, int64_t last, int count);
/* Seconds to wait by ?wait= or Prefer: wait=, clamped to 60; 0: not. −1: bad, with a response. */
int64_t read_wait_ms(request *r);
/* As a tenant sees it ("": everything), from the cache or the catalogue; blocks. NULL with *result. */
const cached *find_description(server *srv, resource_kind kind, const char *id, const char *view, store_result *result);
/* Of a description that the cache had: says so to the catalogue, for eviction. Does not wait. */
void note_use(server *srv, const cached *entry);
/* Members for the log: the request's number, its trace and route. */
enum { REQUEST_FIELDS = 256 };
void request_fields(const request *r, char out[REQUEST_FIELDS]);
int64_t clock_us(void);

#endif
