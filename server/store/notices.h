/* A node's own connection to PostgreSQL: it receives notices of changes that nodes make, renews the node's lease, and
 * holds the lock of housekeeping. One thread uses it. */
#ifndef ORB_STORE_NOTICES_H
#define ORB_STORE_NOTICES_H

#include <stdint.h>

#include "store/objects.h"

typedef struct notices notices;

notices *notices_open(const char *url); /* NULL: out of memory */
void notices_close(notices *n);
/* Connects if there is no connection. Returns whether there is one. *fresh: it is new, so notices may have been lost.
 */
int notices_connect(notices *n, int *fresh);
/* Waits at most this long for notices, and calls `each` for those that came. A notice is a letter and what it is about:
 * q, f (a job that computes or downloads can be claimed), j (a job has changed), e (a job has an event), c (a job is to
 * be cancelled), r (a kind, and the id of a row that has changed or gone), t (tokens or keys have changed). */
void notices_wait(notices *n, int ms, void (*each)(void *user, const char *text), void *user);
/* Renews the lease of the node for this long from now. 0: not done. */
int notices_renew(notices *n, const char *node, int workers, int64_t lease_ms);
/* Ends the lease: the node no longer runs jobs. */
void notices_leave(notices *n, const char *node);
/* Whether this node does the housekeeping. If no node does, this one takes it over. */
int notices_does_housekeeping(notices *n);

#endif
