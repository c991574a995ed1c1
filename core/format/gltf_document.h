/* What a GLB is written from. core/transfer fills it. */
#ifndef ORB_FORMAT_GLTF_DOCUMENT_H
#define ORB_FORMAT_GLTF_DOCUMENT_H

#include "orbmorph/mesh.h"

/* Numbers that glTF 2.0 assigns. */
enum {
  ORB_GLTF_UBYTE = 5121,
  ORB_GLTF_USHORT = 5123,
  ORB_GLTF_UINT = 5125,
  ORB_GLTF_FLOAT = 5126,
  ORB_GLTF_ARRAY_BUFFER = 34962,
  ORB_GLTF_ELEMENT_ARRAY_BUFFER = 34963,
};

/* An accessor with a buffer view of its own. */
typedef struct orb_gltf_accessor {
  size_t offset, length;  /* bytes in the binary chunk; offset is a multiple of 4 */
  int32_t count;          /* elements, at least 1 */
  int32_t components;     /* 1 to 4: SCALAR, VEC2, VEC3, VEC4 */
  int32_t component_type; /* ORB_GLTF_USHORT, … */
  int32_t target;         /* of the buffer view; 0: none */
  int32_t bounded;        /* min and max are given */
  double min[4], max[4];
} orb_gltf_accessor;

/* Accessor numbers; −1: none. */
typedef struct orb_gltf_attributes {
  int32_t position, normal, tangent, texcoord, color;
} orb_gltf_attributes;

typedef struct orb_gltf_primitive {
  int32_t indices, material;
  orb_gltf_attributes base;
  const orb_gltf_attributes *targets; /* target_count */
} orb_gltf_primitive;

typedef struct orb_gltf_image {
  size_t offset, length;
  const char *mime;
} orb_gltf_image;

/* A number or a text of mesh.extras. */
typedef struct orb_gltf_extra {
  const char *name;
  const char *text; /* NULL: number */
  double number;
} orb_gltf_extra;

typedef struct orb_gltf_scene {
  const char *name; /* of the mesh and its node */
  int32_t accessor_count, primitive_count, target_count, material_count, material_value_count, image_count, extra_count;
  const orb_gltf_accessor *accessors;
  const orb_gltf_primitive *primitives;
  const char *const *target_names;
  const orb_material *materials;             /* their image numbers, and those of the values, index images */
  const orb_material_value *material_values; /* of each material, see orb_material */
  const orb_gltf_image *images;
  const orb_gltf_extra *extras;
  int32_t times, weights; /* accessors of the animation "morph"; −1: none */
} orb_gltf_scene;

#endif
