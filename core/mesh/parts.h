/* The pieces of a mesh by size and name. */
#ifndef ORB_MESH_PARTS_H
#define ORB_MESH_PARTS_H

#include "mesh/surface.h"

typedef struct orb_part {
  int64_t triangles;
  int32_t piece;  /* its label in orb_surface.piece */
  int32_t object; /* of the mesh's objects, the one with most of its triangles; −1: none has a name */
} orb_part;

/* Largest first, equal ones in the order of their first triangles. */
typedef struct orb_parts {
  orb_part *part;
  int32_t count;
} orb_parts;

/* Lists the pieces by the labels in surface.piece, which are below piece_count. The caller frees parts.part. O(F). */
ORB_MUST_CHECK orb_status orb_parts_list(orb_surface *surface, orb_parts *out);

/* "" where the file has no name. */
const char *orb_part_name(const orb_mesh *mesh, const orb_part *part);

/* The name of the node that shows its mesh (glTF), or "". */
const char *orb_part_node(const orb_mesh *mesh, const orb_part *part);

/* The index of the part that the options name, −1: there is none. By a name: the largest part with this name, else the
 * largest one with this node, else the one that has the first triangle of an object with this name or node: it may be
 * joined to a larger one. O(F). */
int32_t orb_parts_find(const orb_surface *surface, const orb_parts *parts, const orb_repair_options *options);

#endif
