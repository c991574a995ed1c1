/* The JSON of embeddings: the request, its canonical text and id, and the resource. */
#ifndef ORB_API_EMBEDDING_CODEC_H
#define ORB_API_EMBEDDING_CODEC_H

#include <cjson/cJSON.h>

#include "api/ids.h"
#include "api/problem.h"
#include "orbmorph/embed.h"

typedef struct api_embedding_request {
  char mesh[API_ID_SIZE];
  orb_embed_options options;
} api_embedding_request;

/* Returns 1, or 0 with *problem filled. */
int api_embedding_request_read(const cJSON *body, api_embedding_request *out, api_problem *problem);
/* Reads {"method","options"}, which a supermesh request may contain, and accepts "mesh" if with_mesh. Returns 1, or 0
 * with *problem filled. where: names the object in messages. */
int api_embedding_options_read(const cJSON *object, const char *where, int with_mesh, orb_embed_options *out,
                               api_problem *problem);
/* Appends the canonical request, which is itself a valid request. The id also covers the engine's version. */
void api_embedding_request_write(const api_embedding_request *request, api_text *out);
void api_embedding_options_members(const orb_embed_options *options, api_text *out); /* "method":…,"options":{…} */
/* Returns 1, or 0 if memory runs out. */
int api_embedding_request_id(const api_embedding_request *request, char id[API_ID_SIZE]);

void api_embedding_write(const char *id, const api_embedding_request *request, const orb_embedding *embedding,
                         int64_t created, api_text *out);
#endif
