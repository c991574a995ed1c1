/* A glTF document without compression: what EXT_meshopt_compression and KHR_draco_mesh_compression hold lies in plain
 * buffer views. */
#ifndef ORB_FORMAT_GLTF_UNPACK_HH
#define ORB_FORMAT_GLTF_UNPACK_HH

#include "format/gltf_accessor.hh"
#include "format/gltf_edit.hh"

namespace gltf {

/* Whether something that a mesh draws is compressed. */
bool is_compressed(const cJSON *doc, const cJSON *mesh);

/* Replaces all compressed buffer views and primitives by plain ones at the end of the first buffer, and takes the
 * extensions out of the document. Components keep their types and values; the compressed bytes stay, unused. */
void unpack(orb_context *ctx, cJSON *doc, const Buffers &buffers, Editor *editor);

}  // namespace gltf

#endif
