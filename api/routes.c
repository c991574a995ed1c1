#include "api/routes.h"

#include <stdio.h>
#include <string.h>

#define ROW(id, method, path, body, scope, query, handler) {id, method, path, body, scope, query},
static const route table[ROUTE_COUNT] = {API_ROUTES(ROW)};
#undef ROW

/* Returns the number before the rest of a path: one or two digits without leading zero; −1 if the path has none. */
static int number_before(const char *path, const char *rest) {
  size_t digits = strspn(path, "0123456789");
  if (digits < 1 || digits > 2 || (digits == 2 && path[0] == '0') || strcmp(path + digits, rest) != 0) {
    return -1;
  }
  return digits == 1 ? path[0] - '0' : 10 * (path[0] - '0') + path[1] - '0';
}

/* Matches the part of a path after the id, which may contain {k}. */
static int ends_as(const char *pattern, const char *path) {
  const char *brace = strstr(pattern, "{k}");
  if (!brace) {
    return strcmp(pattern, path) == 0;
  }
  size_t head = (size_t)(brace - pattern);
  return strncmp(pattern, path, head) == 0 && number_before(path + head, brace + 3) >= 0;
}

/* Matches a path against a pattern, and fills id if the pattern has one. */
static int matches(const char *pattern, const char *path, char id[API_ID_SIZE]) {
  const char *brace = strchr(pattern, '{');
  if (!brace) {
    return strcmp(pattern, path) == 0;
  }
  size_t head = (size_t)(brace - pattern);
  if (strncmp(pattern, path, head) != 0) {
    return 0;
  }
  size_t length = strcspn(path + head, "/");
  int fine = strncmp(brace, "{id}", 4) == 0 ? api_id_valid(path + head, length) : api_job_id_valid(path + head, length);
  if (!fine || !ends_as(strchr(brace, '}') + 1, path + head + length)) {
    return 0;
  }
  memcpy(id, path + head, length);
  id[length] = 0;
  return 1;
}

const route *api_route_find(const char *method, const char *path, char id[API_ID_SIZE], char allow[64]) {
  const char *wanted = strcmp(method, "HEAD") == 0 ? "GET" : method;
  allow[0] = 0;
  id[0] = 0;
  for (int i = 0; i < ROUTE_COUNT; i++) {
    if (matches(table[i].path, path, id)) {
      if (strcmp(table[i].method, wanted) == 0) {
        return &table[i];
      }
      size_t n = strlen(allow);
      snprintf(allow + n, 64 - n, "%s%s", n ? ", " : "",
               strcmp(table[i].method, "GET") == 0 ? "GET, HEAD" : table[i].method);
    }
  }
  return NULL;
}

int api_route_number(const route *found, const char *path) {
  const char *brace = strstr(found->path, "{k}");
  size_t rest = brace ? strlen(brace + 3) : 0, length = strlen(path);
  if (!brace || length < rest) {
    return -1;
  }
  const char *at = path + length - rest;
  while (at > path && at[-1] != '/') {
    at--;
  }
  return number_before(at, brace + 3);
}
