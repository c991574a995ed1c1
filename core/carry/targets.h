/* The morph targets of a shape's file on the supermesh. */
#ifndef ORB_CARRY_TARGETS_H
#define ORB_CARRY_TARGETS_H

#include "carry/source.h"
#include "orbmorph/asset.h"

/* Reads the targets of the file, as displacements of the supermesh's vertices in the coordinates of the asset, to which
 * `moved` (column-major) takes those of the shape. *out has *count targets; free them with orb_carried_targets_free(),
 * also after an error. */
ORB_MUST_CHECK orb_status orb_carry_targets(orb_context *ctx, const orb_carry_source *source, const double moved[16],
                                            orb_asset_target **out, int32_t *count);
void orb_carried_targets_free(orb_context *ctx, orb_asset_target *targets, int32_t count);

#endif
