/* Sets of colours and texture coordinates of a shape, on the supermesh. */
#ifndef ORB_CARRY_SETS_H
#define ORB_CARRY_SETS_H

#include "carry/source.h"
#include "format/gltf_given.h"
#include "orbmorph/carry.h"
#include "transfer/wedge.h"

/* Carries the sets of a kind: out has room for ORB_GIVEN_SETS, *count becomes their number, *has whether the file has
 * any. Sets that the base of the asset has already, as `own` at the corners of the aligned mesh (NULL: it has none),
 * are omitted. */
ORB_MUST_CHECK orb_status orb_carry_sets(orb_context *ctx, orb_carry_source *source, orb_carry_what what,
                                         const float *own, orb_wedges *out, int32_t *count, int *has);

#endif
