/* The materials of the asset: those of the first shape, without what the asset cannot have. */
#ifndef ORB_TRANSFER_MATERIALS_H
#define ORB_TRANSFER_MATERIALS_H

#include "format/gltf_document.h"
#include "transfer/draft.h"

/* What a scene refers to; memory of the context. */
typedef struct orb_draft_materials {
  orb_material *materials;
  orb_material_value *values;
  orb_gltf_image *images;
} orb_draft_materials;

/* The texture whose coordinates the tangents of a material follow; NULL if it needs none. */
const orb_texture *orb_material_tangents(const orb_mesh *mesh, int32_t material, const orb_asset_options *options);

/* Appends the images to the binary chunk, and sets the materials, values and images of the scene. Without materials: a
 * plain one. Free also after an error. */
ORB_MUST_CHECK orb_status orb_draft_materials_add(orb_context *ctx, const orb_draft *draft, orb_buffer *binary,
                                                  orb_draft_materials *out, orb_gltf_scene *scene);
void orb_draft_materials_free(orb_context *ctx, orb_draft_materials *materials);

/* The part of orb_asset_dropped() that is about the later shapes. */
ORB_MUST_CHECK orb_status orb_dropped_later(orb_context *ctx, const orb_aligned_shape *shapes, int32_t shape_count,
                                            orb_dropped **list, int32_t *count);

#endif
