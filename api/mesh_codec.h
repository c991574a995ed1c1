/* The JSON of meshes, and the repair list of an upload. */
#ifndef ORB_API_MESH_CODEC_H
#define ORB_API_MESH_CODEC_H

#include <cjson/cJSON.h>

#include "api/ids.h"
#include "api/problem.h"
#include "orbmorph/format.h"

/* Parses a list such as "safe" or "fill_holes,close_handles" and the parameters beside it, which may be NULL, into
 * options and a canonical list, which holds the parameters too and parses to the same options. Returns 1, or 0 with
 * *problem filled. */
enum { API_REPAIR_TEXT = 256 };
int api_repair_parse(const char *list, const char *handle_size, const char *part, orb_repair_options *out,
                     char canonical[API_REPAIR_TEXT], api_problem *problem);

/* What an upload says about its file, as text; each may be absent (NULL). */
typedef struct api_upload_query {
  const char *name, *repair, *handle_size, *part, *format;
} api_upload_query;

/* The same, checked. Returns 1, or 0 with *problem filled. */
typedef struct api_upload {
  char name[ORB_NAME_MAX], repair[API_REPAIR_TEXT];
  orb_repair_options options;
  orb_format hint;
} api_upload;
int api_upload_read(const api_upload_query *query, api_upload *out, api_problem *problem);

typedef struct api_mesh_facts {
  const char *id, *name, *format, *repair;
  int64_t bytes, created; /* ms since 1970 */
  const orb_mesh *mesh;   /* after repairs */
  orb_topology topology;
  orb_extent extent;
} api_mesh_facts;
void api_mesh_write(const api_mesh_facts *facts, api_text *out);

/* As large as the longest name of a format. */
#define API_FORMAT_NAME(id, value, function, name) char of_##function[sizeof(name)];
typedef union api_format_name {
  ORB_FORMATS(API_FORMAT_NAME)
} api_format_name;
#undef API_FORMAT_NAME

/* What later requests need from a stored description. */
typedef struct api_mesh_summary {
  char name[ORB_NAME_MAX], format[sizeof(api_format_name)], repair[API_REPAIR_TEXT];
  int64_t vertices, triangles, file_vertices, file_triangles;
} api_mesh_summary;
/* Returns 1, or 0 if the text does not decode. */
int api_mesh_summarise(const char *json, api_mesh_summary *out);

#endif
