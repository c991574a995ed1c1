/* A glTF document with more morph targets: everything else stays as it is.
 *
 * The bytes of the document's first buffer stay, and those of the targets follow. All members of the JSON stay, with
 * their order and values. It changes primitives[].targets, the weights of meshes and nodes, extras.targetNames and
 * extras.firstShape of the meshes, keyframes of these weights, and the lists of accessors, views and animations. Where
 * a mesh that gets targets is compressed, the document is unpacked: see gltf_unpack.hh. */
#ifndef ORB_FORMAT_GLTF_KEEP_H
#define ORB_FORMAT_GLTF_KEEP_H

#include "format/gltf_shapes.h"
#include "orbmorph/material.h"
#include "orbmorph/mesh.h"

typedef struct orb_gltf_kept {
  int32_t vertex_count;    /* of the triangle primitives of all meshes, one after another: the first of the file */
  int32_t primitive_count; /* triangle primitives */
  int32_t attributes;      /* that a target morphs, at most */
  orb_dropped *dropped;    /* freed by the caller, after an error too */
  int32_t dropped_count;
} orb_gltf_kept;

/* Appends a GLB. Existing targets come first, and keep their names and weights; a mesh without vertices on the surface
 * gets no targets. ORB_E_BAD_OPTION: the document cannot be kept, see the message. */
#ifdef __cplusplus
extern "C" {
#endif
ORB_MUST_CHECK orb_status orb_gltf_keep(orb_context *ctx, const unsigned char *bytes, size_t size,
                                        const orb_gltf_shapes *shapes, orb_gltf_kept *kept, orb_buffer *out);
#ifdef __cplusplus
}
#endif

#endif
