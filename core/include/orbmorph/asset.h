/* The asset: a supermesh as binary glTF 2.0 with one morph target for each further shape. */
#ifndef ORBMORPH_ASSET_H
#define ORBMORPH_ASSET_H

#include "orbmorph/transfer.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum orb_fit { ORB_FIT_NONE = 0, ORB_FIT_RIGID, ORB_FIT_SIMILARITY } orb_fit;
typedef enum orb_animation { ORB_ANIMATION_PINGPONG = 0, ORB_ANIMATION_NONE } orb_animation;
typedef enum orb_path { ORB_PATH_LINEAR = 0, ORB_PATH_RIGID } orb_path;

typedef struct orb_asset_options {
  int normals; /* 1 */
  orb_animation animation;
  orb_fit fit;
  orb_path path;
  int32_t path_steps; /* rigid: in-between targets for each pair of neighbours, 3 */
  int colors;         /* carry the later shapes' colours as morphed attributes */
} orb_asset_options;
void orb_asset_defaults(orb_asset_options *options);

/* Appends the GLB. names: shape_count names. Every vertex that normals or seams split keeps bit-equal POSITION and
 * deltas. ORB_E_NOT_CERTIFIED where two different supermesh vertices would coincide in every shape after rounding. */
ORB_MUST_CHECK orb_status orb_asset_write(orb_context *ctx, const orb_supermesh *supermesh,
                                          const orb_aligned_shape *shapes, const char *const *names,
                                          const orb_asset_options *options, orb_buffer *out);

#ifdef __cplusplus
}
#endif
#endif
