/* Supermeshes on the wire: the request with its landmarks, its canonical text and id, and the object. */
#ifndef ORB_API_SUPERMESH_CODEC_H
#define ORB_API_SUPERMESH_CODEC_H

#include "api/embedding_codec.h"
#include "api/mesh_codec.h"
#include "orbmorph/merge.h"

enum { API_SHAPES_MAX = 16, API_LANDMARKS_MAX = 1024 };

typedef enum api_place_kind { API_PLACE_VERTEX, API_PLACE_POINT, API_PLACE_TRIANGLE } api_place_kind;

/* A place as a caller names it: a vertex or triangle of the file, or a point in space. */
typedef struct api_place {
  api_place_kind kind;
  int32_t index; /* of the vertex or triangle, in the file */
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

/* Reads a `landmarks` array, or an object with that member (a landmark file). shape_count 0: as many as the first
 * landmark has. 1, or 0 with the problem. */
int api_landmarks_read(const cJSON *value, int32_t shape_count, api_landmark_list *out, api_problem *problem);
void api_landmarks_free(api_landmark_list *list);

typedef struct api_supermesh_request {
  int32_t shape_count;
  struct api_shape_spec {
    char mesh[API_ID_SIZE];
    char name[ORB_NAME_MAX]; /* empty: that of the mesh */
  } shapes[API_SHAPES_MAX];
  api_landmark_list landmarks;
  orb_embed_options embedding; /* of every shape */
  orb_merge_options merge;
} api_supermesh_request;

/* 1, or 0 with the problem; *out is to be freed either way. */
int api_supermesh_request_read(const cJSON *body, api_supermesh_request *out, api_problem *problem);
void api_supermesh_request_free(api_supermesh_request *request);

/* Fills empty names from the meshes and refuses landmarks beyond their files. meshes: one summary a shape. */
int api_supermesh_request_resolve(api_supermesh_request *request, const api_mesh_summary *meshes, api_problem *problem);

/* The canonical request, itself a valid request that reads back the same. */
void api_supermesh_request_write(const api_supermesh_request *request, api_text *out);
int api_supermesh_request_id(const api_supermesh_request *request, char id[API_ID_SIZE]);

/* {"vertex":i}, {"point":[…]} or {"triangle":t,"barycentric":[…]}. */
void api_place_write(api_text *out, const api_place *spot);

/* embed_ms: what the embeddings of this job took; 0 where all were known. found: the places that the alignment found,
 * as a request would name them: found_count × shape_count. */
void api_supermesh_write(const char *id, const api_supermesh_request *request, const orb_merge_result *result,
                         const api_place *found, double embed_ms, int64_t created, api_text *out);
/* The values of "certificate" and "pairs", for the bench as well. */
void api_merge_certificate_write(const orb_merge_result *result, api_text *out);
void api_pairs_write(const orb_merge_result *result, api_text *out);
#endif
