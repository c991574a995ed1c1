/* An HTTP client for URLs that callers name, on libcurl.
 *
 * It checks each address when it connects: libcurl asks it for the socket, and connects that socket to the address
 * that was checked. So neither a name that later resolves to another address (DNS rebinding) nor a redirect
 * passes the check. Time and size are bounded. It uses no proxy, no cookies, no
 * stored credentials, no connection of an earlier request, and follows no redirect by itself.
 */
#ifndef ORB_NET_CLIENT_H
#define ORB_NET_CLIENT_H

#include <curl/curl.h>
#include <stddef.h>
#include <stdint.h>

#include "net/url.h"

typedef struct net_request {
  const net_url *url;
  const networks *allowed;    /* besides public addresses; the only ones for http:// */
  const char *authorities;    /* PEM file of certificate authorities; "": those of the system */
  const char *const *headers; /* "Name: value", NULL-terminated; NULL: none */
  const char *body;           /* of a POST; NULL: GET */
  size_t body_size;
  int64_t total_ms; /* time limit of the whole request */
  int64_t most;     /* limit on the bytes of the answer's body */
  /* Takes bytes of the body of an answer 2xx; 0 ends the transfer. NULL: they are dropped. */
  int (*take)(void *user, const char *bytes, size_t size);
  int (*continues)(void *user); /* asked several times a second: 0 ends the transfer. NULL: it continues */
  void *user;
} net_request;

typedef enum net_end {
  NET_ANSWERED,  /* with any status */
  NET_FORBIDDEN, /* the host has no address that the daemon connects to */
  NET_DENIED,    /* the kernel lets this process connect to no such address */
  NET_TOO_LARGE,
  NET_TIMED_OUT,
  NET_STOPPED, /* by take() or continues() */
  NET_FAILED,  /* no connection, no valid certificate, no HTTP */
} net_end;

typedef struct net_answer {
  net_end end;
  int status;             /* of the answer; 0: none */
  int64_t bytes;          /* of its body */
  int64_t retry_after;    /* seconds; 0: not said */
  char redirect[NET_URL]; /* where a redirect leads; "": nowhere */
  char why[160];          /* in words, unless NET_ANSWERED; the end of a sentence without a full stop */
} net_answer;

/* Once in a process, before its threads. 0: libcurl cannot be initialised. */
int net_start(void);

/* A request as a handle for curl_easy_perform() or a multi handle. It keeps pointers to what the request points to.
 * NULL: out of memory. */
typedef struct net_transfer net_transfer;
net_transfer *net_transfer_create(const net_request *request);
CURL *net_transfer_handle(const net_transfer *t);
/* The result, after libcurl has ended the transfer with this code. */
void net_transfer_end(net_transfer *t, CURLcode code, net_answer *out);
void net_transfer_free(net_transfer *t);

/* Gets the URL in this thread and follows at most `redirects` redirects; each must lead to a URL that
 * net_url_read() accepts. request->total_ms limits all of them together. */
void net_get(const net_request *request, int redirects, net_answer *out);

#endif
