/* Meshes of a glTF document that a request names. */
#ifndef ORB_FORMAT_GLTF_NAMED_HH
#define ORB_FORMAT_GLTF_NAMED_HH

#include "format/gltf_values.hh"
#include "orbmorph/mesh.h"

namespace gltf {

/* Of each mesh: whether it is named, by its number or by a node that shows it or is above one that does. A number or
 * name that the document does not have is ORB_E_BAD_OPTION. */
std::vector<bool> named_meshes(const cJSON *doc, size_t mesh_count, const orb_document_parts &parts);

}  // namespace gltf

#endif
