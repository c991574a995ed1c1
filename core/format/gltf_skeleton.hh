/* A skin of one glTF document, copied into another: its joints, the nodes above them, its inverse bind matrices. */
#ifndef ORB_FORMAT_GLTF_SKELETON_HH
#define ORB_FORMAT_GLTF_SKELETON_HH

#include "format/gltf_edit.hh"
#include "format/gltf_scene.hh"
#include "format/gltf_skin.h"

namespace gltf {

/* Adds the nodes and the skin to the document that is edited; returns the number of the skin. shown: the transform of
 * the mesh that gets it. The joints stand where the shape was moved to, and in their rest the mesh stays in place where
 * it did so in the source. */
int64_t copy_skin(orb_context *ctx, cJSON *doc, Editor *editor, const orb_added_skin &from, const Matrix &shown);

}  // namespace gltf

#endif
