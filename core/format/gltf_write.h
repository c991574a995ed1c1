/* Writing binary glTF. core/transfer describes the scene; this writes it down. */
#ifndef ORB_FORMAT_GLTF_WRITE_H
#define ORB_FORMAT_GLTF_WRITE_H

#include "format/gltf_document.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Appends the GLB. In texts that are not UTF-8, U+FFFD replaces the bad bytes. ORB_E_TOO_LARGE, ORB_E_NO_MEMORY. */
ORB_MUST_CHECK orb_status orb_gltf_write(orb_context *ctx, const orb_gltf_scene *scene, const orb_buffer *binary,
                                         orb_buffer *out);

/* Appends the header of a GLB, its JSON, and the header of its binary chunk of binary_size bytes, to which the caller
 * adds zeros up to a multiple of four. ORB_E_TOO_LARGE. */
ORB_MUST_CHECK orb_status orb_glb_head(orb_context *ctx, const orb_buffer *json, size_t binary_size, orb_buffer *out);

#ifdef __cplusplus
}
#endif
#endif
