/* Indices, texture coordinates, colours and whatever else a vertex has. */
#ifndef ORB_PROFILE_ATTRIBUTE_H
#define ORB_PROFILE_ATTRIBUTE_H

#include "profile/source.h"
#include "profile/stream.h"

/* indices: index_count numbers; takes ownership, also on an error. ORB_E_NO_MEMORY. */
ORB_MUST_CHECK orb_status orb_attribute_indices(orb_context *ctx, uint32_t *indices, int32_t index_count,
                                                int32_t vertex_count, orb_stream *out);
/* What becomes of floats. */
typedef enum orb_rounding {
  ORB_ROUNDING_NONE = 0,
  ORB_ROUNDING_UNIT,   /* 16-bit integers if all lie in 0 … 1: an error of at most 2^-17 */
  ORB_ROUNDING_DIGITS, /* multiples of 2^-13 if all are below 256: an error of at most 2^-14 */
} orb_rounding;

/* Copies the elements in the new order. ORB_E_NO_MEMORY. */
ORB_MUST_CHECK orb_status orb_attribute_copy(orb_context *ctx, const orb_source *source, int32_t accessor,
                                             const uint32_t *order, orb_rounding rounding, orb_stream *out);

#endif
