/* Writes the GLB of a profile: the document of the asset with other accessors, views and buffers. */
#ifndef ORB_PROFILE_EMIT_H
#define ORB_PROFILE_EMIT_H

#include "orbmorph/profile.h"
#include "profile/grid.h"
#include "profile/source.h"
#include "profile/stream.h"

/* streams: one for each accessor. Changes the document. ORB_E_TOO_LARGE, ORB_E_NO_MEMORY. */
ORB_MUST_CHECK orb_status orb_profile_emit(orb_context *ctx, orb_source *source, const orb_stream *streams,
                                           const orb_grid *grid, orb_profile profile, orb_buffer *out);

#endif
