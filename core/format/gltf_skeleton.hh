/* The skeleton of a skin: its joints and the nodes above them, as a document has them at rest. */
#ifndef ORB_FORMAT_GLTF_SKELETON_HH
#define ORB_FORMAT_GLTF_SKELETON_HH

#include "format/gltf_accessor.hh"
#include "format/gltf_scene.hh"

namespace gltf {

using Matrices = Counted<Matrix>;
using Indices = Counted<int64_t>;

const size_t NODES_A_CHECK = 4096; /* nodes or joints between two checks for cancellation */

inline void check_sometimes(orb_context *ctx, size_t step) {
  if (step % NODES_A_CHECK == 0) {
    must(orb_context_check(ctx));
  }
}

/* Throws where the nodes of the document are no tree. */
struct Skeleton {
  Skeleton(orb_context *context, const cJSON *document, int32_t number);

  const Matrix &world(int64_t node) const { return worlds[static_cast<size_t>(node)]; }
  Matrices inverse_binds(const Buffers &buffers) const;

  orb_context *ctx;
  const cJSON *skin;
  List nodes;
  Indices joints;  /* their nodes */
  Indices above;   /* the parent of each node, or NONE */
  Indices kept;    /* the nodes of the skeleton, by their numbers */
  Indices order;   /* the same, each after its parent */
  Matrices worlds; /* of each node of the skeleton; the others have the identity */

 private:
  void link_nodes();
  void place_nodes();
};

/* Of an affine transform. Throws where it flattens. */
Matrix inverse(const Matrix &matrix);

}  // namespace gltf

#endif
