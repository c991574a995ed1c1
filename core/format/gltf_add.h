/* Adds to a GLB: attributes of its vertices, a skin with its skeleton, variants of its materials. Everything else stays
 * as it is. */
#ifndef ORB_FORMAT_GLTF_ADD_H
#define ORB_FORMAT_GLTF_ADD_H

#include "format/gltf_skin.h"
#include "orbmorph/mesh.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A set of colours or texture coordinates, which gets the next number that is free in all primitives. */
typedef struct orb_added_set {
  int32_t width;       /* 4: COLOR_n, 2: TEXCOORD_n */
  const float *values; /* of the vertices of all triangle primitives, one after another */
  int32_t number;      /* the number that it got */
} orb_added_set;

/* A picture of the base colour in the texture coordinates of the primitives. */
typedef struct orb_added_image {
  int32_t material; /* of the primitives that show it; −1: those without one */
  const unsigned char *png;
  size_t size;
} orb_added_image;

/* A variant of the materials (KHR_materials_variants). Its name is made unique. */
typedef struct orb_added_variant {
  char name[ORB_NAME_MAX + 32];
  int32_t image_count;
  const orb_added_image *images;
  double metallic, roughness;
  int is_blended, is_double_sided;
} orb_added_variant;

typedef struct orb_additions {
  int32_t vertex_count;      /* of all triangle primitives */
  const int32_t *on_surface; /* vertex_count; −1: not on the closed surface. Meshes without vertices on it stay */
  int32_t set_count;
  orb_added_set *sets;
  orb_added_skin skin;
  int32_t variant_count;
  orb_added_variant *variants;
  const char *own_name; /* of the variant with the materials that the document has; it comes first */
  int whiten;           /* the colours of vertices are new, and the plain material must not tint them */
} orb_additions;

/* Appends the GLB. ORB_E_BAD_OPTION: the meshes have a skin already. */
ORB_MUST_CHECK orb_status orb_gltf_add(orb_context *ctx, const unsigned char *bytes, size_t size,
                                       const orb_additions *additions, orb_buffer *out);

/* Whether the meshes of a document can get a skin: ORB_E_BAD_OPTION as orb_gltf_add() would. on_surface: as in
 * orb_additions. */
ORB_MUST_CHECK orb_status orb_gltf_try_room(orb_context *ctx, const unsigned char *bytes, size_t size,
                                            const int32_t *on_surface, int32_t vertex_count);

/* Whether the skeleton of a skin and its animations can be copied: fails as orb_gltf_add() would. joints, weights and
 * surface are not used. */
ORB_MUST_CHECK orb_status orb_gltf_try_skin(orb_context *ctx, const orb_added_skin *skin);

#ifdef __cplusplus
}
#endif
#endif
