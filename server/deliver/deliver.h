/* The deliverer: one thread that sends what the outbox holds (store/deliveries.h) to the webhooks, by Standard Webhooks
 * (https://www.standardwebhooks.com).
 *
 * In: rows of the outbox. Out: requests over the network, and their results in the outbox.
 *
 * Contract. A message counts as delivered once its receiver has answered 2xx and this is committed. So the deliverer
 * sends each message at least once, also after a crash; a receiver recognises a repeated message by its webhook-id. The
 * deliverer sends one message at a time to a receiver (an origin, for one tenant), and DELIVER_MOST at a time in all,
 * of which one tenant has at most half. So a receiver that does not answer delays only itself, and memory is bounded.
 * Any other answer is a failure, also a redirect. After a failure the deliverer waits `retry_ms`, and twice as long
 * after each further one, for DELIVER_ATTEMPTS attempts: 23 hours with 5 seconds. It stops at the answer 410.
 */
#ifndef ORB_DELIVER_H
#define ORB_DELIVER_H

#include "net/networks.h"
#include "store/catalogue.h"

enum { DELIVER_MOST = 128, DELIVER_ATTEMPTS = 15 };

typedef struct deliver_options {
  networks allowed;        /* besides public addresses */
  const char *authorities; /* PEM file of certificate authorities; "": those of the system */
  int64_t retry_ms;        /* the first wait after a failure */
  int (*may)(void *user);  /* whether this node sends; NULL: it does */
  void *user;
} deliver_options;

typedef struct deliverer deliverer;
deliverer *deliver_start(const deliver_options *options, catalogue *cat);
/* There may be something new in the outbox. Any thread; user: the deliverer. */
void deliver_wake(void *user);
/* Ends what is in flight without an answer; those messages remain pending. NULL: nothing. */
void deliver_stop(deliverer *d);

/* The wait before the next attempt, after this many failures; −1: no further attempt. chance: from 0 to 1,
 * spreads the wait by a tenth, so that many do not come at once. */
int64_t deliver_wait_ms(int64_t retry_ms, int failed, double chance);

#endif
