/* Storing alignments as bytes: a merge with other remesh or asset options can then reuse the alignment. */
#ifndef ORBMORPH_KEPT_H
#define ORBMORPH_KEPT_H

#include "orbmorph/alignment.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Writes an alignment of the given shapes. The bytes hold only what the shapes do not: points, added vertices and
 * changed triangles; about 24 bytes per vertex where the alignment added none. Equal alignments give equal bytes. The
 * format has a version and this machine's byte order. */
ORB_API ORB_MUST_CHECK orb_status orb_alignment_write(orb_context *ctx, const orb_align_shape *shapes,
                                                      const orb_alignment *alignment, orb_buffer *out);

/* Reads an alignment of the same shapes, bit for bit as it was written; computes the certificates again.
 * ORB_E_BAD_OPTION: the bytes are damaged, of another version, or not of these shapes; the function then zeroes *out.
 * Compute the alignment again. Damage that leaves valid numbers, such as a point moved on the sphere, shows only if a
 * triangle flips: store a hash beside the bytes. O(n). */
ORB_API ORB_MUST_CHECK orb_status orb_alignment_read(orb_context *ctx, const void *bytes, size_t size,
                                                     const orb_align_shape *shapes, int32_t shape_count,
                                                     orb_alignment *out);

#ifdef __cplusplus
}
#endif
#endif
