/* The animations of a skeleton. */
#ifndef ORB_FORMAT_GLTF_MOTION_HH
#define ORB_FORMAT_GLTF_MOTION_HH

#include "format/gltf_edit.hh"
#include "format/gltf_skeleton.hh"

namespace gltf {

/* Adds the animations of a document that move nodes which were copied, before those that are there. number: of each
 * node its copy, or NONE. shift: how the translation of the copy differs, 3 numbers a node, by which animated
 * translations differ as well. */
void copy_animations(const Skeleton &from, const cJSON *source, const Buffers &buffers, const Indices &number,
                     const Numbers &shift, cJSON *doc, Editor *editor);

}  // namespace gltf

#endif
