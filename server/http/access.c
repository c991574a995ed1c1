/* Who may call. Tokens are read at the start; the command that changes them needs the data folder for itself. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "http/http.h"

static const token_row *find_token(const server *srv, const char *header) {
  unsigned char hash[TOKEN_BYTES];
  const token_row *found = NULL;
  if (!header || strncasecmp(header, "Bearer ", 7) != 0 || !token_hash(header + 7 + strspn(header + 7, " "), hash)) {
    return NULL;
  }
  for (int i = 0; i < srv->token_count; i++) { /* all of them, so that time tells nothing */
    if (sodium_memcmp(hash, srv->tokens[i].hash, sizeof hash) == 0) {
      found = &srv->tokens[i];
    }
  }
  return found;
}

/* Health is for everybody, always. */
static int is_open(const char *path) {
  return strcmp(path, "/livez") == 0 || strcmp(path, "/readyz") == 0;
}

int access_within_limits(request *r, const char *path) {
  if (is_open(path)) {
    return 1;
  }
  watched_take_request(r->watched, &r->allowance);
  if (!r->allowance.refused) {
    return 1;
  }
  if (r->allowance.refused == 2) {
    r->closes = 1;
    reply_refuse(r, "too-many-requests", "This address has more than %lld connections open; close some.",
                 (long long)r->srv->options->connections_per_address);
  } else {
    reply_refuse(r, "too-many-requests", "This address may make %lld requests a second; wait a little.",
                 (long long)r->srv->options->requests_per_second);
  }
  return 0;
}

void access_headers(request *r) {
  const allowance *a = &r->allowance;
  char text[160];
  if (!a->limited) {
    return;
  }
  snprintf(text, sizeof text, "\"requests\";q=%lld;w=%lld", (long long)a->quota, (long long)a->window);
  reply_header(r, "RateLimit-Policy", text);
  snprintf(text, sizeof text, "\"requests\";r=%lld;t=%lld", (long long)a->left, (long long)a->reset);
  reply_header(r, "RateLimit", text);
}

int access_check(request *r, const char *path, orb_problem *problem) {
  int open = is_open(path);
  /* Browsers ask for permission to call without the token; the answer tells nothing but methods. */
  if (!r->srv->needs_token || open || strcmp(r->method, "OPTIONS") == 0) {
    return 1;
  }
  r->token = (token_row *)(uintptr_t)find_token(r->srv, header_of(r, "Authorization"));
  if (!r->token) {
    return orb_refuse(problem, "unauthorized",
                      "Send a token that is known here: Authorization: Bearer TOKEN. The operator makes one with "
                      "orbmorphd token add.");
  }
  static const struct {
    int scope;
    const char *name;
  } names[] = {{SCOPE_READ, "read"}, {SCOPE_WRITE, "write"}, {SCOPE_ADMIN, "admin"}};
  int wanted = r->route ? (int)r->route->scope : SCOPE_NONE;
  if (wanted == SCOPE_NONE || (r->token->scopes & (wanted | SCOPE_ADMIN))) {
    return 1;
  }
  size_t i = 0;
  while (names[i].scope != wanted) {
    i++;
  }
  orb_refuse(problem, "forbidden", "The token \"%s\" has not the scope \"%s\", which this needs.", r->token->name,
             names[i].name);
  orb_json_member_string(&problem->facts, "scope", names[i].name);
  return 0;
}

int access_take_quota(request *r, int64_t bytes, orb_problem *problem) {
  token_row *token = r->token;
  if (!token) {
    return 1;
  }
  int64_t used = __atomic_add_fetch(&token->used, bytes, __ATOMIC_RELAXED);
  if (token->quota == 0 || used <= token->quota) {
    return 1;
  }
  __atomic_sub_fetch(&token->used, bytes, __ATOMIC_RELAXED);
  orb_refuse(problem, "quota-exceeded", "The token \"%s\" may upload %lld bytes in all, and has used %lld.",
             token->name, (long long)token->quota, (long long)(used - bytes));
  orb_json_member_integer(&problem->facts, "quota", token->quota);
  return 0;
}

void access_quota_stored(request *r, int64_t bytes, int stored) {
  if (r->token && stored) {
    catalogue_token_use(r->srv->cat, r->token->name, bytes);
  } else if (r->token) {
    __atomic_sub_fetch(&r->token->used, bytes, __ATOMIC_RELAXED);
  }
}
