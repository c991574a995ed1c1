/* Writing binary glTF. core/transfer describes the scene; this writes it down. */
#ifndef ORB_FORMAT_GLTF_WRITE_H
#define ORB_FORMAT_GLTF_WRITE_H

#include "format/gltf_document.h"

/* Appends the GLB. In texts that are not UTF-8, U+FFFD replaces the bad bytes. ORB_E_TOO_LARGE, ORB_E_NO_MEMORY. */
ORB_MUST_CHECK orb_status orb_gltf_write(orb_context *ctx, const orb_gltf_scene *scene, const orb_buffer *binary,
                                         orb_buffer *out);
#endif
