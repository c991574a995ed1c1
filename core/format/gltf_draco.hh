/* Draco's decoder within bounds: faces and values that the file's size does not justify, or that have no room in the
 * budget, are refused before it allocates them. Of Draco itself, a byte may ask for any amount of memory and time. Only
 * the tables of the entropy coder of values cannot be known before: up to 768 bytes for each byte of the file. The
 * meter of the context counts them while Draco takes them; without one, nothing but the limit of a process bounds them.
 */
#ifndef ORB_FORMAT_GLTF_DRACO_HH
#define ORB_FORMAT_GLTF_DRACO_HH

#include <functional>
#include <memory>

#include <draco/mesh/mesh.h>

#include "format/gltf_values.hh"

namespace gltf {

/* A decoded mesh. What Draco allocates for it is not charged to the context; blocks that are never touched stand for
 * it, as long as the mesh lives. */
struct DracoMesh {
  std::vector<Counted<unsigned char>> reserves;
  std::unique_ptr<draco::Mesh> mesh;
};

/* Decodes a mesh. charge(bytes): called with what it holds, and with four bytes for each face and part of the
 * attributes with seams of its own, before memory is taken for that; it throws if that is too much. O(bytes + what was
 * charged). */
DracoMesh decode_draco(orb_context *ctx, Bytes bytes, const std::function<void(size_t)> &charge);

}  // namespace gltf

#endif
