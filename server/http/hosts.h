/* The names in Host and Origin headers. A page cannot choose these headers, so they show under which name a browser
 * reached the daemon, and which page makes the request. An authority is a host with an optional port, as in a URL.
 * Names are compared without regard to case. */
#ifndef ORB_HTTP_HOSTS_H
#define ORB_HTTP_HOSTS_H

#include <sys/socket.h>

/* Whether the host is localhost, 127.0.0.0/8 or ::1. A page of another site cannot have such a name, even if it makes
 * its own name resolve to loopback (DNS rebinding). */
int host_is_loopback(const char *authority);
/* Whether the host is the numeric form of this address. */
int host_is_address(const char *authority, const struct sockaddr *address);
/* Whether both name the same host; their ports may differ. */
int host_equals(const char *authority, const char *other);
/* Whether the list, separated by commas or spaces, names the host. An entry without a port stands for all ports, and
 * the list "*" for all hosts. */
int host_is_listed(const char *list, const char *authority);

/* Whether the list, separated by commas or spaces, names the origin; "*" names all. */
int origin_is_listed(const char *list, const char *origin);
/* The authority of an http or https origin; NULL for any other, such as "null". */
const char *origin_authority(const char *origin);

#endif
