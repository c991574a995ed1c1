/* Materials of a mesh, as glTF 2.0 and its material extensions define them, and what a file has that is lost. */
#ifndef ORBMORPH_MATERIAL_H
#define ORBMORPH_MATERIAL_H

#include <stddef.h>
#include <stdint.h>

#include "orbmorph/material_members.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { ORB_NAME_MAX = 128, ORB_DROPPED_MAX = 100 };

/* An image of a material: the bytes of the file, without colour profiles. */
typedef struct orb_image {
  unsigned char *bytes;
  size_t size;
  char mime[32]; /* "image/png" or "image/jpeg" */
} orb_image;

/* How a material uses an image. */
typedef struct orb_texture {
  int32_t image;                                  /* in images, −1: none */
  int32_t wrap_s, wrap_t, mag_filter, min_filter; /* glTF sampler enums, 0: not given */
  int32_t is_transformed;                         /* whether the members below are used: KHR_texture_transform */
  double offset[2], rotation, scale[2];
} orb_texture;

#define ORB_MATERIAL_ID(id, extension, name, kind, low, high, needs) ORB_MATERIAL_##id,
typedef enum orb_material_member {
  ORB_MATERIAL_MEMBERS(ORB_MATERIAL_ID) ORB_MATERIAL_MEMBER_COUNT
} orb_material_member;
#undef ORB_MATERIAL_ID

/* One member that a material has, see material_members.h. */
typedef struct orb_material_value {
  orb_material_member member;
  double number[4]; /* FLAG, MODE (opaque, mask, blend) and NUMBER: the first; TEXTURE: its scale or strength, 1 */
  orb_texture texture;
} orb_material_value;

typedef struct orb_material {
  char name[ORB_NAME_MAX];
  float base_color[4]; /* linear RGBA; 1,1,1,1 if the file gives none */
  float metallic, roughness;
  orb_texture base_texture;
  int32_t first_value, value_count; /* in the mesh's material_values: at most one a member, in their order */
} orb_material;

/* Something of a file that the asset does not have. */
typedef struct orb_dropped {
  char what[64];   /* "normalTexture", "KHR_materials_variants" */
  char where[160]; /* "materials[2] \"skin\""; "" for the whole file */
  const char *why; /* a literal */
} orb_dropped;

#ifdef __cplusplus
}
#endif
#endif
