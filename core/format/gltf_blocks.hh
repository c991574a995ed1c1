/* The vertices of a glTF document, numbered as orb_mesh_read() numbers them. */
#ifndef ORB_FORMAT_GLTF_BLOCKS_HH
#define ORB_FORMAT_GLTF_BLOCKS_HH

#include "format/gltf_accessor.hh"
#include "format/gltf_scene.hh"

namespace gltf {

/* The vertices of a triangle primitive. A mesh that the scene shows more than once has blocks for each time. */
struct Block {
  size_t mesh;
  const cJSON *primitive;
  int64_t first;
  size_t count;
  Matrix matrix; /* to the scene */
};

/* All blocks, by their first vertex. */
Counted<Block> blocks_of(orb_context *ctx, const cJSON *doc);

/* Whether the primitive consists of triangles with positions, so that its vertices have numbers. */
bool is_surface(const cJSON *primitive);

/* The set of texture coordinates that the base colour texture of a primitive's material uses; 0 if it has none. */
int64_t painted_set(const List &materials, const cJSON *primitive);

}  // namespace gltf

#endif
