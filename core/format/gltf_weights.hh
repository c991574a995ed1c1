/* The weights of a document's morph targets, which get more of them: defaults and keyframes. */
#ifndef ORB_FORMAT_GLTF_WEIGHTS_HH
#define ORB_FORMAT_GLTF_WEIGHTS_HH

#include <map>

#include "format/gltf_edit.hh"
#include "format/gltf_shapes.h"

namespace gltf {

/* How many targets each mesh had that gets more. */
using Widened = std::map<int64_t, size_t>;

/* Appends a weight of 0 for each new target to the defaults of meshes and nodes and to all their keyframes, and adds
 * the animation "morph". Returns whether all that is asked for was added: without nodes there is no animation. */
bool widen_weights(orb_context *ctx, cJSON *doc, const Buffers &buffers, const Widened &widened,
                   const orb_gltf_shapes &shapes, Editor *editor);

}  // namespace gltf

#endif
