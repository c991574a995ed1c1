/* The JSON of supermeshes: the request with its landmarks, its canonical text and id, and the resource. */
#ifndef ORB_API_SUPERMESH_CODEC_H
#define ORB_API_SUPERMESH_CODEC_H

#include "api/embedding_codec.h"
#include "api/mesh_codec.h"
#include "orbmorph/merge.h"

enum { API_SHAPES_MAX = 16, API_LANDMARKS_MAX = 1024 };

typedef enum api_place_kind { API_PLACE_VERTEX, API_PLACE_POINT, API_PLACE_TRIANGLE } api_place_kind;

/* A place as a request names it: a vertex or triangle of the file, or a point in space. */
typedef struct api_place {
  api_place_kind kind;
  int32_t index; /* vertex or triangle number of the file */
  double at[3];  /* the point, or barycentric coordinates (≥ 0, sum 1) */
} api_place;

typedef struct api_landmark_spec {
  char name[ORB_NAME_MAX];
  int32_t pass;
  double radius, confidence;
} api_landmark_spec;

typedef struct api_landmark_list {
  int32_t count, shape_count;
  api_landmark_spec *items; /* malloc'ed */
  api_place *spots;         /* count × shape_count */
} api_landmark_list;

/* Reads a `landmarks` array, or an object with that member (a landmark file). Returns 1, or 0 with *problem filled. The
 * caller frees *out in either case. shape_count: 0 takes the number of places of the first landmark. */
int api_landmarks_read(const cJSON *value, int32_t shape_count, api_landmark_list *out, api_problem *problem);
void api_landmarks_free(api_landmark_list *list);

typedef struct api_supermesh_request {
  int32_t shape_count;
  struct api_shape_spec {
    char mesh[API_ID_SIZE];
    char name[ORB_NAME_MAX]; /* empty: the name of the mesh */
  } shapes[API_SHAPES_MAX];
  api_landmark_list landmarks;
  orb_embed_options embedding; /* for every shape */
  orb_merge_options merge;
} api_supermesh_request;

/* Returns 1, or 0 with *problem filled. The caller frees *out in either case. */
int api_supermesh_request_read(const cJSON *body, api_supermesh_request *out, api_problem *problem);
void api_supermesh_request_free(api_supermesh_request *request);

/* Fills empty names from the meshes, and refuses landmarks whose vertex or triangle the file does not have. Returns 1,
 * or 0 with *problem filled. meshes: one summary for each shape. */
int api_supermesh_request_resolve(api_supermesh_request *request, const api_mesh_summary *meshes, api_problem *problem);

/* Appends the canonical request, which is itself a valid request and reads back as the same one. */
void api_supermesh_request_write(const api_supermesh_request *request, api_text *out);
int api_supermesh_request_id(const api_supermesh_request *request, char id[API_ID_SIZE]);

/* Appends {"vertex":i}, {"point":[…]} or {"triangle":t,"barycentric":[…]}. */
void api_place_write(api_text *out, const api_place *spot);

/* embed_ms: the time that the embeddings of this job took; 0 if all were stored. found: the found landmarks as a
 * request would name them, found_count × shape_count places. */
void api_supermesh_write(const char *id, const api_supermesh_request *request, const orb_merge_result *result,
                         const api_place *found, double embed_ms, int64_t created, api_text *out);
/* Append the values of "certificate" and "pairs", which the bench also writes. */
void api_merge_certificate_write(const orb_merge_result *result, api_text *out);
void api_pairs_write(const orb_merge_result *result, api_text *out);
#endif
