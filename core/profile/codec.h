/* What meshoptimizer does for a profile: the order of triangles and vertices, octahedra, compression. */
#ifndef ORB_PROFILE_CODEC_H
#define ORB_PROFILE_CODEC_H

#include "profile/stream.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Reorders the triangles of each part in place so that they compress well and use the cache of vertices, numbers the
 * vertices in the order of their first use by all parts, and renumbers the indices. all: the indices of all parts, one
 * part after another. order: receives the new number of each vertex. ORB_E_NO_MEMORY. */
ORB_MUST_CHECK orb_status orb_codec_order(orb_context *ctx, uint32_t *all, const size_t *counts, size_t part_count,
                                          size_t vertex_count, uint32_t *order);

/* Applies the filter OCTAHEDRAL with this many bits. unit: 4 floats per vertex, the last unused. stored and shown: 4
 * integers a vertex, before and after the decoder. */
void orb_codec_octahedra(const float *unit, int32_t count, int bits, int16_t *stored, int16_t *shown);

/* Appends the compressed form of a stream. */
ORB_MUST_CHECK orb_status orb_codec_compress(orb_context *ctx, const orb_stream *stream, orb_buffer *out);

#ifdef __cplusplus
}
#endif
#endif
