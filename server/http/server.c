/* The life of a request, and of the daemon that serves them. */
#include <pthread.h>
#include <sodium.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#if defined(__GLIBC__)
#include <malloc.h>
#endif

#include "faults.h"
#include "hash.h"
#include "http/addresses.h"
#include "http/body.h"
#include "http/certificate.h"
#include "http/http.h"
#include "http/regions.h"
#include "http/target.h"
#include "log.h"
#include "metrics.h"

#define HANDLER(id, method, path, body, scope, query, handler) [id] = handler,
static enum MHD_Result (*const handlers[ROUTE_COUNT])(request *) = {API_ROUTES(HANDLER)};
#undef HANDLER

/* No route: a page, OPTIONS, 405 or 404. */
static void answer_unrouted(request *r, const char *path, const char *allow) {
  char methods[80];
  snprintf(methods, sizeof methods, "%s, OPTIONS", allow[0] ? allow : "GET, HEAD");
  int page = !allow[0] && is_page(path), get = strcmp(r->method, "GET") == 0 || r->head;
  if (page && get) {
    handle_page(r, path);
  } else if (!allow[0] && !page) {
    reply_refuse(r, "not-found", "Nothing exists at this path; /openapi.json lists all routes.");
  } else if (strcmp(r->method, "OPTIONS") == 0) {
    reply_empty(r, 204);
    reply_header(r, "Allow", methods);
  } else {
    reply_refuse(r, "method-not-allowed", "This path does not accept the method of the request, only %s.", methods);
    reply_header(r, "Allow", methods);
  }
}

static unsigned char number_key[crypto_shorthash_KEYBYTES];
_Static_assert(crypto_shorthash_BYTES == sizeof(uint64_t), "a request's number is one hash");

static void make_number_key(void) {
  crypto_shorthash_keygen(number_key);
}

/* Sixteen hexadecimal digits, different for each request: a keyed hash of a counter, so that a caller cannot tell how
 * many requests others make. */
static void make_number(char out[2 * sizeof(uint64_t) + 1]) {
  static pthread_once_t once = PTHREAD_ONCE_INIT;
  static uint64_t numbers;
  uint64_t number = __atomic_add_fetch(&numbers, 1, __ATOMIC_RELAXED);
  unsigned char hashed[crypto_shorthash_BYTES];
  pthread_once(&once, make_number_key);
  crypto_shorthash(hashed, (const unsigned char *)&number, sizeof number, number_key);
  sodium_bin2hex(out, 2 * sizeof hashed + 1, hashed, sizeof hashed);
}

/* Whose part of the memory a request without a tenant takes. */
static uint64_t holder_at(struct MHD_Connection *connection) {
  const union MHD_ConnectionInfo *from = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CLIENT_ADDRESS);
  return from && from->client_addr ? address_hash(from->client_addr) | HASH_OF_OWNER : HASH_OF_OWNER;
}

enum { TARGET_SHORT = 512 }; /* bytes that do not count */

/* Called with the target of the request line, before any header has arrived. The library keeps no copy of the target
 * as sent, which signatures cover. */
static void *request_create(void *user, const char *target, struct MHD_Connection *connection) {
  size_t size = strlen(target) + 1;
  char number[sizeof((request *)NULL)->number];
  make_number(number);
  if (target_refused(target, number, connection)) {
    return NULL; /* the library may drop the connection without another call, so nothing is allocated */
  }
  server *srv = user;
  held_part bytes = {0};
  const uint64_t from = holder_at(connection);
  if (size > TARGET_SHORT && !held_set(srv->held, from, &bytes, (int64_t)size)) {
    target_lacks_room(number, connection);
    return NULL;
  }
  request *r = calloc(1, sizeof *r + size);
  if (!r) {
    held_set(srv->held, from, &bytes, 0);
  } else {
    r->from = from;
    r->target_bytes = bytes;
    r->srv = srv;
    r->connection = connection;
    memcpy(r->target, target, size);
    const union MHD_ConnectionInfo *info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_SOCKET_CONTEXT);
    r->watched = info ? info->socket_context : NULL;
    r->temp.fd = -1;
    r->began = clock_us();
    memcpy(r->number, number, sizeof number);
  }
  return r;
}

