/* Embeddings on the wire: the request, its canonical text and id, and the object. */
#ifndef ORB_API_EMBEDDING_CODEC_H
#define ORB_API_EMBEDDING_CODEC_H

#include <cjson/cJSON.h>

#include "api/ids.h"
#include "api/problem.h"
#include "orbmorph/embed.h"

typedef struct orb_embedding_request {
  char mesh[ORB_ID_SIZE];
  orb_embed_options options;
} orb_embedding_request;

/* 1, or 0 with the problem. */
int orb_embedding_request_read(const cJSON *body, orb_embedding_request *out, orb_problem *problem);
/* Only {"method","options"}, as a supermesh request may carry it. where: for messages. */
int orb_embedding_options_read(const cJSON *object, const char *where, int with_mesh, orb_embed_options *out,
                               orb_problem *problem);
/* The canonical request, itself a valid request; its id also covers the engine's version. */
void orb_embedding_request_write(const orb_embedding_request *request, orb_text *out);
void orb_embedding_options_members(const orb_embed_options *options, orb_text *out); /* "method":…,"options":{…} */
/* 1, or 0 out of memory. */
int orb_embedding_request_id(const orb_embedding_request *request, char id[ORB_ID_SIZE]);

void orb_embedding_write(const char *id, const orb_embedding_request *request, const orb_embedding *embedding,
                         int64_t created, orb_text *out);
#endif
