/* What all handlers share: the clock, a request's fields in the log, and the memory that it holds. */
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "http/http.h"

enum { HALF_OPEN_US = 1000000 };

int64_t clock_us(void) {
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}

int request_is_wanted(void *user) {
  const request *r = user;
  const union MHD_ConnectionInfo *fd = MHD_get_connection_info(r->connection, MHD_CONNECTION_INFO_CONNECTION_FD);
  struct pollfd look = {.fd = fd ? fd->connect_fd : -1, .events = POLLRDHUP};
  if (__atomic_load_n(&r->srv->stopping, __ATOMIC_ACQUIRE)) {
    return 0;
  }
  return poll(&look, 1, 0) <= 0 || clock_us() - r->began < HALF_OPEN_US;
}

int request_holds(request *r, held_part *part, int64_t now) {
  return held_set(r->srv->held, r->holder, part, now);
}

/* Of a path without such a route, the method is whatever the caller sent. */
static const char *method_of(const request *r) {
  static const char letters[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZ";
  const char *sent = r->method ? r->method : "";
  return r->route ? r->route->method : sent[strspn(sent, letters)] == 0 ? sent : "";
}

void request_fields(const request *r, char out[REQUEST_FIELDS]) {
  snprintf(out, REQUEST_FIELDS, "\"request\":\"%s\"%s%s%s,\"method\":\"%.8s\",\"route\":\"%s\"", r->number,
           r->trace[0] ? ",\"traceparent\":\"" : "", r->trace, r->trace[0] ? "\"" : "", method_of(r),
           r->route ? r->route->path : "");
}