/* A node of the role work. */
static int is_about_node(const request *r, const char *path) {
  return access_is_open(path) || (r->route && r->route->id == ROUTE_METRICS);
}

/* Whose part of memory and disk the request takes: its tenant's or, without one, that of its address. */
static uint64_t holder_of(const request *r) {
  const char *tenant = access_tenant(r);
  return tenant[0] ? tenant_hash(tenant) : r->from;
}

/* What the headers of an admitted request decide. */
static void request_admit(request *r, const char *path, const char *allow) {
  api_problem problem = {0};
  r->holder = holder_of(r);
  if (!r->route) {
    answer_unrouted(r, path, allow);
  } else if (!query_check(r, &problem)) {
    reply_problem(r, &problem);
  } else if (r->route->body != ROUTE_NO_BODY) {
    body_begin(r);
  }
}

/* The first call of answer() for a request, with its headers. Leaves a response if the headers alone decide it. */
static void request_begin(request *r, const char *method, const char *url, const char *version) {
  const char *path = parse_target(url);
  char allow[64];
  api_problem problem = {0};
  r->begun = 1;
  r->method = method;
  r->head = strcmp(method, "HEAD") == 0;
  r->route = api_route_find(r->method, path, r->id, allow);
  watched_headers(r->watched);
  r->shape = r->route ? api_route_number(r->route, path) : -1;
  parse_trace(header_of(r, "traceparent"), r->trace);
  if (!is_about_node(r, path)) {
    trace_begin(r->trace, r->span);
  }
  if (!guard_headers(r, version, &problem)) {
    r->closes = 1;
    reply_problem(r, &problem);
  } else if (!access_within_limits(r, path)) {
    return;
  } else if (r->srv->works_only && !is_about_node(r, path)) {
    reply_refuse(r, "not-found", "This node runs jobs and serves only /metrics, /livez and /readyz.");
  } else if (!sign_check(r, path, &problem) || !browser_check(r, url, path, &problem) ||
             !access_check(r, path, &problem)) {
    reply_problem(r, &problem);
  } else {
    request_admit(r, path, allow);
  }
}

/* Keeps %00 escaped: unescaped it would end the string, and "/%00" would become "/". */
static size_t unescape(void *user, struct MHD_Connection *connection, char *text) {
  (void)user;
  (void)connection;
  const char *escape = strchr(text, '%');
  return !escape || strstr(escape, "%00") ? strlen(text) : MHD_http_unescape(text);
}

static enum MHD_Result answer(void *user, struct MHD_Connection *connection, const char *url, const char *method,
                              const char *version, const char *upload, size_t *upload_size, void **state) {
  request *r = *state;
  (void)user;
  (void)connection;
  if (!r) { /* out of memory, or answered past the library */
    return MHD_NO;
  }
  if (!r->begun && target_headers_refused(r->number, connection)) {
    return MHD_NO;
  }
  if (!r->begun) {
    request_begin(r, method, url, version);
    if (!r->has_body) {
      watched_work(r->watched);
    }
    return r->phase == PHASE_SEND && r->has_body ? reply_send(r) : MHD_YES;
  }
  if (*upload_size) {
    size_t size = *upload_size;
    *upload_size = 0;
    watched_body(r->watched, (int64_t)size);
    return body_take(r, upload, size) ? MHD_YES : MHD_NO;
  }
  enum MHD_Result result = MHD_YES;
  if (r->has_body && !r->body_done) {
    r->body_done = 1;
    watched_work(r->watched);
    body_end(r);
  }
  if (r->phase == PHASE_BODY) {
    result = handlers[r->route->id](r);
  } else if (r->phase == PHASE_WAIT) {
    result = handle_wait(r);
  }
  if (result == REQUEST_AWAY) {
    return MHD_YES;
  }
  return result == MHD_YES && r->phase == PHASE_SEND ? reply_send(r) : result;
}

