/* Meshes on the wire: the repair list of an upload, and the object that describes a mesh. */
#ifndef ORB_API_MESH_CODEC_H
#define ORB_API_MESH_CODEC_H

#include "api/ids.h"
#include "api/problem.h"
#include "orbmorph/format.h"

/* "safe", "none", "fill_holes,largest_component", … → flags and the canonical list. 1, or 0 with the problem. */
enum { ORB_REPAIR_TEXT = 64 };
int orb_repair_parse(const char *list, unsigned *flags, char canonical[ORB_REPAIR_TEXT], orb_problem *problem);

typedef struct orb_mesh_facts {
  const char *id, *name, *format, *repair;
  int64_t bytes, created; /* ms since 1970 */
  const orb_mesh *mesh;   /* as repaired */
  orb_topology topology;
  orb_extent extent;
} orb_mesh_facts;
void orb_mesh_write(const orb_mesh_facts *facts, orb_text *out);

/* What later requests need of a stored description. 1, or 0 if it does not decode. */
typedef struct orb_mesh_summary {
  char name[ORB_NAME_MAX], format[8], repair[ORB_REPAIR_TEXT];
  int64_t vertices, triangles, file_vertices, file_triangles;
} orb_mesh_summary;
int orb_mesh_summarise(const char *json, orb_mesh_summary *out);

#endif
