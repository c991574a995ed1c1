/* Materials: base colours and their textures. */
#ifndef ORB_CLI_VIEW_MATERIAL_H
#define ORB_CLI_VIEW_MATERIAL_H

#include <stdint.h>

#include "view_glb.h"
#include "view_texture.h"

typedef struct view_material {
  float factor[3];
  int32_t texture; /* −1: none */
  float uv[2][3];  /* texture coordinates: u′ and v′ by u, v and 1 (KHR_texture_transform) */
} view_material;

typedef struct view_materials {
  view_material *list;
  view_texture *textures;
  int32_t count, texture_count;
} view_materials;

/* Reads all materials of a file. The last one is for triangles without a material. Free also after an error. */
int view_materials_read(glb_file *r, view_materials *out);
/* Applies the transform of a material to texture coordinates in place. */
void view_material_move(const view_material *material, float *texcoords, uint32_t count);
void view_materials_free(view_materials *materials);

#endif