static void record_span(const request *r, int64_t took_us) {
  char name[96], method[16]; /* of a caller, who may send anything */
  const int64_t end = trace_now_us();
  const char *where = r->route ? r->route->path : "";
  snprintf(method, sizeof method, "%s", r->method);
  snprintf(name, sizeof name, "%s%s%s", method, r->route ? " " : "", where);
  trace_end(&(trace_span){.self = r->span,
                          .parent = r->trace,
                          .name = name,
                          .kind = TRACE_SERVER,
                          .start_us = end - took_us,
                          .end_us = end,
                          .error = r->status >= 500 ? "the daemon failed"
                                   : r->status      ? NULL
                                                    : "no answer was sent",
                          .attributes = {{"http.request.method", method, 0},
                                         {"http.response.status_code", NULL, r->status},
                                         {"orbmorph.request", r->number, 0},
                                         {r->route ? "http.route" : NULL, where, 0},
                                         {r->job[0] ? "orbmorph.job" : NULL, r->job, 0}}});
}

static void completed(void *user, struct MHD_Connection *connection, void **state,
                      enum MHD_RequestTerminationCode code) {
  request *r = *state;
  (void)user;
  if (!r) {
    return;
  }
  int64_t took = clock_us() - r->began;
  held_set(r->srv->held, r->from, &r->target_bytes, 0);
  if (!r->begun) { /* the connection broke before the headers were complete */
    free(r);
    *state = NULL;
    return;
  }
  record_span(r, took);
  int waited = r->waits_for != NULL || (r->route && r->route->id == ROUTE_JOB_EVENTS);
  metrics_request((int)r->status, waited ? -1 : 1e-6 * (double)took);
  if (code == MHD_REQUEST_TERMINATED_COMPLETED_OK && !r->head) {
    metrics_bytes(0, r->sends);
  }
  int slow = took > 1000 * r->srv->options->slow_ms && !waited;
  if (slow || r->status >= 500 || log_wants(LOG_DEBUG)) {
    char fields[REQUEST_FIELDS + 80];
    request_fields(r, fields);
    size_t n = strlen(fields);
    snprintf(fields + n, sizeof fields - n, ",\"status\":%u,\"ms\":%lld", r->status, (long long)(took / 1000));
    log_write(slow || r->status >= 500 ? LOG_WARN : LOG_DEBUG, fields, "%s", slow ? "slow request" : "request");
  }
  const union MHD_ConnectionInfo *client = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CLIENT_ADDRESS);
  access_audit(r, client ? client->client_addr : NULL);
  if (r->has_body && !r->body_done && (r->closes || r->status >= 400)) {
    watched_linger(r->watched);
  }
  watched_done(r->watched);
  queue_release(r->srv->q, r->waits_for);
  upload_abandon(r);
  body_free(r);
  api_text_free(&r->refusal);
  if (r->response) {
    MHD_destroy_response(r->response);
  }
  request_holds(r, &r->answer_bytes, 0);
  caller_release(r->caller);
  signer_release(r->signer);
  encoded_release(r->encoded);
  free(r);
  *state = NULL;
}

static void on_connection(void *user, struct MHD_Connection *connection, void **state,
                          enum MHD_ConnectionNotificationCode code) {
  server *srv = user;
  int started = code == MHD_CONNECTION_NOTIFY_STARTED;
  metrics_connection(started ? 1 : -1);
  if (!started) {
    watch_close(srv->connections, *state);
    return;
  }
  const union MHD_ConnectionInfo *fd = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD);
  const union MHD_ConnectionInfo *from = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CLIENT_ADDRESS);
  *state = fd ? watch_open(srv->connections, fd->connect_fd, from ? from->client_addr : NULL) : NULL;
}

