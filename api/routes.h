/* The route table: every path and method of the service, in one place. */
#ifndef ORB_API_ROUTES_H
#define ORB_API_ROUTES_H

#include "api/ids.h"

typedef enum route_id {
  ROUTE_MESH_UPLOAD,
  ROUTE_MESH_LIST,
  ROUTE_MESH_GET,
  ROUTE_MESH_DELETE,
  ROUTE_MESH_FILE,
  ROUTE_EMBEDDING_CREATE,
  ROUTE_EMBEDDING_LIST,
  ROUTE_EMBEDDING_GET,
  ROUTE_EMBEDDING_DELETE,
  ROUTE_EMBEDDING_SPHERE,
  ROUTE_SUPERMESH_CREATE,
  ROUTE_SUPERMESH_LIST,
  ROUTE_SUPERMESH_GET,
  ROUTE_SUPERMESH_DELETE,
  ROUTE_SUPERMESH_ASSET,
  ROUTE_SUPERMESH_PLACES,
  ROUTE_SUPERMESH_SPHERE,
  ROUTE_JOB_LIST,
  ROUTE_JOB_GET,
  ROUTE_JOB_CANCEL,
  ROUTE_JOB_EVENTS,
  ROUTE_LIVEZ,
  ROUTE_READYZ,
  ROUTE_METRICS,
  ROUTE_OPENAPI,
  ROUTE_DOCS,
  ROUTE_ROOT,
  ROUTE_COUNT
} route_id;

typedef enum route_body { ROUTE_NO_BODY, ROUTE_JSON_BODY, ROUTE_MESH_BODY } route_body;
typedef enum route_scope { SCOPE_NONE = 0, SCOPE_READ = 1, SCOPE_WRITE = 2, SCOPE_ADMIN = 4 } route_scope;

typedef struct route {
  route_id id;
  const char *method;
  const char *path; /* with {id} for 64 hex digits, {job} for a job's id; after either, {k} for a small number */
  route_body body;
  route_scope scope;
} route;

const route *route_table(void); /* ROUTE_COUNT entries */

/* Finds the route; NULL with *allow empty: no such path; NULL with *allow filled ("GET, HEAD"): not that method.
 * HEAD goes to GET. id: filled where the path has one. */
const route *route_find(const char *method, const char *path, char id[API_ID_SIZE], char allow[64]);
/* The number that stands for {k} in a path that route_find() took; −1: the route has none. */
int route_number(const route *found, const char *path);

#endif
