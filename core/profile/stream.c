#include "profile/stream.h"

#include "base/memory.h"

orb_status orb_stream_allocate(orb_context *ctx, orb_stream *stream, int stored) {
  size_t size = (size_t)stream->count * (size_t)stream->stride;
  stream->bytes = ORB_NEW0(ctx, unsigned char, size);
  stream->stored = stream->bytes && stored ? ORB_NEW0(ctx, unsigned char, size) : NULL;
  return stream->bytes && (stream->stored || !stored) ? ORB_OK : ORB_E_NO_MEMORY;
}

void orb_stream_free(orb_context *ctx, orb_stream *stream) {
  orb_free(ctx, stream->bytes);
  orb_free(ctx, stream->stored);
  *stream = (orb_stream){0};
}
