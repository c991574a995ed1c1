/* The JSON of a request for a mesh from a URL: {"url", "name", "format", "repair"}. */
#ifndef ORB_API_FETCH_CODEC_H
#define ORB_API_FETCH_CODEC_H

#include <cjson/cJSON.h>

#include "api/mesh_codec.h"

enum { API_URL = 2048 };

typedef struct api_fetch_request {
  char url[API_URL];
  api_upload upload;
  int64_t
      quota; /* bytes that the tenant's token may store; 0: no limit. Stored with the job, not part of the request */
} api_fetch_request;

/* Return 1, or 0 with *problem filled. Does not check whether the service may fetch the URL. */
int api_fetch_request_read(const cJSON *body, api_fetch_request *out, api_problem *problem);
/* Reads the text that api_fetch_request_write() wrote. */
int api_fetch_request_load(const char *json, api_fetch_request *out, api_problem *problem);

void api_fetch_request_write(const api_fetch_request *request, api_text *out);
/* The key of the job: the id of the request without its quota. 0: out of memory. */
int api_fetch_request_key(const api_fetch_request *request, char key[API_ID_SIZE]);

#endif
