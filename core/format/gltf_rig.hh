/* A skin of one glTF document, copied into another: its joints, the nodes above them, its inverse bind matrices, and
 * the animations of all these. */
#ifndef ORB_FORMAT_GLTF_RIG_HH
#define ORB_FORMAT_GLTF_RIG_HH

#include "format/gltf_edit.hh"
#include "format/gltf_scene.hh"
#include "format/gltf_skin.h"

namespace gltf {

/* Adds the nodes, the skin and the animations to the document that is edited; returns the number of the skin. shown:
 * the transform of the mesh that gets it. Where the source's rest shows its mesh as it is, the joints move to where
 * they belong on the base, and their rest shows the base as it is. Else they stand where the shape was moved to. */
int64_t copy_skin(orb_context *ctx, cJSON *doc, Editor *editor, const orb_added_skin &from, const Matrix &shown);

}  // namespace gltf

#endif
