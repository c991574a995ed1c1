/* Limits on connections that libmicrohttpd does not have: slow clients, limits per address, lingering close.
 *
 * libmicrohttpd closes connections that are silent for idle-seconds, but keeps one that sends a byte now and then. A
 * thread here closes connections whose headers are incomplete after header-seconds, and those that transfer a body or
 * a response more slowly than min-rate, measured over slow-seconds. A suspended request and an event stream with
 * nothing to send do not count as slow. It also closes connections whose client has left in the middle of a body.
 *
 * An address (for IPv6 its /64) has a limit on connections and a bucket of requests, see addresses.h.
 *
 * If a connection closes after a response while its body still arrives, the kernel resets it, and the reset may
 * overtake the response. So its socket is read for a while after libmicrohttpd closed it (lingering close).
 */
#ifndef ORB_HTTP_WATCH_H
#define ORB_HTTP_WATCH_H

#include <stdint.h>
#include <sys/socket.h>

#include "config.h"

typedef struct watch watch;
typedef struct watched watched;

watch *watch_start(const config *options, int tokens); /* tokens: requests need one; NULL: out of memory or threads */
void watch_stop(watch *w);

/* For a new connection; NULL if out of memory: the connection is then not watched. */
watched *watch_open(watch *w, int fd, const struct sockaddr *address);
void watch_close(watch *w, watched *c); /* before the descriptor is closed */

/* Steps of a request. c may be NULL. */
void watched_headers(watched *c); /* the headers are complete */
void watched_body(watched *c, int64_t bytes);
void watched_work(watched *c); /* the body is complete; the client need not send anything */
void watched_answer(watched *c);
void watched_done(watched *c); /* the next request may come */
void watched_linger(watched *c);

/* The limits of the client's address, and what is left of them. */
typedef struct allowance {
  int limited;                        /* 0: the address has no limits */
  int refused;                        /* 0, 1: too many requests, 2: too many connections */
  int64_t quota, window, left, reset; /* requests, s, requests, s */
} allowance;
void watched_take_request(watched *c, allowance *out);

#endif
