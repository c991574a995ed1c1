/* Connections and request rate of each client address. Not locked: watch.c calls it under its own lock.
 *
 * Each address has a token bucket that holds the requests of ADDRESS_WINDOW seconds and fills at the allowed rate, so
 * short bursts pass. An entry lives while it has connections or its bucket is not full.
 */
#ifndef ORB_HTTP_ADDRESSES_H
#define ORB_HTTP_ADDRESSES_H

#include <stdint.h>
#include <sys/socket.h>

enum { ADDRESS_WINDOW = 10 };

typedef struct addresses addresses;
typedef struct address_entry address_entry;

addresses *addresses_create(int64_t requests_per_second);
void addresses_destroy(addresses *a);
int address_is_local(const struct sockaddr *address); /* loopback, or a Unix socket */
/* Of the IPv4 address, or the /64 of the IPv6 address. */
uint64_t address_hash(const struct sockaddr *address);
/* Counts a connection; NULL out of memory. now: orb_clock_ms(). */
address_entry *addresses_enter(addresses *a, const struct sockaddr *address, int64_t now);
void addresses_leave(addresses *a, address_entry *e);
int64_t address_connections(const address_entry *e);
int address_take(addresses *a, address_entry *e, int64_t now); /* 0: the bucket is empty */
void address_left(const addresses *a, const address_entry *e, int64_t *quota, int64_t *window, int64_t *left,
                  int64_t *reset);
void addresses_sweep(addresses *a, int64_t now);

#endif
