/* Supermeshes on the wire: the request with its landmarks, its canonical text and id, and the object. */
#ifndef ORB_API_SUPERMESH_CODEC_H
#define ORB_API_SUPERMESH_CODEC_H

#include "api/embedding_codec.h"
#include "api/mesh_codec.h"
#include "orbmorph/merge.h"

enum { ORB_SHAPES_MAX = 16, ORB_LANDMARKS_MAX = 1024 };

typedef enum orb_spot_kind { ORB_SPOT_VERTEX, ORB_SPOT_POINT, ORB_SPOT_TRIANGLE } orb_spot_kind;

/* A place as a caller names it: a vertex or triangle of the file, or a point in space. */
typedef struct orb_spot {
  orb_spot_kind kind;
  int32_t index; /* of the vertex or triangle, in the file */
  double at[3];  /* the point, or barycentric coordinates (≥ 0, sum 1) */
} orb_spot;

typedef struct orb_landmark_spec {
  char name[ORB_NAME_MAX];
  int32_t pass;
  double radius, confidence;
} orb_landmark_spec;

typedef struct orb_landmark_list {
  int32_t count, shape_count;
  orb_landmark_spec *items; /* malloc'ed */
  orb_spot *spots;          /* count × shape_count */
} orb_landmark_list;

/* Reads a `landmarks` array, or an object with that member (a landmark file). shape_count 0: as many as the first
 * landmark has. 1, or 0 with the problem. */
int orb_landmarks_read(const cJSON *value, int32_t shape_count, orb_landmark_list *out, orb_problem *problem);
void orb_landmarks_free(orb_landmark_list *list);

typedef struct orb_supermesh_request {
  int32_t shape_count;
  struct orb_shape_spec {
    char mesh[ORB_ID_SIZE];
    char name[ORB_NAME_MAX]; /* empty: that of the mesh */
  } shapes[ORB_SHAPES_MAX];
  orb_landmark_list landmarks;
  orb_embed_options embedding; /* of every shape */
  orb_merge_options merge;
} orb_supermesh_request;

/* 1, or 0 with the problem; *out is to be freed either way. */
int orb_supermesh_request_read(const cJSON *body, orb_supermesh_request *out, orb_problem *problem);
void orb_supermesh_request_free(orb_supermesh_request *request);

/* Fills empty names from the meshes and refuses landmarks beyond their files. meshes: one summary a shape. */
int orb_supermesh_request_resolve(orb_supermesh_request *request, const orb_mesh_summary *meshes, orb_problem *problem);

/* The canonical request, itself a valid request that reads back the same. */
void orb_supermesh_request_write(const orb_supermesh_request *request, orb_text *out);
int orb_supermesh_request_id(const orb_supermesh_request *request, char id[ORB_ID_SIZE]);

/* {"vertex":i}, {"point":[…]} or {"triangle":t,"barycentric":[…]}. */
void orb_spot_write(orb_text *out, const orb_spot *spot);

/* embed_ms: what the embeddings of this job took; 0 where all were known. found: the places that the alignment found,
 * as a request would name them: found_count × shape_count. */
void orb_supermesh_write(const char *id, const orb_supermesh_request *request, const orb_merge_result *result,
                         const orb_spot *found, double embed_ms, int64_t created, orb_text *out);
/* The values of "certificate" and "pairs", for the bench as well. */
void orb_merge_certificate_write(const orb_merge_result *result, orb_text *out);
void orb_pairs_write(const orb_merge_result *result, orb_text *out);
#endif
