/* The query of a request. */
#include <string.h>

#include "http/http.h"

typedef struct query_reader {
  const char *known;  /* the names that the route takes, as in API_ROUTES */
  unsigned long seen; /* bits: entries of `known` that the query has */
  api_problem *problem;
} query_reader;

/* The number of a name in the list, −1 if it is not there. *bare: it needs no value. */
static int number_of(const char *known, const char *name, int *bare) {
  size_t length = strlen(name);
  int number = 0;
  for (const char *at = known; *at; number++) {
    size_t size = strcspn(at, " ");
    *bare = at[size - 1] == '?';
    if (size - (size_t)*bare == length && strncmp(at, name, length) == 0) {
      return number;
    }
    at += size + (at[size] == ' ');
  }
  return -1;
}

static int refuse_unknown(const query_reader *q, const char *name) {
  char list[256] = "";
  size_t n = 0;
  for (const char *at = q->known; *at && n + 3 < sizeof list; at++) {
    if (*at == ' ') {
      list[n++] = ',';
    }
    if (*at != '?') {
      list[n++] = *at;
    }
    list[n] = 0;
  }
  return api_refuse(q->problem, "bad-query",
                    "There is no query parameter \"%.100s\" on this route, which takes %s. Correct its spelling or "
                    "remove it.",
                    name, n ? list : "none");
}

static enum MHD_Result look(void *user, enum MHD_ValueKind kind, const char *name, const char *value) {
  query_reader *q = user;
  int bare = 0, number = number_of(q->known, name, &bare);
  (void)kind;
  if (!*name && !value) { /* nothing between two "&" */
    return MHD_YES;
  }
  if (number < 0) {
    refuse_unknown(q, name);
  } else if (q->seen & 1ul << number) {
    api_refuse(q->problem, "bad-query", "The query parameter \"%s\" is given twice. Send it once.", name);
  } else if (!value && !bare) {
    api_refuse(q->problem, "bad-query", "The query parameter \"%s\" needs a value: %s=VALUE.", name, name);
  } else {
    q->seen |= 1ul << number;
    return MHD_YES;
  }
  api_json_member_string(&q->problem->facts, "parameter", name);
  return MHD_NO;
}

int query_check(const request *r, api_problem *problem) {
  query_reader q = {.known = r->route->query, .problem = problem};
  if (q.known) {
    MHD_get_connection_values(r->connection, MHD_GET_ARGUMENT_KIND, look, &q);
  }
  return problem->name == NULL;
}

const char *query_of(const request *r, const char *name) {
  return MHD_lookup_connection_value(r->connection, MHD_GET_ARGUMENT_KIND, name);
}

static enum MHD_Result compare_name(void *user, enum MHD_ValueKind kind, const char *name, const char *value) {
  const char **wanted = user;
  (void)kind;
  (void)value;
  if (strcmp(name, *wanted) == 0) {
    *wanted = NULL;
    return MHD_NO;
  }
  return MHD_YES;
}

int query_has(const request *r, const char *name) {
  MHD_get_connection_values(r->connection, MHD_GET_ARGUMENT_KIND, compare_name, &name);
  return name == NULL;
}
