/* What all handlers share: the clock, and a request's fields in the log. */
#include <stdio.h>
#include <time.h>

#include "http/http.h"

int64_t clock_us(void) {
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}

void request_fields(const request *r, char out[REQUEST_FIELDS]) {
  snprintf(out, REQUEST_FIELDS, "\"request\":\"%s\"%s%s%s,\"method\":\"%.8s\",\"route\":\"%s\"", r->number,
           r->trace[0] ? ",\"traceparent\":\"" : "", r->trace, r->trace[0] ? "\"" : "",
           r->route ? r->route->method : "", r->route ? r->route->path : "");
}
