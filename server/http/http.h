/* HTTP over libmicrohttpd. In: connections and requests. Out: responses, and jobs submitted to the queue.
 *
 * Reading order:
 *   server.c     the life of a request: answer() is called for headers, body and response; handlers[] maps each route
 *                of api/routes.h to its handler
 *   guard.c, access.c, browser.c, query.c, body.c   what is checked before a handler runs: headers; limits, token,
 *                tenant; foreign pages (hosts.c: names in Host and Origin); query; body
 *   away.c       how a handler leaves the HTTP thread          read_json.c   JSON of bodies
 *   held.c       the memory that requests hold for their callers
 *   request.c    the clock, and a request's fields in the log
 *   meshes.c     POST /v1/meshes          create.c      POST /v1/embeddings, POST /v1/supermeshes
 *   room.c       room for a new result in the tenant's quota
 *   fetch.c      POST /v1/meshes with a URL
 *   deliveries.c GET and retry of the deliveries of a job's webhooks
 *   landmarks.c  POST /v1/landmarks
 *   morph.c      GET /v1/morph.glb        sign.c, signers.c   signed URLs
 *   resources.c  GET, DELETE and lists of meshes, embeddings, supermeshes and landmarks
 *   object.c     sending stored objects   profile.c     profiles of an asset
 *   files.c      GET of stored objects    disposition.c the names of downloads
 *   jobs.c       GET, DELETE and lists of jobs; waiting for a job
 *   events.c     GET /v1/jobs/{job}/events
 *   usage.c      GET /v1/usage
 *   system.c     /livez, /readyz, /metrics              pages.c       the studio, /openapi.json, /docs
 *   reply.c, send.c   responses; the headers that every response carries; encode.c, encoded.c   compressed responses
 *   listen.c (the socket), watch.c and addresses.c (slow and too many connections), callers.c (tokens in memory),
 *   decode.c (gzip, zstd), parse.c (texts of requests), paging.c (page tokens)
 *
 * A new route: its row in API_ROUTES (api/routes.h), its handler in the file of its resource, its description in
 * api/openapi.json.
 * The text of an error: handlers call reply_refuse() or api_refuse() with the problem's name and its detail, so search
 * for the text here, in server/worker or in api; status and title of each name are in api/problem.c.
 *
 * Contract. A handler runs on a thread that serves many connections, so it only parses, reads memory and makes a
 * response. Anything that needs a query, a commit, a file check or a hash of much data goes away
 * (request_go_away()): the connection is suspended, a task makes the response on another thread and resumes the
 * connection, and libmicrohttpd calls answer() again, which sends it. Waiting for a job works the same way, with the
 * queue in place of the task. Exactly one thread owns a request at any time (handler → task or queue → handler), so a
 * request needs no lock.
 */
#ifndef ORB_HTTP_H
#define ORB_HTTP_H

#include <microhttpd.h>
#include <pthread.h>

#include "api/json.h"
#include "api/problem.h"
#include "api/routes.h"
#include "cache.h"
#include "config.h"
#include "deliver/deliver.h"
#include "http/callers.h"
#include "http/decode.h"
#include "http/encoded.h"
#include "http/held.h"
#include "http/listen.h"
#include "http/parse.h"
#include "http/signers.h"
#include "http/watch.h"
#include "net/url.h"
#include "queue/queue.h"
#include "scrub.h"
#include "tasks.h"
#include "temporary.h"

typedef struct server {
  const config *options;
  catalogue *cat;
  objects *store;
  queue *q;
  cache *descriptions;
  memory_budget *memory;
  temporary *arriving;               /* the temporary files of uploads and downloads */
  tasks *io, *checks, *large_checks; /* large uploads have threads of their own and do not delay small ones */
  listener at;
  watch *connections;
  struct MHD_Daemon *daemon;
  int ready, stopping; /* written under __atomic */
  int64_t decoding;    /* bytes held by the decoders of bodies; __atomic */
  int64_t started_ms;  /* orb_clock_ms() */
  int needs_token;
  int works_only; /* the role work: answers only requests about the node itself */
  int unfit;      /* the catalogue refused to open: see STORE_UNFIT */
  deliverer *outbox;
  scrub *scrub;                            /* NULL: off */
  networks webhook_allowed, fetch_allowed; /* besides public addresses */
  callers *callers;
  signers *signers;
  held *held;
  encoded_cache *encoded;
  int control;           /* the descriptor of the control socket */
  int64_t profiles_made; /* since the start; __atomic */
  unsigned char secret[CATALOGUE_SECRET];
} server;

typedef enum request_phase { PHASE_BODY, PHASE_AWAY, PHASE_WAIT, PHASE_SEND } request_phase;

