/* Which addresses the daemon may connect to when a caller names the URL.
 *
 * A caller must not reach, through the daemon, what only its host can reach (server-side request forgery): loopback,
 * private networks, cloud metadata. So the daemon connects to public addresses only, and to the networks that the
 * operator lists. Sources: the IANA special-purpose address registries (RFC 6890) and the cloud providers' metadata
 * addresses.
 */
#ifndef ORB_NET_NETWORKS_H
#define ORB_NET_NETWORKS_H

#include <sys/socket.h>

enum { NETWORKS_MOST = 64, NETWORKS_WRONG = 64 };

typedef struct network {
  unsigned char address[16]; /* in network order; IPv4: the first 4 */
  int family, bits;
} network;

typedef struct networks {
  network of[NETWORKS_MOST];
  int count;
} networks;

/* Parses a comma-separated list such as "10.1.0.0/16, fd00::/8, 192.0.2.7"; "" is the empty list. 0 with the part that
 * is not valid in `wrong`; bits of the address after the prefix must be 0. */
int networks_read(const char *list, networks *out, char wrong[NETWORKS_WRONG]);

/* Whether one of the networks contains the address. An IPv4-mapped IPv6 address is an IPv6 address here. */
int networks_contain(const networks *set, const struct sockaddr *address);

/* Whether the address is globally reachable unicast. IPv6 addresses that embed IPv4 ones (mapped, 6to4, NAT64, Teredo)
 * are not: a gateway could lead them anywhere. */
int address_is_public(const struct sockaddr *address);

#endif
