/* Where the joints of a skeleton belong on another surface than its own. */
#ifndef ORB_FORMAT_GLTF_FIT_HH
#define ORB_FORMAT_GLTF_FIT_HH

#include "format/gltf_skeleton.hh"
#include "format/gltf_skin.h"

namespace gltf {

/* The places of the joints, 3 numbers each, in the coordinates of the asset. rest: where they are on their own surface.
 * A joint follows the part of the surface that it and the joint above it share, or all that it moves where they share
 * none. It moves by the affine map that fits that part best. So an affine image of the surface has the affine image of
 * the joints. Joints that move no vertex get NaN. O(V + joints). */
Numbers fit_joints(const Skeleton &skeleton, const orb_skin_surface &surface, const Numbers &rest);

}  // namespace gltf

#endif
