/* The materials of a GLB, with their textures and samplers. */
#ifndef ORB_FORMAT_GLTF_WRITE_MATERIAL_H
#define ORB_FORMAT_GLTF_WRITE_MATERIAL_H

#include "format/glb_text.h"
#include "format/gltf_document.h"

/* One pair of image and sampler. */
typedef struct orb_gltf_texture {
  int32_t image;
  size_t sampler[4]; /* magFilter, minFilter, wrapS, wrapT */
} orb_gltf_texture;

/* The textures in the order of their first use, and the number of each use; −1: none. */
typedef struct orb_gltf_textures {
  int32_t count;
  orb_gltf_texture *items;
  int32_t *of_material; /* base colour */
  int32_t *of_value;
} orb_gltf_textures;

/* O(materials + values): an image has at most 108 samplers, all that glTF allows. Free also after an error. */
ORB_MUST_CHECK orb_status orb_gltf_textures_collect(orb_context *ctx, const orb_gltf_scene *scene,
                                                    orb_gltf_textures *out);
void orb_gltf_textures_free(orb_context *ctx, orb_gltf_textures *textures);

/* Each writes a member of the document with the comma before it, or nothing if it would be empty. */
void orb_gltf_write_extensions(orb_glb_writer *w, const orb_gltf_scene *scene);
void orb_gltf_write_materials(orb_glb_writer *w, const orb_gltf_scene *scene, const orb_gltf_textures *textures);
void orb_gltf_write_samplers(orb_glb_writer *w, const orb_gltf_textures *textures);
void orb_gltf_write_textures(orb_glb_writer *w, const orb_gltf_textures *textures);

#endif
