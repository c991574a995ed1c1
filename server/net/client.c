#include "net/client.h"

#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>

#include "orbmorph/context.h"

enum { CONNECT_MS = 10000, DROP_MOST = 64 << 10, SLOW_BYTES = 256, SLOW_SECONDS = 20 };

struct net_transfer {
  CURL *curl;
  struct curl_slist *headers;
  net_request request;
  int64_t bytes;
  int forbidden, stopped, too_large;
  char error[CURL_ERROR_SIZE];
};

int net_start(void) {
  return curl_global_init(CURL_GLOBAL_DEFAULT) == CURLE_OK;
}

static curl_socket_t open_socket(void *user, curlsocktype purpose, struct curl_sockaddr *address) {
  net_transfer *t = user;
  int listed = networks_contain(t->request.allowed, &address->addr);
  if (purpose != CURLSOCKTYPE_IPCXN || (!listed && (t->request.url->plain || !address_is_public(&address->addr)))) {
    t->forbidden = 1;
    return CURL_SOCKET_BAD;
  }
  return socket(address->family, address->socktype | SOCK_CLOEXEC, address->protocol);
}

static size_t take(char *bytes, size_t one, size_t size, void *user) {
  net_transfer *t = user;
  long status = 0;
  (void)one;
  t->bytes += (int64_t)size;
  curl_easy_getinfo(t->curl, CURLINFO_RESPONSE_CODE, &status);
  if (status < 200 || status > 299 || !t->request.take) {
    return t->bytes > DROP_MOST ? 0 : size; /* the status is known, so the transfer still counts as answered */
  }
  t->too_large = t->bytes > t->request.most;
  if (t->too_large) {
    return 0;
  }
  t->stopped = !t->request.take(t->request.user, bytes, size);
  return t->stopped ? 0 : size;
}

static int progress(void *user, curl_off_t total, curl_off_t now, curl_off_t up_total, curl_off_t up_now) {
  net_transfer *t = user;
  (void)total;
  (void)now;
  (void)up_total;
  (void)up_now;
  t->stopped = t->stopped || (t->request.continues && !t->request.continues(t->request.user));
  return t->stopped;
}

/* The limits: where, how long, how much. */
static int set_limits(net_transfer *t) {
  CURL *c = t->curl;
  const net_request *r = &t->request;
  return curl_easy_setopt(c, CURLOPT_PROTOCOLS_STR, r->url->plain ? "http" : "https") == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_OPENSOCKETFUNCTION, open_socket) == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_OPENSOCKETDATA, t) == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_PROXY, "") == CURLE_OK && curl_easy_setopt(c, CURLOPT_NOPROXY, "*") == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_NETRC, (long)CURL_NETRC_IGNORED) == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_FOLLOWLOCATION, 0L) == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_FRESH_CONNECT, 1L) == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_FORBID_REUSE, 1L) == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_DNS_CACHE_TIMEOUT, 0L) == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_HTTP_VERSION, (long)CURL_HTTP_VERSION_1_1) == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_MAXFILESIZE_LARGE, (curl_off_t)r->most) == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_TIMEOUT_MS, (long)r->total_ms) == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_CONNECTTIMEOUT_MS, (long)CONNECT_MS) == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_LOW_SPEED_LIMIT, (long)SLOW_BYTES) == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_LOW_SPEED_TIME, (long)SLOW_SECONDS) == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_NOSIGNAL, 1L) == CURLE_OK &&
         /* Without waiting for a resolver that does not answer. */
         curl_easy_setopt(c, CURLOPT_QUICK_EXIT, 1L) == CURLE_OK &&
         (!*r->authorities || curl_easy_setopt(c, CURLOPT_CAINFO, r->authorities) == CURLE_OK);
}

static int set_request(net_transfer *t) {
  CURL *c = t->curl;
  const net_request *r = &t->request;
  for (int i = 0; r->headers && r->headers[i]; i++) {
    struct curl_slist *more = curl_slist_append(t->headers, r->headers[i]);
    if (!more) {
      return 0;
    }
    t->headers = more;
  }
  return curl_easy_setopt(c, CURLOPT_URL, r->url->text) == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_USERAGENT, "orbmorph") == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_HTTPHEADER, t->headers) == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_ERRORBUFFER, t->error) == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_WRITEFUNCTION, take) == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_WRITEDATA, t) == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_XFERINFOFUNCTION, progress) == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_XFERINFODATA, t) == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_NOPROGRESS, 0L) == CURLE_OK &&
         (!r->body || (curl_easy_setopt(c, CURLOPT_POSTFIELDS, r->body) == CURLE_OK &&
                       curl_easy_setopt(c, CURLOPT_POSTFIELDSIZE_LARGE, (curl_off_t)r->body_size) == CURLE_OK));
}

