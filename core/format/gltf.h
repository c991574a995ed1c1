/* The C face of the glTF and GLB reader. No exception leaves it. */
#ifndef ORB_FORMAT_GLTF_H
#define ORB_FORMAT_GLTF_H

#include "orbmorph/format.h"

#ifdef __cplusplus
extern "C" {
#endif

/* All triangle primitives of the default scene, positions after node transforms; numbering as in orb_mesh. */
ORB_MUST_CHECK orb_status orb_gltf_read(orb_context *ctx, const unsigned char *bytes, size_t size, int binary,
                                        orb_mesh *out);

#ifdef __cplusplus
}
#endif
#endif