/* What a request that waits for a job gets when the job succeeds in time; until then and otherwise, the job. */
typedef enum wait_for {
  WAIT_JOB,
  WAIT_RESULT,
  WAIT_ASSET, /* the asset; otherwise a problem */
} wait_for;

typedef struct request request;
struct request {
  task away_task; /* first: a task is the request */
  void (*away)(request *r);
  tasks *next_pool; /* the task that takes the request after this one; NULL: none */
  int64_t next_memory;
  server *srv;
  struct MHD_Connection *connection;
  watched *watched; /* the connection; may be NULL */
  allowance allowance;
  const route *route;
  const char *method;
  char id[API_ID_SIZE];
  int shape;             /* {k} of the path; −1: none */
  int profile;           /* of the asset, an orb_profile */
  request *next_waiting; /* see profile.c */
  /* Makes the supermesh again if it turns out to be damaged while its asset is answered; NULL: the answer is 404. */
  void (*make_again)(request *r);
  char number[24];   /* of the request, for the log and X-Request-Id */
  caller *caller;    /* referenced; NULL where no token is needed */
  signer *signer;    /* referenced; NULL: the URL is not signed */
  int64_t expires;   /* of the signature, Unix time in seconds */
  int64_t retry_s;   /* for Retry-After; 0: the usual */
  int is_unverified; /* the file to send could not be compared with its hash, or could not be moved away */
  int is_away;       /* because S3 does not answer */
  int begun;         /* the headers have arrived */
  int has_body, head;
  int closes; /* the connection closes after this response */
  request_phase phase;
  int64_t began; /* µs */

  decoder *decoder;      /* NULL: the body is plain */
  int64_t decoder_bytes; /* its share of server.decoding */
  held_part body_bytes;  /* of body and decoder, and of the answer's text */
  held_part answer_bytes;
  held_part target_bytes;          /* of a long target */
  uint64_t from;                   /* whose those are: of the address, as no header has arrived before it */
  uint64_t holder;                 /* whose these are, and takes; 0: not known yet, so the request is refused */
  int64_t wire, received, dropped; /* bytes of the body: as sent, decoded, dropped after a refusal */
  int body_done;                   /* the whole body has arrived */
  api_text body;                   /* JSON */
  api_text refusal;                /* body of a refusal that was made while the request's body arrived */
  object_temp temp;                /* upload */
  temporary_file takes;            /* what it counts for on the disk */
  api_hash hash;

  waiter waiter;
  job *waits_for;
  int64_t wait_until;
  int64_t preferred_ms; /* from a Prefer header */
  wait_for waits_for_what;
  int cancels; /* the request cancels waits_for; refused if the job ends in another way */

  unsigned status;
  coding coded;              /* of the answer */
  const encoded *encoded;    /* the answer in memory, referenced; NULL once a response holds it */
  char etag[48];             /* of the form that reply_choose() has chosen */
  int64_t sends;             /* bytes of the response's body; event streams count theirs as they send */
  char trace[TRACE_SIZE];    /* traceparent, if the caller sent a well-formed one */
  char span[TRACE_SIZE];     /* of this request; "": it is not recorded */
  char job[API_JOB_ID_SIZE]; /* that it submitted; "": none */
  struct MHD_Response *response;
  char target[]; /* of the request line, as sent */
};

/* server.c */
int http_start(server *srv);
void http_stop(server *srv);

/* away.c */
/* Suspends the connection and runs fn on a thread of the pool; fn must leave a response or PHASE_WAIT. Returns
 * REQUEST_AWAY, which the handler returns in turn: the task owns the request now, and the handler must not touch it. */
#define REQUEST_AWAY ((enum MHD_Result)2)
enum MHD_Result request_go_away(request *r, tasks *pool, void (*fn)(request *r));
/* Within a task, without a response: the request goes on in a pool as soon as this task has returned. memory: bytes of
 * BUDGET_CHECKS that it needs then. */
void request_go_on(request *r, tasks *pool, int64_t memory, void (*fn)(request *r));
/* Within a task: another thread owns the request from now on, and adds the task again or resumes the connection. */
void request_handed_over(void);

/* request.c: changes what a part of the request holds, body_bytes or answer_bytes. 0: there is no room for more, and
 * nothing changes. */
int request_holds(request *r, held_part *part, int64_t now);

/* guard.c: 1, or 0 with the problem. */
int guard_headers(request *r, const char *version, api_problem *problem);
const char *header_of(const request *r, const char *name);
int is_fetch(const request *r); /* POST /v1/meshes with a URL in JSON instead of a file */
/* All lines of a header that is a list (RFC 9110 section 5.3), at most HEADER_LINES; returns their number. */
enum { HEADER_LINES = 16 };
int header_lines(const request *r, const char *name, const char *out[HEADER_LINES]);

