/* The last step of a request: adds the headers that every response carries and queues the response. */
#include <stdio.h>
#include <string.h>

#include "http/hosts.h"
#include "http/http.h"

/* Adds the CORS headers. If they depend on the origin, every response carries Vary, even one to an origin that is not
 * allowed or not named, so that a cache does not mix them up (Fetch, "CORS protocol and HTTP caches"). */
static void add_cors(request *r) {
  const char *allowed = r->signer ? r->signer->row.origins : r->srv->options->cors, *origin = header_of(r, "Origin");
  if (r->signer && !allowed[0]) {
    allowed = "*";
  }
  if (!allowed[0]) {
    return;
  }
  int any = strcmp(allowed, "*") == 0;
  if (!any) {
    reply_header(r, "Vary", "Origin");
  }
  if (!r->signer && !origin) {
    return;
  }
  if (!any && (!origin || !origin_is_listed(allowed, origin))) {
    return;
  }
  reply_header(r, "Access-Control-Allow-Origin", any ? "*" : origin);
  reply_header(
      r, "Access-Control-Expose-Headers",
      "Location, Content-Location, Retry-After, ETag, Accept-Ranges, Content-Range, Content-Disposition, "
      "Accept-Encoding, WWW-Authenticate, X-Request-Id, RateLimit, RateLimit-Policy, Preference-Applied, Link");
  if (strcmp(r->method, "OPTIONS") == 0) {
    reply_header(r, "Access-Control-Allow-Methods", "GET, HEAD, POST, DELETE");
    reply_header(r, "Access-Control-Allow-Headers",
                 "Authorization, Content-Type, Content-Encoding, Prefer, Priority, If-Match, If-None-Match, If-Range, "
                 "Range, Last-Event-ID, traceparent");
    reply_header(r, "Access-Control-Max-Age", "600");
  }
}

enum MHD_Result reply_send(request *r) {
  if (!r->response) {
    return MHD_NO; /* out of memory: the connection closes without a response */
  }
  if (r->closes || (r->status >= 400 && r->has_body)) {
    reply_header(r, "Connection", "close");
  }
  access_headers(r);
  if (r->preferred_ms > 0 && r->status < 300) {
    char applied[32];
    snprintf(applied, sizeof applied, "wait=%lld", (long long)((r->preferred_ms + 999) / 1000));
    reply_header(r, "Preference-Applied", applied);
  }
  reply_header(r, "X-Content-Type-Options", "nosniff");
  reply_header(r, "X-Request-Id", r->number);
  add_cors(r);
  watched_answer(r->watched);
  enum MHD_Result result = MHD_queue_response(r->connection, r->status, r->response);
  MHD_destroy_response(r->response);
  r->response = NULL;
  return result;
}
