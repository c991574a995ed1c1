/* Which URLs of callers the daemon accepts. */
#ifndef ORB_NET_URL_H
#define ORB_NET_URL_H

#include "net/networks.h"

enum { NET_URL = 2048, NET_ORIGIN = 320 };

typedef enum net_verdict {
  NET_URL_FINE,
  NET_URL_MALFORMED,
  NET_URL_FORBIDDEN, /* valid, but the daemon does not connect to it */
} net_verdict;

typedef struct net_url {
  char text[NET_URL];      /* normalised, without a fragment */
  char origin[NET_ORIGIN]; /* scheme, host and port: "https://example.org:443" */
  int plain;               /* http, not https */
} net_url;

/* Checks everything that the text alone determines. A host name may still resolve to any address: net/client.h checks
 * each address when it connects. `why` receives a sentence unless the verdict is NET_URL_FINE. The URL may be longer
 * than NET_URL only by its fragment. allowed: the networks that the operator lists. */
net_verdict net_url_read(const char *text, const networks *allowed, net_url *out, const char **why);

#endif
