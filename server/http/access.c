/* Who may call, how often, and what a caller sees: tokens, scopes, tenants, limits and quotas. */
#include <arpa/inet.h>
#include <netinet/in.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "http/http.h"
#include "log.h"
#include "store/owners.h"

static caller *find_caller(const server *srv, const char *header) {
  unsigned char hash[TOKEN_BYTES];
  if (!header || strncasecmp(header, "Bearer ", 7) != 0 || !token_hash(header + 7 + strspn(header + 7, " "), hash)) {
    return NULL;
  }
  return callers_find(srv->callers, hash);
}

int access_is_open(const char *path) {
  return strcmp(path, "/livez") == 0 || strcmp(path, "/readyz") == 0;
}

int access_within_limits(request *r, const char *path) {
  if (access_is_open(path)) {
    return 1;
  }
  watched_take_request(r->watched, &r->allowance);
  if (!r->allowance.refused) {
    return 1;
  }
  if (r->allowance.refused == 2) {
    r->closes = 1;
    reply_refuse(r, "too-many-requests", "This address has more than %lld open connections; close some.",
                 (long long)r->srv->options->connections_per_address);
  } else {
    reply_refuse(r, "too-many-requests", "This address may make %lld requests per second; try again soon.",
                 (long long)r->srv->options->requests_per_second);
  }
  return 0;
}

void access_headers(request *r) {
  const allowance *a = &r->allowance;
  const token_row *token = r->caller ? &r->caller->row : NULL;
  int64_t quota = token ? __atomic_load_n(&token->quota, __ATOMIC_RELAXED) : 0;
  char policy[160] = "", left[160] = "";
  if (a->limited) {
    snprintf(policy, sizeof policy, "\"requests\";q=%lld;w=%lld", (long long)a->quota, (long long)a->window);
    snprintf(left, sizeof left, "\"requests\";r=%lld;t=%lld", (long long)a->left, (long long)a->reset);
  }
  if (quota > 0) {
    int64_t used = __atomic_load_n(&token->used, __ATOMIC_RELAXED);
    size_t n = strlen(policy), m = strlen(left);
    snprintf(policy + n, sizeof policy - n, "%s\"upload\";q=%lld;qu=\"content-bytes\"", n ? ", " : "",
             (long long)quota);
    snprintf(left + m, sizeof left - m, "%s\"upload\";r=%lld", m ? ", " : "",
             (long long)(used < quota ? quota - used : 0));
  }
  if (policy[0]) {
    reply_header(r, "RateLimit-Policy", policy);
    reply_header(r, "RateLimit", left);
  }
}

/* Pages and the API document contain no user data; the studio asks its user for a token. */
static int is_public(const request *r, const char *path) {
  return access_is_open(path) || (r->route ? r->route->scope == SCOPE_NONE : is_page(path));
}

static int refuse_expired(request *r, api_problem *problem) {
  char when[TOKEN_INSTANT];
  token_instant(__atomic_load_n(&r->caller->row.expires, __ATOMIC_RELAXED), when);
  return api_refuse(problem, "unauthorized",
                    "The token \"%s\" expired at %s. The operator makes it valid again with orbmorphd token set %s "
                    "--expires TIME, or replaces it.",
                    r->caller->row.name, when, r->caller->row.name);
}

int access_check(request *r, const char *path, api_problem *problem) {
  /* Browsers send CORS preflight requests without a token; the response lists only methods. */
  if (!r->srv->needs_token || r->signer || is_public(r, path) || strcmp(r->method, "OPTIONS") == 0) {
    return 1;
  }
  r->caller = find_caller(r->srv, header_of(r, "Authorization"));
  if (!r->caller) {
    return api_refuse(problem, "unauthorized",
                      "The request needs a valid token: Authorization: Bearer TOKEN. The operator creates one with "
                      "orbmorphd token add.");
  }
  if (caller_expired(r->caller)) {
    return refuse_expired(r, problem);
  }
  static const struct {
    int scope;
    const char *name;
  } names[] = {{SCOPE_READ, "read"}, {SCOPE_WRITE, "write"}, {SCOPE_ADMIN, "admin"}};
  int wanted = r->route ? (int)r->route->scope : SCOPE_NONE;
  if (wanted == SCOPE_NONE || (__atomic_load_n(&r->caller->row.scopes, __ATOMIC_RELAXED) & (wanted | SCOPE_ADMIN))) {
    return 1;
  }
  size_t i = 0;
  while (names[i].scope != wanted) {
    i++;
  }
  api_refuse(problem, "forbidden", "The token \"%s\" lacks the scope \"%s\", which this request needs.",
             r->caller->row.name, names[i].name);
  api_json_member_string(&problem->facts, "scope", names[i].name);
  return 0;
}

int access_is_operator(request *r) {
  caller *who = r->srv->needs_token ? find_caller(r->srv, header_of(r, "Authorization")) : NULL;
  int admin = who && !caller_expired(who) && (__atomic_load_n(&who->row.scopes, __ATOMIC_RELAXED) & SCOPE_ADMIN);
  if (admin && !r->caller) {
    r->caller = who; /* for the audit log */
  } else {
    caller_release(who);
  }
  return !r->srv->needs_token || admin;
}