/* query.c */
/* Whether the route takes all parameters of the query: 1, or 0 with the problem. */
int query_check(const request *r, api_problem *problem);
const char *query_of(const request *r, const char *name); /* NULL: absent */
int query_has(const request *r, const char *name);        /* also without a value */

/* sign.c */
/* Checks the signature of the URL, if the route takes one and the URL has one: 1, or 0 with the problem. */
int sign_check(request *r, const char *path, api_problem *problem);
/* Whether the key of the URL may cause more work today: 1, or 0 with the problem. Blocks. */
int sign_may_work(request *r, api_problem *problem);

/* browser.c: 1, or 0 with the problem if a page may have sent the request that is not allowed to. */
int browser_check(const request *r, const char *url, const char *path, api_problem *problem);

/* access.c: 1, or 0 with a response. */
int access_within_limits(request *r, const char *path);
/* Adds RateLimit and RateLimit-Policy (draft-ietf-httpapi-ratelimit-headers) with the limits of the caller. */
void access_headers(request *r);
int access_is_open(const char *path); /* health checks: no token, no limits, any host */
/* 1, or 0 with the problem. */
int access_check(request *r, const char *path, api_problem *problem);
/* The priority of the caller's jobs: first the token's class, then the urgency of the Priority header (RFC 9218,
 * u=0 to 7). */
int access_priority(const request *r);
/* 1 with the scope admin, or where no token is needed: the caller may see the numbers of the whole service. */
int access_is_operator(request *r);
/* Writes a line for the audit log if the caller was refused, or if the request deleted something or read with the scope
 * admin. After the answer; address: NULL, or the client's. */
void access_audit(const request *r, const struct sockaddr *address);
/* The tenant that owns what the caller makes; "" where no token is needed. */
const char *access_tenant(const request *r);
/* The tenant whose resources the caller sees; "" means all of them (scope admin, or no token needed). */
const char *access_view(const request *r);
/* Whether the caller sees a job of this owner. Handlers answer 404 for jobs that the caller does not see. */
int access_sees(const request *r, const char *owner);
/* 1 if the token's quota has room for an upload; 0 with the problem. */
int access_has_room(const request *r, int64_t bytes, api_problem *problem);
/* The most bytes that a file of this caller can have, whether it is known or not; 0: without a quota. */
int64_t access_largest(const request *r);
/* 1 if a file may have so many bytes, known or not; 0 with the problem. */
int access_takes_file(const request *r, int64_t bytes, api_problem *problem);

/* reply.c: each leaves a response. */
void reply_json(request *r, unsigned status, api_text *json); /* frees json */
void reply_problem(request *r, api_problem *problem);         /* frees problem */
void reply_refuse(request *r, const char *name, const char *format, ...) API_PRINTF(3, 4);
/* Refuses the value of a query parameter, which the problem names. */
void reply_bad_query(request *r, const char *parameter, const char *why);
void reply_store(request *r, store_result result);
void reply_empty(request *r, unsigned status);
void reply_bytes(request *r, unsigned status, const char *mime, const void *bytes, size_t size); /* static bytes */
void reply_drop(request *r); /* within a task: takes the response back */
void reply_text(request *r, unsigned status, const char *mime, api_text *text); /* frees text */
/* Chooses the form of an answer that never changes: as it is or, if the client accepts that, compressed. Sets r->etag,
 * and r->coded and r->encoded if it is compressed. key: names the bytes among all answers. bytes NULL: only looks
 * whether it is compressed already; 0 if not, and then nothing is chosen. Ranges are of what is not compressed. */
enum { ENCODE_LEAST = 1024, ENCODE_MOST = 64 << 20 };
int reply_choose(request *r, const char *key, const char *etag, const void *bytes, size_t size);
/* Sends what reply_choose() has compressed. */
void reply_encoded(request *r, unsigned status, const char *mime);
/* Likewise, without headers: sends the bytes of r->encoded. */
void reply_memory(request *r, unsigned status);
/* The description, with ETag and 304; releases the reference. */
void reply_cached(request *r, unsigned status, const cached *entry);
void reply_header(request *r, const char *name, const char *value);
/* Evaluates If-Match and If-None-Match against this tag (RFC 9110 section 13.2.2): 0 if the request may proceed, 1
 * with a response, 412 or 304. */
int reply_conditions(request *r, const char *etag);
/* send.c: adds the headers that every response carries and queues the response. */
enum MHD_Result reply_send(request *r);

/* pages.c: what is compiled in. */
int is_page(const char *path);
void handle_page(request *r, const char *path);