net_transfer *net_transfer_create(const net_request *request) {
  net_transfer *t = calloc(1, sizeof *t);
  if (!t) {
    return NULL;
  }
  t->request = *request;
  t->curl = curl_easy_init();
  if (!t->curl || !set_limits(t) || !set_request(t)) {
    net_transfer_free(t);
    return NULL;
  }
  return t;
}

CURL *net_transfer_handle(const net_transfer *t) {
  return t->curl;
}

void net_transfer_free(net_transfer *t) {
  if (t) {
    curl_easy_cleanup(t->curl);
    curl_slist_free_all(t->headers);
    free(t);
  }
}

static void ends(net_answer *out, net_end end, const char *format, ...) __attribute__((format(printf, 3, 4)));
static void ends(net_answer *out, net_end end, const char *format, ...) {
  va_list args;
  va_start(args, format);
  vsnprintf(out->why, sizeof out->why, format, args);
  va_end(args);
  out->end = end;
}

void net_transfer_end(net_transfer *t, CURLcode code, net_answer *out) {
  long status = 0, system_error = 0;
  char *redirect = NULL;
  curl_off_t after = 0;
  memset(out, 0, sizeof *out);
  curl_easy_getinfo(t->curl, CURLINFO_RESPONSE_CODE, &status);
  curl_easy_getinfo(t->curl, CURLINFO_REDIRECT_URL, &redirect);
  curl_easy_getinfo(t->curl, CURLINFO_RETRY_AFTER, &after);
  curl_easy_getinfo(t->curl, CURLINFO_OS_ERRNO, &system_error);
  out->status = (int)status;
  out->bytes = t->bytes;
  out->retry_after = (int64_t)after;
  if (redirect && status > 300 && strlen(redirect) < sizeof out->redirect) {
    strcpy(out->redirect, redirect);
  }
  if (t->too_large || code == CURLE_FILESIZE_EXCEEDED) {
    ends(out, NET_TOO_LARGE, "the answer has more than %lld bytes", (long long)t->request.most);
  } else if (t->stopped) {
    ends(out, NET_STOPPED, "the transfer was stopped");
  } else if (code == CURLE_OK || (code == CURLE_WRITE_ERROR && status)) {
    out->end = NET_ANSWERED;
  } else if (t->forbidden && !status) {
    ends(out, NET_FORBIDDEN, "the host has no address that the daemon connects to");
  } else if (code == CURLE_COULDNT_CONNECT && (system_error == EPERM || system_error == EACCES)) {
    ends(out, NET_DENIED, "the system denies the connection (IPAddressDeny of the unit, or a firewall)");
  } else if (code == CURLE_OPERATION_TIMEDOUT) {
    ends(out, NET_TIMED_OUT, "no complete answer came in time");
  } else {
    ends(out, NET_FAILED, "%.140s", t->error[0] ? t->error : curl_easy_strerror(code));
  }
}

static int leads_on(int status) {
  return status == 301 || status == 302 || status == 303 || status == 307 || status == 308;
}

void net_get(const net_request *request, int redirects, net_answer *out) {
  net_url at = *request->url;
  net_request hop = *request;
  int64_t until = orb_clock_ms() + request->total_ms;
  for (hop.url = &at;; redirects--) {
    const char *why;
    hop.total_ms = until - orb_clock_ms();
    net_transfer *t = hop.total_ms > 0 ? net_transfer_create(&hop) : NULL;
    memset(out, 0, sizeof *out);
    if (!t) {
      ends(out, hop.total_ms > 0 ? NET_FAILED : NET_TIMED_OUT,
           hop.total_ms > 0 ? "the server has no memory left" : "no complete answer came in time");
      return;
    }
    net_transfer_end(t, curl_easy_perform(t->curl), out);
    net_transfer_free(t);
    if (out->end != NET_ANSWERED || !leads_on(out->status) || !out->redirect[0]) {
      return;
    }
    if (redirects <= 0) {
      ends(out, NET_FAILED, "there are too many redirects");
      return;
    }
    net_verdict verdict = net_url_read(out->redirect, request->allowed, &at, &why);
    if (verdict != NET_URL_FINE) {
      ends(out, verdict == NET_URL_FORBIDDEN ? NET_FORBIDDEN : NET_FAILED,
           "it redirects to a URL that the daemon does not connect to");
      return;
    }
  }
}