const char *access_tenant(const request *r) {
  return r->caller ? r->caller->row.tenant : r->signer && r->srv->needs_token ? r->signer->row.tenant : "";
}

const char *access_view(const request *r) {
  if (r->signer) {
    return access_tenant(r);
  }
  int all = !r->caller || (__atomic_load_n(&r->caller->row.scopes, __ATOMIC_RELAXED) & SCOPE_ADMIN);
  return all ? "" : r->caller->row.tenant;
}

int access_sees(const request *r, const char *owner) {
  const char *view = access_view(r);
  return !view[0] || strcmp(view, owner) == 0;
}

int access_has_room(const request *r, int64_t bytes, api_problem *problem) {
  const token_row *token = r->caller ? &r->caller->row : NULL;
  int64_t used = token ? __atomic_load_n(&token->used, __ATOMIC_RELAXED) : 0;
  int64_t quota = token ? __atomic_load_n(&token->quota, __ATOMIC_RELAXED) : 0;
  if (quota == 0 || used + bytes <= quota) {
    return 1;
  }
  api_refuse(problem, "quota-exceeded",
             "The token \"%s\" may store %lld bytes of meshes and already stores %lld: delete some meshes, or ask the "
             "operator for a larger quota.",
             token->name, (long long)quota, (long long)used);
  api_json_member_integer(&problem->facts, "quota", quota);
  return 0;
}

int64_t access_largest(const request *r) {
  int64_t used = r->caller ? __atomic_load_n(&r->caller->row.used, __ATOMIC_RELAXED) : 0;
  int64_t quota = r->caller ? __atomic_load_n(&r->caller->row.quota, __ATOMIC_RELAXED) : 0;
  return owner_largest_file(quota, used);
}

int access_takes_file(const request *r, int64_t bytes, api_problem *problem) {
  const int64_t largest = access_largest(r);
  if (largest == 0 || bytes <= largest) {
    return 1;
  }
  int64_t quota = __atomic_load_n(&r->caller->row.quota, __ATOMIC_RELAXED);
  api_refuse(problem, "quota-exceeded",
             "The token \"%s\" may store %lld bytes of meshes, and this file has more: decimate the mesh, or ask the "
             "operator for a larger quota.",
             r->caller->row.name, (long long)quota);
  api_json_member_integer(&problem->facts, "quota", quota);
  return 0;
}

int access_priority(const request *r) {
  int class = r->caller ? __atomic_load_n(&r->caller->row.priority, __ATOMIC_RELAXED) : 0;
  return QUEUE_URGENCIES * class + QUEUE_URGENCIES - 1 - parse_urgency(header_of(r, "Priority"));
}

/* A read of what others own, or of the service, if the caller has the scope admin. */
static int may_read_all(const request *r) {
  return r->route->scope == SCOPE_READ || r->route->scope == SCOPE_ADMIN ||
         (r->route->id == ROUTE_READYZ && query_has(r, "verbose"));
}

/* The audit log names refused callers, deletions, and reads with the scope admin. It names no other request. */
static const char *audited(const request *r) {
  int admin = r->caller && (__atomic_load_n(&r->caller->row.scopes, __ATOMIC_RELAXED) & SCOPE_ADMIN);
  return r->status == 401 || r->status == 403      ? "refused"
         : r->status >= 400 || !r->route           ? NULL
         : strcmp(r->route->method, "DELETE") == 0 ? "delete"
         : admin && may_read_all(r)                ? "admin-read"
                                                   : NULL;
}

void access_audit(const request *r, const struct sockaddr *address) {
  const char *what = audited(r);
  char host[INET6_ADDRSTRLEN] = "local", fields[REQUEST_FIELDS + 400];
  if (!what) {
    return;
  }
  if (address && address->sa_family == AF_INET) {
    inet_ntop(AF_INET, &((const struct sockaddr_in *)(const void *)address)->sin_addr, host, sizeof host);
  } else if (address && address->sa_family == AF_INET6) {
    inet_ntop(AF_INET6, &((const struct sockaddr_in6 *)(const void *)address)->sin6_addr, host, sizeof host);
  }
  request_fields(r, fields);
  size_t n = strlen(fields);
  snprintf(fields + n, sizeof fields - n,
           ",\"audit\":\"%s\",\"token\":\"%s\",\"key\":\"%s\",\"tenant\":\"%s\",\"address\":\"%s\",\"id\":\"%s\","
           "\"status\":%u",
           what, r->caller ? r->caller->row.name : "", r->signer ? r->signer->row.name : "",
           r->caller   ? r->caller->row.tenant
           : r->signer ? r->signer->row.tenant
                       : "",
           host, r->id, r->status);
  log_write(strcmp(what, "refused") == 0 ? LOG_WARN : LOG_INFO, fields, "audit");
}
