/* Further landmarks by mirror symmetry. */
#ifndef ORB_ALIGN_MAP_STARTS_MIRROR_H
#define ORB_ALIGN_MAP_STARTS_MIRROR_H

#include "orbmorph/mesh.h"

/* Further landmarks, guessed: mirror images of the given ones where both shapes are nearly their own mirror images
 * (compose_mirror.c). landmarks: vertices of either shape, `count` each; guesses: likewise, room for `count` each;
 * *guess_count: how many were found. */
ORB_MUST_CHECK orb_status orb_map_mirror_landmarks(orb_context *ctx, const orb_mesh *const meshes[2],
                                                   const int32_t *const landmarks[2], int32_t count,
                                                   int32_t *const guesses[2], int32_t *guess_count);

#endif
