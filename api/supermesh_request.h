/* The JSON of a request for a supermesh: its members, its canonical text and id. */
#ifndef ORB_API_SUPERMESH_REQUEST_H
#define ORB_API_SUPERMESH_REQUEST_H

#include "api/embedding_codec.h"
#include "api/landmark_codec.h"
#include "api/mesh_codec.h"
#include "orbmorph/merge.h"

enum { API_PARTS_MAX = 64 }; /* meshes and nodes that "template" names */

typedef struct api_supermesh_request {
  int32_t shape_count;
  struct api_shape_spec {
    char mesh[API_ID_SIZE];
    char name[ORB_NAME_MAX]; /* empty: the name of the mesh */
  } shapes[API_SHAPES_MAX];
  api_landmark_list landmarks;
  char start[API_ID_SIZE];     /* "align.start": the alignment to begin with; empty: none */
  orb_embed_options embedding; /* for every shape */
  orb_merge_options merge;     /* without file_parts, see api_supermesh_request_parts(), and carries */
  struct api_parts_spec {
    int32_t mesh_count, node_count;
    int32_t meshes[API_PARTS_MAX];
    char nodes[API_PARTS_MAX][ORB_NAME_MAX];
  } parts;
  int32_t carry_count; /* "transfer" */
  orb_carry carries[ORB_CARRY_MAX];
} api_supermesh_request;

/* Returns 1, or 0 with *problem filled. The caller frees *out in either case. */
int api_supermesh_request_read(const cJSON *body, api_supermesh_request *out, api_problem *problem);

void api_supermesh_request_free(api_supermesh_request *request);

/* Fills empty names from the meshes, and refuses landmarks whose vertex or triangle the file does not have. Returns 1,
 * or 0 with *problem filled. meshes: one summary for each shape. */
int api_supermesh_request_resolve(api_supermesh_request *request, const api_mesh_summary *meshes, api_problem *problem);

/* The parts for the merge; they refer to the request and to names, which must live as long. */
void api_supermesh_request_parts(const api_supermesh_request *request, const char *names[API_PARTS_MAX],
                                 orb_document_parts *out);

/* Appends the canonical request, which is itself a valid request and reads back as the same one. */
void api_supermesh_request_write(const api_supermesh_request *request, api_text *out);

int api_supermesh_request_id(const api_supermesh_request *request, char id[API_ID_SIZE]);

/* The id of the request's alignment: the hash of all that it depends on, which are the meshes in their order, the
 * options of their embeddings, the landmarks without their names, the options of the alignment, and the engine. */
int api_alignment_id(const api_supermesh_request *request, char id[API_ID_SIZE]);

#endif