static void on_mhd_log(void *user, const char *format, va_list args) {
  char text[512];
  (void)user;
  vsnprintf(text, sizeof text, format, args);
  text[strcspn(text, "\n")] = 0;
  log_write(LOG_DEBUG, NULL, "http: %s", text);
}

/* GnuTLS would also offer TLS 1.0 and 1.1, which RFC 8996 forbids. */
static const char TLS_VERSIONS[] = "NORMAL:-VERS-ALL:+VERS-TLS1.3:+VERS-TLS1.2";

/* Blocks of 128 KB and more go back to the system when they are freed. Without this, the C library would raise that
 * size after the first large body, and keep all that follow in the heaps of its threads. */
static void give_back_large_blocks(void) {
#if defined(__GLIBC__)
  (void)mallopt(M_MMAP_THRESHOLD, 128 << 10);
  (void)mallopt(M_TRIM_THRESHOLD, 1 << 20);
#endif
}

int http_start(server *srv) {
  const config *o = srv->options;
  int tls = o->tls_key[0] != 0;
  if (tls && !certificate_load(o->tls_certificate, o->tls_key)) {
    return 0;
  }
  if (catalogue_secret(srv->cat, srv->secret) != STORE_OK) {
    log_error("the catalogue has no secret for page tokens");
    return 0;
  }
  regions_in(o->data);
  give_back_large_blocks();
  srv->held = held_create(o->request_memory);
  srv->encoded = srv->held ? encoded_open((size_t)o->encoded_bytes, srv->held) : NULL;
  srv->connections = srv->encoded ? watch_start(o, srv->needs_token) : NULL;
  if (!srv->connections) {
    log_error("the thread that watches connections cannot be started");
    return 0;
  }
  unsigned flags = MHD_USE_EPOLL_INTERNAL_THREAD | MHD_USE_ITC | MHD_ALLOW_SUSPEND_RESUME | MHD_USE_ERROR_LOG |
                   (unsigned)(tls ? MHD_USE_TLS : MHD_USE_TURBO);
  struct MHD_OptionItem options[] = {
      {MHD_OPTION_THREAD_POOL_SIZE, (intptr_t)o->http_threads, NULL},
      {MHD_OPTION_LISTEN_SOCKET, srv->at.fd, NULL},
      {MHD_OPTION_CONNECTION_MEMORY_LIMIT, TARGET_MEMORY, NULL},
      {MHD_OPTION_CONNECTION_LIMIT, (intptr_t)o->max_connections, NULL},
      {MHD_OPTION_CONNECTION_TIMEOUT, (intptr_t)o->idle_seconds, NULL},
      {MHD_OPTION_NOTIFY_COMPLETED, (intptr_t)completed, srv},
      {MHD_OPTION_NOTIFY_CONNECTION, (intptr_t)on_connection, srv},
      {tls ? MHD_OPTION_HTTPS_CERT_CALLBACK2 : MHD_OPTION_END, 0, certificate_callback()},
      {MHD_OPTION_HTTPS_PRIORITIES, 0, (void *)(uintptr_t)TLS_VERSIONS},
      {MHD_OPTION_END, 0, NULL}};
  srv->daemon = MHD_start_daemon(flags, 0, NULL, NULL, answer, srv, MHD_OPTION_EXTERNAL_LOGGER, on_mhd_log, NULL,
                                 MHD_OPTION_UNESCAPE_CALLBACK, unescape, NULL, MHD_OPTION_URI_LOG_CALLBACK,
                                 request_create, srv, MHD_OPTION_ARRAY, options, MHD_OPTION_END);
  if (!srv->daemon) {
    log_error("the HTTP service cannot be started on %s", srv->at.text);
  }
  return srv->daemon != NULL;
}

void http_stop(server *srv) {
  if (srv->daemon) {
    MHD_stop_daemon(srv->daemon);
    srv->daemon = NULL;
  }
  certificate_free();
  watch_stop(srv->connections);
  srv->connections = NULL;
  encoded_close(srv->encoded);
  held_destroy(srv->held);
  srv->encoded = NULL;
  srv->held = NULL;
}
