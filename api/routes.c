#include "api/routes.h"

#include <stdio.h>
#include <string.h>

static const route table[ROUTE_COUNT] = {
    {ROUTE_MESH_UPLOAD, "POST", "/v1/meshes", ROUTE_MESH_BODY, SCOPE_WRITE},
    {ROUTE_MESH_LIST, "GET", "/v1/meshes", ROUTE_NO_BODY, SCOPE_READ},
    {ROUTE_MESH_GET, "GET", "/v1/meshes/{id}", ROUTE_NO_BODY, SCOPE_READ},
    {ROUTE_MESH_DELETE, "DELETE", "/v1/meshes/{id}", ROUTE_NO_BODY, SCOPE_WRITE},
    {ROUTE_MESH_FILE, "GET", "/v1/meshes/{id}/file", ROUTE_NO_BODY, SCOPE_READ},
    {ROUTE_EMBEDDING_CREATE, "POST", "/v1/embeddings", ROUTE_JSON_BODY, SCOPE_WRITE},
    {ROUTE_EMBEDDING_LIST, "GET", "/v1/embeddings", ROUTE_NO_BODY, SCOPE_READ},
    {ROUTE_EMBEDDING_GET, "GET", "/v1/embeddings/{id}", ROUTE_NO_BODY, SCOPE_READ},
    {ROUTE_EMBEDDING_DELETE, "DELETE", "/v1/embeddings/{id}", ROUTE_NO_BODY, SCOPE_WRITE},
    {ROUTE_EMBEDDING_SPHERE, "GET", "/v1/embeddings/{id}/sphere.ply", ROUTE_NO_BODY, SCOPE_READ},
    {ROUTE_SUPERMESH_CREATE, "POST", "/v1/supermeshes", ROUTE_JSON_BODY, SCOPE_WRITE},
    {ROUTE_SUPERMESH_LIST, "GET", "/v1/supermeshes", ROUTE_NO_BODY, SCOPE_READ},
    {ROUTE_SUPERMESH_GET, "GET", "/v1/supermeshes/{id}", ROUTE_NO_BODY, SCOPE_READ},
    {ROUTE_SUPERMESH_DELETE, "DELETE", "/v1/supermeshes/{id}", ROUTE_NO_BODY, SCOPE_WRITE},
    {ROUTE_SUPERMESH_ASSET, "GET", "/v1/supermeshes/{id}/asset.glb", ROUTE_NO_BODY, SCOPE_READ},
    {ROUTE_SUPERMESH_PLACES, "GET", "/v1/supermeshes/{id}/places", ROUTE_NO_BODY, SCOPE_READ},
    {ROUTE_SUPERMESH_SPHERE, "GET", "/v1/supermeshes/{id}/spheres/{k}.ply", ROUTE_NO_BODY, SCOPE_READ},
    {ROUTE_JOB_LIST, "GET", "/v1/jobs", ROUTE_NO_BODY, SCOPE_READ},
    {ROUTE_JOB_GET, "GET", "/v1/jobs/{job}", ROUTE_NO_BODY, SCOPE_READ},
    {ROUTE_JOB_CANCEL, "DELETE", "/v1/jobs/{job}", ROUTE_NO_BODY, SCOPE_WRITE},
    {ROUTE_JOB_EVENTS, "GET", "/v1/jobs/{job}/events", ROUTE_NO_BODY, SCOPE_READ},
    {ROUTE_LIVEZ, "GET", "/livez", ROUTE_NO_BODY, SCOPE_NONE},
    {ROUTE_READYZ, "GET", "/readyz", ROUTE_NO_BODY, SCOPE_NONE},
    {ROUTE_METRICS, "GET", "/metrics", ROUTE_NO_BODY, SCOPE_ADMIN},
    {ROUTE_OPENAPI, "GET", "/openapi.json", ROUTE_NO_BODY, SCOPE_NONE},
    {ROUTE_DOCS, "GET", "/docs", ROUTE_NO_BODY, SCOPE_NONE},
    {ROUTE_ROOT, "GET", "/", ROUTE_NO_BODY, SCOPE_NONE},
};

const route *route_table(void) {
  return table;
}

/* The number in front of the rest of a path: one or two digits, none needless; −1: not that. */
static int number_before(const char *path, const char *rest) {
  size_t digits = strspn(path, "0123456789");
  if (digits < 1 || digits > 2 || (digits == 2 && path[0] == '0') || strcmp(path + digits, rest) != 0) {
    return -1;
  }
  return digits == 1 ? path[0] - '0' : 10 * (path[0] - '0') + path[1] - '0';
}

/* What follows an id: as it stands, or with {k}. */
static int ends_as(const char *pattern, const char *path) {
  const char *brace = strstr(pattern, "{k}");
  if (!brace) {
    return strcmp(pattern, path) == 0;
  }
  size_t head = (size_t)(brace - pattern);
  return strncmp(pattern, path, head) == 0 && number_before(path + head, brace + 3) >= 0;
}

/* Matches a path against a pattern. */
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

const route *route_find(const char *method, const char *path, char id[API_ID_SIZE], char allow[64]) {
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

int route_number(const route *found, const char *path) {
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
