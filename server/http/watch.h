/* Every connection, seen from outside the HTTP library: who it is from, how long it takes, how it ends.
 *
 * The library closes connections that are silent for idle-seconds; one that sends a byte now and then it keeps for
 * ever. A thread here ends those whose headers are not whole after header-seconds, and those that move a body or an
 * answer slower than min-rate over slow-seconds. A suspended request and an event stream with nothing to send are
 * not slow.
 *
 * Addresses (of IPv6 their /64) have a number of connections and a bucket of requests, where limits hold for them.
 *
 * A connection that ends with an answer while its body is still coming would be reset by the kernel, and the reset may
 * overtake the answer. So its socket is read on for a while after the library closed it (lingering close).
 */
#ifndef ORB_HTTP_WATCH_H
#define ORB_HTTP_WATCH_H

#include <stdint.h>
#include <sys/socket.h>

#include "config.h"

typedef struct watch watch;
typedef struct watched watched;

watch *watch_start(const config *options, int tokens); /* tokens: callers need one; NULL: out of memory or threads */
void watch_stop(watch *w);

/* For a new connection; NULL out of memory: it is then not watched. */
watched *watch_open(watch *w, int fd, const struct sockaddr *address);
void watch_close(watch *w, watched *c); /* before the descriptor is closed */

/* Steps of a request. NULL is fine. */
void watched_headers(watched *c); /* whole */
void watched_body(watched *c, int64_t bytes);
void watched_work(watched *c); /* the body is there; nothing is expected of the client */
void watched_answer(watched *c);
void watched_done(watched *c); /* the next request may come */
void watched_linger(watched *c);

/* What the caller's address has left. */
typedef struct allowance {
  int limited;                        /* 0: no limits hold for it */
  int refused;                        /* 0, 1: too many requests, 2: too many connections */
  int64_t quota, window, left, reset; /* requests, s, requests, s */
} allowance;
void watched_take_request(watched *c, allowance *out);

#endif
