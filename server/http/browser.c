/* The browser as an attacker, where no token is needed: any page that its user opens can send requests to a daemon on
 * loopback. Two headers that a page cannot choose show such requests.
 *
 * Host: a page can make its own name resolve to 127.0.0.1 (DNS rebinding) and then reads every answer, but the browser
 * still sends that name.
 * Origin: a page of another origin cannot read answers without CORS, but a request without a preflight (text/plain, a
 * form) has its effect. Browsers omit Origin from a GET that they make for an element such as <img>, so Sec-Fetch-Site
 * decides about those: a GET of a morph makes the daemon work. */
#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "http/hosts.h"
#include "http/http.h"

/* The host of the target in absolute form (RFC 9112 section 3.2.2 lets it take precedence), else of the Host header.
 * NULL if there is none: HTTP/1.0, which no browser sends. */
static const char *host_of(const request *r, const char *url, char room[300]) {
  const char *authority = origin_authority(url);
  if (!authority) {
    return header_of(r, "Host");
  }
  snprintf(room, 300, "%.*s", (int)strcspn(authority, "/?#"), authority);
  return room;
}

/* Whether the host is a name of this daemon. A daemon on all addresses has the one that the connection came to. */
static int is_own(const request *r, const char *host) {
  const union MHD_ConnectionInfo *fd = MHD_get_connection_info(r->connection, MHD_CONNECTION_INFO_CONNECTION_FD);
  struct sockaddr_storage room;
  struct sockaddr *address = (struct sockaddr *)(void *)&room;
  socklen_t size = sizeof room;
  return host_is_loopback(host) || host_is_listed(r->srv->options->hosts, host) || host_equals(r->srv->at.text, host) ||
         (fd && getsockname(fd->connect_fd, address, &size) == 0 && host_is_address(host, address));
}

static int refuse_origin(const char *origin, api_problem *problem) {
  api_refuse(problem, "foreign-origin",
             "Pages of %.120s may not use this daemon. To allow them, the operator starts it with --cors %.120s.",
             origin, origin);
  api_json_member_string(&problem->facts, "origin", origin);
  return 0;
}

static int check_origins(const request *r, const char *host, api_problem *problem) {
  const config *options = r->srv->options;
  const char *origins[HEADER_LINES];
  int count = header_lines(r, "Origin", origins);
  for (int i = 0; i < count; i++) {
    const char *authority = origin_authority(origins[i]);
    int own = authority && ((host && strcasecmp(authority, host) == 0) || host_is_listed(options->hosts, authority));
    if (!own && !origin_is_listed(options->cors, origins[i])) {
      return refuse_origin(origins[i], problem);
    }
  }
  const char *site = header_of(r, "Sec-Fetch-Site"), *mode = header_of(r, "Sec-Fetch-Mode");
  if (count == 0 && site && strcmp(site, "cross-site") == 0 && !(mode && strcmp(mode, "navigate") == 0) &&
      strcmp(options->cors, "*") != 0) {
    return api_refuse(problem, "foreign-origin",
                      "An element of a page of another site may not use this daemon. Load it with fetch() or with the "
                      "attribute crossorigin; the operator then allows the page with --cors.");
  }
  return 1;
}

int browser_check(const request *r, const char *url, const char *path, api_problem *problem) {
  char room[300];
  if (r->srv->needs_token || r->signer || access_is_open(path)) {
    return 1;
  }
  const char *host = host_of(r, url, room);
  if (host && !is_own(r, host)) {
    api_refuse(problem, "foreign-host",
               "%.120s is not a name of this daemon. Use localhost or its address; for another name, the operator "
               "starts it with --hosts %.120s.",
               host, host);
    api_json_member_string(&problem->facts, "host", host);
    return 0;
  }
  int uses_data = r->route && r->route->scope != SCOPE_NONE && strcmp(r->method, "OPTIONS") != 0;
  return !uses_data || check_origins(r, host, problem);
}
