/* The mesh of a GLB with its morph targets; all primitives form one mesh. */
#ifndef ORB_CLI_VIEW_MESH_H
#define ORB_CLI_VIEW_MESH_H

#include <stddef.h>
#include <stdint.h>

#include "view_material.h"

typedef struct view_mesh {
  uint32_t vertex_count, index_count, target_count;
  uint32_t between;                       /* in-betweens of each transition; their targets follow those of the shapes */
  float *positions, *normals, *colors;    /* 3 per vertex */
  float *texcoords;                       /* 2 per vertex */
  float *delta_positions, *delta_normals; /* 3 per vertex, target by target */
  uint32_t *indices;
  int32_t *painted;    /* material of each triangle */
  unsigned char *flat; /* whether a triangle has no normals: glTF asks for those of its plane */
  view_materials materials;
} view_mesh;

/* Returns 0, or −1 with the reason in `error` and nothing to free. */
int view_mesh_read(const char *path, view_mesh *out, char *error, size_t error_size);
void view_mesh_free(view_mesh *mesh);
int view_shape_count(const view_mesh *mesh);

#endif
