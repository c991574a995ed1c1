/* Embeddings on the wire: the request, its canonical text and id, and the object. */
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

/* 1, or 0 with the problem. */
int api_embedding_request_read(const cJSON *body, api_embedding_request *out, api_problem *problem);
/* Only {"method","options"}, as a supermesh request may carry it. where: for messages. */
int api_embedding_options_read(const cJSON *object, const char *where, int with_mesh, orb_embed_options *out,
                               api_problem *problem);
/* The canonical request, itself a valid request; its id also covers the engine's version. */
void api_embedding_request_write(const api_embedding_request *request, api_text *out);
void api_embedding_options_members(const orb_embed_options *options, api_text *out); /* "method":…,"options":{…} */
/* 1, or 0 out of memory. */
int api_embedding_request_id(const api_embedding_request *request, char id[API_ID_SIZE]);

void api_embedding_write(const char *id, const api_embedding_request *request, const orb_embedding *embedding,
                         int64_t created, api_text *out);
#endif
