/* Meshes on the wire: the repair list of an upload, and the object that describes a mesh. */
#ifndef ORB_API_MESH_CODEC_H
#define ORB_API_MESH_CODEC_H

#include "api/ids.h"
#include "api/problem.h"
#include "orbmorph/format.h"

/* "safe", "none", "fill_holes,largest_component", … → flags and the canonical list. 1, or 0 with the problem. */
enum { API_REPAIR_TEXT = 64 };
int api_repair_parse(const char *list, unsigned *flags, char canonical[API_REPAIR_TEXT], api_problem *problem);

typedef struct api_mesh_facts {
  const char *id, *name, *format, *repair;
  int64_t bytes, created; /* ms since 1970 */
  const orb_mesh *mesh;   /* as repaired */
  orb_topology topology;
  orb_extent extent;
} api_mesh_facts;
void api_mesh_write(const api_mesh_facts *facts, api_text *out);

/* What later requests need of a stored description. 1, or 0 if it does not decode. */
typedef struct api_mesh_summary {
  char name[ORB_NAME_MAX], format[8], repair[API_REPAIR_TEXT];
  int64_t vertices, triangles, file_vertices, file_triangles;
} api_mesh_summary;
int api_mesh_summarise(const char *json, api_mesh_summary *out);

#endif
