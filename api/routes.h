/* Routing: the table of all routes, and finding the route of a request. */
#ifndef ORB_API_ROUTES_H
#define ORB_API_ROUTES_H

#include "api/ids.h"

/* The parameters that end a signed URL. */
#define API_SIGNED "key expires signature"
/* The parameters of every list. */
#define API_LISTED "limit page_token id_prefix"
/* The parameters of a recipe, see server/http/morph.c. */
#define API_RECIPE                                                                                                     \
  "shapes names landmarks align preset remesh tolerance max_triangles fit path animation normals holes transfer wait " \
  "profile "

/* The route table: one row for each method of each path, with what its body holds, the scope that a token needs, the
 * query parameters that it takes, and the function of server/http that handles it. Adding a row is all that routing
 * needs: route_id, api_route_find() and the server's dispatch follow from it. The api library itself does not use the
 * handlers.
 *
 * Query parameters are separated by spaces, and "?" follows one that needs no value. All others are refused; NULL: the
 * query is not read.
 *
 * Paths contain {id} for 64 hexadecimal digits or {job} for a job's id, and after either {k} for a small number. */
#define API_ROUTES(ROUTE)                                                                                             \
  ROUTE(ROUTE_MESH_UPLOAD, "POST", "/v1/meshes", ROUTE_MESH_BODY, SCOPE_WRITE, "name format repair handle_size part", \
        handle_mesh_upload)                                                                                           \
  ROUTE(ROUTE_MESH_LIST, "GET", "/v1/meshes", ROUTE_NO_BODY, SCOPE_READ, API_LISTED, handle_list)                     \
  ROUTE(ROUTE_MESH_GET, "GET", "/v1/meshes/{id}", ROUTE_NO_BODY, SCOPE_READ, "", handle_get)                          \
  ROUTE(ROUTE_MESH_DELETE, "DELETE", "/v1/meshes/{id}", ROUTE_NO_BODY, SCOPE_WRITE, "", handle_delete)                \
  ROUTE(ROUTE_MESH_FILE, "GET", "/v1/meshes/{id}/file", ROUTE_NO_BODY, SCOPE_READ, "", handle_file)                   \
  ROUTE(ROUTE_EMBEDDING_CREATE, "POST", "/v1/embeddings", ROUTE_JSON_BODY, SCOPE_WRITE, "wait", handle_create)        \
  ROUTE(ROUTE_EMBEDDING_LIST, "GET", "/v1/embeddings", ROUTE_NO_BODY, SCOPE_READ, API_LISTED, handle_list)            \
  ROUTE(ROUTE_EMBEDDING_GET, "GET", "/v1/embeddings/{id}", ROUTE_NO_BODY, SCOPE_READ, "", handle_get)                 \
  ROUTE(ROUTE_EMBEDDING_DELETE, "DELETE", "/v1/embeddings/{id}", ROUTE_NO_BODY, SCOPE_WRITE, "", handle_delete)       \
  ROUTE(ROUTE_EMBEDDING_SPHERE, "GET", "/v1/embeddings/{id}/sphere.ply", ROUTE_NO_BODY, SCOPE_READ, "", handle_file)  \
  ROUTE(ROUTE_LANDMARKS_CREATE, "POST", "/v1/landmarks", ROUTE_JSON_BODY, SCOPE_WRITE, "", handle_landmarks_create)   \
  ROUTE(ROUTE_LANDMARKS_LIST, "GET", "/v1/landmarks", ROUTE_NO_BODY, SCOPE_READ, API_LISTED, handle_list)             \
  ROUTE(ROUTE_LANDMARKS_GET, "GET", "/v1/landmarks/{id}", ROUTE_NO_BODY, SCOPE_READ, "", handle_get)                  \
  ROUTE(ROUTE_LANDMARKS_DELETE, "DELETE", "/v1/landmarks/{id}", ROUTE_NO_BODY, SCOPE_WRITE, "", handle_delete)        \
  ROUTE(ROUTE_SUPERMESH_CREATE, "POST", "/v1/supermeshes", ROUTE_JSON_BODY, SCOPE_WRITE, "wait", handle_create)       \
  ROUTE(ROUTE_SUPERMESH_LIST, "GET", "/v1/supermeshes", ROUTE_NO_BODY, SCOPE_READ, API_LISTED " mesh name view",      \
        handle_list)                                                                                                  \
  ROUTE(ROUTE_SUPERMESH_GET, "GET", "/v1/supermeshes/{id}", ROUTE_NO_BODY, SCOPE_READ, API_SIGNED, handle_get)        \
  ROUTE(ROUTE_SUPERMESH_DELETE, "DELETE", "/v1/supermeshes/{id}", ROUTE_NO_BODY, SCOPE_WRITE, "", handle_delete)      \
  ROUTE(ROUTE_SUPERMESH_ASSET, "GET", "/v1/supermeshes/{id}/asset.glb", ROUTE_NO_BODY, SCOPE_READ,                    \
        "profile " API_SIGNED, handle_file)                                                                           \
  ROUTE(ROUTE_SUPERMESH_PLACES, "GET", "/v1/supermeshes/{id}/places", ROUTE_NO_BODY, SCOPE_READ, API_SIGNED,          \
        handle_file)                                                                                                  \
  ROUTE(ROUTE_SUPERMESH_SPHERE, "GET", "/v1/supermeshes/{id}/spheres/{k}.ply", ROUTE_NO_BODY, SCOPE_READ, API_SIGNED, \
        handle_file)                                                                                                  \
  ROUTE(ROUTE_MORPH, "GET", "/v1/morph.glb", ROUTE_NO_BODY, SCOPE_READ, API_RECIPE API_SIGNED, handle_morph)          \
  ROUTE(ROUTE_JOB_LIST, "GET", "/v1/jobs", ROUTE_NO_BODY, SCOPE_READ, API_LISTED " state", handle_job_list)           \
  ROUTE(ROUTE_JOB_GET, "GET", "/v1/jobs/{job}", ROUTE_NO_BODY, SCOPE_READ, "wait", handle_job_get)                    \
  ROUTE(ROUTE_JOB_CANCEL, "DELETE", "/v1/jobs/{job}", ROUTE_NO_BODY, SCOPE_WRITE, "", handle_job_cancel)              \
  ROUTE(ROUTE_JOB_EVENTS, "GET", "/v1/jobs/{job}/events", ROUTE_NO_BODY, SCOPE_READ, "last_event_id",                 \
        handle_job_events)                                                                                            \
  ROUTE(ROUTE_DELIVERY_LIST, "GET", "/v1/jobs/{job}/deliveries", ROUTE_NO_BODY, SCOPE_READ, "", handle_delivery_list) \
  ROUTE(ROUTE_DELIVERY_RETRY, "POST", "/v1/jobs/{job}/deliveries/{k}/retry", ROUTE_NO_BODY, SCOPE_WRITE, "",          \
        handle_delivery_retry)                                                                                        \
  ROUTE(ROUTE_USAGE, "GET", "/v1/usage", ROUTE_NO_BODY, SCOPE_READ, "limit page_token", handle_usage)                 \
  ROUTE(ROUTE_LIVEZ, "GET", "/livez", ROUTE_NO_BODY, SCOPE_NONE, "", handle_system)                                   \
  ROUTE(ROUTE_READYZ, "GET", "/readyz", ROUTE_NO_BODY, SCOPE_NONE, "verbose?", handle_system)                         \
  ROUTE(ROUTE_METRICS, "GET", "/metrics", ROUTE_NO_BODY, SCOPE_ADMIN, "", handle_system)                              \
  ROUTE(ROUTE_OPENAPI, "GET", "/openapi.json", ROUTE_NO_BODY, SCOPE_NONE, "", handle_system)                          \
  ROUTE(ROUTE_DOCS, "GET", "/docs", ROUTE_NO_BODY, SCOPE_NONE, NULL, handle_system)                                   \
  ROUTE(ROUTE_ROOT, "GET", "/", ROUTE_NO_BODY, SCOPE_NONE, NULL, handle_system)

#define API_ROUTE_ID(id, method, path, body, scope, query, handler) id,
typedef enum route_id { API_ROUTES(API_ROUTE_ID) ROUTE_COUNT } route_id;
#undef API_ROUTE_ID

typedef enum route_body { ROUTE_NO_BODY, ROUTE_JSON_BODY, ROUTE_MESH_BODY } route_body;
typedef enum route_scope { SCOPE_NONE = 0, SCOPE_READ = 1, SCOPE_WRITE = 2, SCOPE_ADMIN = 4 } route_scope;

typedef struct route {
  route_id id;
  const char *method;
  const char *path;
  route_body body;
  route_scope scope;
  const char *query;
} route;

/* Finds the route of a request, and fills id if the path has one. HEAD finds the route of GET. Returns NULL with an
 * empty allow if there is no such path, and NULL with allow filled, such as "GET, HEAD", if the path has other methods.
 */
const route *api_route_find(const char *method, const char *path, char id[API_ID_SIZE], char allow[64]);
/* Returns the number in place of {k} in the path of a found route; −1 if the route has none. */
int api_route_number(const route *found, const char *path);

#endif
