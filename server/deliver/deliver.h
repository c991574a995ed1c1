/* The deliverer: one thread that sends what the outbox holds (store/deliveries.h) to the webhooks, by Standard Webhooks
 * (https://www.standardwebhooks.com).
 *
 * In: rows of the outbox. Out: requests over the network, and their results in the outbox.
 *
 * Contract. A message counts as delivered when its receiver has answered 2xx, and this is committed. So each message is
 * delivered at least once, also after a crash; a receiver recognises a repeated one by its webhook-id. To one receiver
 * (an origin, for one tenant) goes one message at a time, to all of them together DELIVER_MOST, of which one tenant has
 * at most half, so a receiver that does not answer delays only itself. Memory is bounded by that number. After a
 * failure the wait doubles from `retry_ms`, in DELIVER_ATTEMPTS attempts: 23 hours with 5 seconds. A redirect and any
 * other answer is a failure; 410 is the last one.
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

/* The wait before the next attempt, after so many failed ones; −1: there is no further one. chance: from 0 to 1,
 * spreads the wait by a tenth, so that many do not come at once. */
int64_t deliver_wait_ms(int64_t retry_ms, int failed, double chance);

#endif