/* Handlers. server.c calls them when the whole body has arrived; the two of an upload run while it arrives. */
void handle_mesh_begin(request *r);
void handle_mesh_bytes(request *r, const char *bytes, size_t size);
void upload_abandon(request *r);              /* deletes the temporary file of an upload, if there is one */
enum MHD_Result handle_mesh_file(request *r); /* when all of it has arrived */
#define DECLARE(id, method, path, body, scope, query, handler) enum MHD_Result handler(request *r);
API_ROUTES(DECLARE)
#undef DECLARE
/* In PHASE_WAIT: keeps waiting, or leaves the response. */
enum MHD_Result handle_wait(request *r);

/* A page of a list: space for limit + 1 rows, and the JSON written so far. */
typedef struct list_page {
  int limit;
  int64_t before;
  const char *prefix; /* of the ids; NULL: any */
  void *rows;         /* of malloc() */
  api_text json;
} list_page;
int list_begin(request *r, const char *name, size_t row_size, list_page *page); /* 0 with a response */
/* Frees the page and leaves a response. last: sequence number of the page's last row; count: rows found, −1 if they
 * could not be read. */
void list_end(request *r, list_page *page, int64_t last, int count);
/* A request for a job that was read and validated. The caller frees canonical. */
typedef struct wanted_result {
  resource_kind kind;
  char id[API_ID_SIZE]; /* of the result; of a mesh from a URL: the job's key */
  api_text canonical;
  int64_t cost;
  net_url webhook; /* text "": none */
  unsigned events; /* that the webhook receives, see api/webhook_codec.h */
} wanted_result;
/* Whether the service may connect to a URL of the request: 1, or 0 with the problem. where: names the member. */
int check_url(const char *where, const char *url, const networks *allowed, net_url *out, api_problem *problem);
/* Takes the member "webhook" out of the body: 1, or 0 with the problem. */
int read_webhook(request *r, cJSON *body, wanted_result *out, api_problem *problem);
/* Reads the body of a request for a supermesh. Blocks. 1, or 0 with the problem. */
int wanted_supermesh(request *r, const cJSON *body, wanted_result *out, api_problem *problem);
/* Submits the job; leaves a response, or PHASE_WAIT. Blocks. */
void submit_wanted(request *r, const wanted_result *wish);
/* object.c */
/* A part of an object, served like a file of its own; length 0: the whole object. */
typedef struct object_part {
  uint64_t start, length;
} object_part;
/* Respond with an object of this SHA-256, with ranges and conditions. disposition: the value of that header. 0 without
 * a response outside a task, if one is needed to compress the object. */
int reply_part(request *r, object_kind kind, const char *id, object_part part, const char *sha, const char *mime,
               const char *disposition);
int reply_object(request *r, object_kind kind, const char *id, const char *sha, const char *mime,
                 const char *disposition);
/* Whether the object may be sent: 1 once it has been verified, or found wrong and moved out of the store, where sending
 * it answers 404. 0 outside a task: it has to be read. sha: see store/verify.h. */
int object_is_ready(request *r, object_kind kind, const char *sha);
/* The asset of a supermesh in the profile of the request, if that is stored; releases the description. 0 without a
 * response if it is not, or a task is needed to compress it. */
int reply_stored_asset(request *r, const cached *entry);
/* The kind of the resource whose file the route serves. */
resource_kind object_owner(const request *r);
/* After a 404 for an object: distinguishes one that has just been deleted from one that is lost. Blocks. */
void reply_lost(request *r);
/* profile.c: reads ?profile=. 1, or 0 with a response. */
int profile_read(request *r);
/* The same as reply_stored_asset() for every caller: if the profile is not stored, a request in a task goes on to make
 * it, and has a response or goes on when this returns 1. 0: outside a task. */
int reply_asset(request *r, const cached *entry);
/* The problem document of a job. */
void reply_job_problem(request *r, const char *json);
/* A request may name stored landmarks by {"id": ID}: replaces that member with their array. Blocks. 1, or 0 with the
 * problem. */
int resolve_landmarks(request *r, cJSON *body, api_problem *problem);
/* How long to wait by ?wait= or Prefer: wait=, in ms, at most 60 s; 0: do not wait; −1: malformed, with a response. */
enum { WAIT_MOST_MS = 60000 };
int64_t read_wait_ms(request *r);
/* The description as a tenant sees it (view "": any), from the cache or the catalogue; blocks. NULL with *result. */
const cached *find_description(server *srv, resource_kind kind, const char *id, const char *view, store_result *result);
/* Records in the catalogue that a cached description was used, for eviction. Does not block. */
void note_use(server *srv, const cached *entry);
/* JSON members for the log: the request's number, trace and route. */
enum { REQUEST_FIELDS = 256 };
void request_fields(const request *r, char out[REQUEST_FIELDS]);
int64_t clock_us(void);
/* Whether the service runs on and the client of the request (user) is there. A client that has closed its end for
 * writing only still gets the answer of work that takes less than a second. For convert_limits and intake_limits. */
int request_is_wanted(void *user);

#endif
