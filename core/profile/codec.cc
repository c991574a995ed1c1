// C++ for one reason: the exception that meshoptimizer throws when memory is exhausted must not pass through C.
#include "profile/codec.h"

#include <meshoptimizer.h>

#include <cmath>
#include <new>

extern "C" {
#include "base/error.h"
#include "base/memory.h"
}

namespace {

/* meshoptimizer allocates by itself: about 46 bytes per vertex to order triangles. A block of that size, never touched,
 * charges them to the budget. */
enum { BYTES_A_VERTEX = 48 };

/* What a decoder makes of an octahedron, as in the specification of EXT_meshopt_compression. */
void decode_octahedron(const int16_t stored[4], int16_t shown[4]) {
  float x = stored[0], y = stored[1], z = static_cast<float>(stored[2]) - std::fabs(x) - std::fabs(y);
  float fold = z >= 0 ? 0 : z;
  x += x >= 0 ? fold : -fold;
  y += y >= 0 ? fold : -fold;
  float scale = 32767 / std::sqrt(x * x + y * y + z * z);
  shown[0] = static_cast<int16_t>(x * scale + (x >= 0 ? 0.5f : -0.5f));
  shown[1] = static_cast<int16_t>(y * scale + (y >= 0 ? 0.5f : -0.5f));
  shown[2] = static_cast<int16_t>(z * scale + (z >= 0 ? 0.5f : -0.5f));
  shown[3] = stored[3];
}

}  // namespace

orb_status orb_codec_order(orb_context *ctx, uint32_t *all, const size_t *counts, size_t part_count,
                           size_t vertex_count, uint32_t *order) {
  void *charge = orb_alloc(ctx, vertex_count, BYTES_A_VERTEX);
  if (!charge) {
    return ORB_E_NO_MEMORY;
  }
  orb_status status = ORB_OK;
  try {
    size_t total = 0;
    for (size_t p = 0; p < part_count; p++) {
      meshopt_optimizeVertexCacheStrip(all + total, all + total, counts[p], vertex_count);
      total += counts[p];
    }
    meshopt_optimizeVertexFetchRemap(order, all, total, vertex_count);
    meshopt_remapIndexBuffer(all, all, total, order);
  } catch (const std::bad_alloc &) {
    status = orb_fail(ctx, ORB_E_NO_MEMORY, "There is not enough memory to order the triangles.");
  }
  orb_free(ctx, charge);
  return status;
}

void orb_codec_octahedra(const float *unit, int32_t count, int bits, int16_t *stored, int16_t *shown) {
  meshopt_encodeFilterOct(stored, static_cast<size_t>(count), 4 * sizeof *stored, bits, unit);
  for (size_t i = 0; i < 4 * static_cast<size_t>(count); i += 4) {
    decode_octahedron(stored + i, shown + i);
  }
}

orb_status orb_codec_compress(orb_context *ctx, const orb_stream *stream, orb_buffer *out) {
  size_t count = static_cast<size_t>(stream->count), stride = static_cast<size_t>(stream->stride);
  const unsigned char *from = stream->stored ? stream->stored : stream->bytes;
  size_t bound =
      stream->triangles ? meshopt_encodeIndexBufferBound(count, count) : meshopt_encodeVertexBufferBound(count, stride);
  unsigned char *room = static_cast<unsigned char *>(orb_alloc(ctx, bound, 1));
  if (!room) {
    return ORB_E_NO_MEMORY;
  }
  meshopt_encodeIndexVersion(1); /* a setting of the whole process; the extension takes no other version */
  size_t size = stream->triangles
                    ? meshopt_encodeIndexBuffer(room, bound, reinterpret_cast<const uint32_t *>(from), count)
                    : meshopt_encodeVertexBuffer(room, bound, from, count, stride);
  orb_status status = size > 0 ? orb_buffer_append(ctx, out, room, size)
                               : orb_fail(ctx, ORB_E_INTERNAL, "A stream of the asset could not be compressed.");
  orb_free(ctx, room);
  return status;
}
