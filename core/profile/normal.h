/* Normals: integers of 8 bits where they suffice; for compression octahedra of few bits, and floats of few digits. */
#ifndef ORB_PROFILE_NORMAL_H
#define ORB_PROFILE_NORMAL_H

#include "profile/stream.h"

/* Encodes the normals of a primitive. base: 3 floats per vertex, unit vectors; deltas: those of each target, which are
 * added to the base. Every normal stays within 1° of that of the floats, at every weight from 0 to 1 of one target:
 * where coarse numbers break that, at normals that rotate by more than about 150°, it takes finer ones. compressed:
 * chooses what the codec makes small, else what is small as it is. *degrees: raised to the proved bound. targets:
 * target_count streams. ORB_E_NO_MEMORY, ORB_E_TIMEOUT, ORB_E_CANCELLED. */
ORB_MUST_CHECK orb_status orb_normals_encode(orb_context *ctx, const float *base, int32_t count,
                                             const float *const *deltas, int32_t target_count, int compressed,
                                             orb_stream *base_stream, orb_stream *targets, double *degrees);

#endif
