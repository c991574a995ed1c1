/* Which given landmarks cause much of the distortion.
 *
 * In: an alignment with given landmarks, and its shapes. Out: the share of the distortion around each landmark, which
 * ones may be misplaced, and where the others would put them. */
#ifndef ORB_ALIGN_FIND_SUSPECTS_H
#define ORB_ALIGN_FIND_SUSPECTS_H

#include "orbmorph/alignment.h"

/* Fills the suspects and the shares of an alignment by pin or auto that has its composed map; all meshes are those
 * given, perhaps with more vertices. Does nothing where the energy is that of a good map. About 0.3 s of one thread for
 * each shape but the first. */
ORB_MUST_CHECK orb_status orb_align_suspects(orb_context *ctx, const orb_align_shape *shapes,
                                             const orb_landmark *landmarks, const orb_align_options *options,
                                             orb_alignment *out);

#endif
