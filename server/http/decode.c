#include "http/decode.h"

#include <stdint.h>
#include <stdlib.h>
#include <strings.h>
#include <zlib.h>
#include <zstd.h>
#include <zstd_errors.h>

enum { PIECE = 32 * 1024, WINDOW_LOG_MOST = 23, GZIP_BITS = 15 + 16, GZIP_MEMORY = 48 * 1024 };

struct decoder {
  coding which;
  z_stream gzip;
  ZSTD_DCtx *zstd;
  int whole;           /* the last byte ended a member or frame */
  unsigned magic_seen; /* bytes of the current frame's magic number checked so far */
  unsigned char kind;  /* the first byte of that magic number */
};

coding coding_of(const char *header) {
  if (!header || strcasecmp(header, "identity") == 0) {
    return CODING_NONE;
  }
  if (strcasecmp(header, "gzip") == 0 || strcasecmp(header, "x-gzip") == 0) {
    return CODING_GZIP;
  }
  return strcasecmp(header, "zstd") == 0 ? CODING_ZSTD : CODING_UNKNOWN;
}

decoder *decoder_create(coding which) {
  decoder *d = calloc(1, sizeof *d);
  if (!d) {
    return NULL;
  }
  d->which = which;
  int fine;
  if (which == CODING_GZIP) {
    fine = inflateInit2(&d->gzip, GZIP_BITS) == Z_OK;
  } else {
    d->zstd = ZSTD_createDCtx();
    fine = d->zstd && !ZSTD_isError(ZSTD_DCtx_setParameter(d->zstd, ZSTD_d_windowLogMax, WINDOW_LOG_MOST));
  }
  if (!fine) {
    decoder_free(d);
    return NULL;
  }
  return d;
}

void decoder_free(decoder *d) {
  if (!d) {
    return;
  }
  if (d->which == CODING_GZIP) {
    inflateEnd(&d->gzip);
  }
  ZSTD_freeDCtx(d->zstd);
  free(d);
}

size_t decoder_memory(const decoder *d) {
  return sizeof *d + (d->which == CODING_GZIP ? (size_t)GZIP_MEMORY : ZSTD_sizeof_DCtx(d->zstd));
}

int decoder_complete(const decoder *d) {
  return d->whole;
}

static decode_result feed_gzip(decoder *d, const char *bytes, size_t size, decode_sink sink, void *user) {
  unsigned char out[PIECE];
  z_stream *z = &d->gzip;
  z->next_in = (unsigned char *)(uintptr_t)bytes;
  z->avail_in = (uInt)size; /* a piece of an upload: far below UINT_MAX */
  do {
    if (d->whole && z->avail_in) { /* another member follows */
      inflateReset(z);
      d->whole = 0;
    }
    z->next_out = out;
    z->avail_out = PIECE;
    int code = inflate(z, Z_NO_FLUSH);
    size_t made = PIECE - z->avail_out;
    if (made && !sink(user, (const char *)out, made)) {
      return DECODE_STOPPED;
    }
    if (code == Z_STREAM_END) {
      d->whole = 1;
    } else if (code == Z_MEM_ERROR) {
      return DECODE_NO_MEMORY;
    } else if (code == Z_BUF_ERROR) {
      break; /* wants more input */
    } else if (code != Z_OK) {
      return DECODE_BROKEN;
    }
  } while (z->avail_in || (z->avail_out == 0 && !d->whole));
  return DECODE_OK;
}

/* Whether the bytes so far match the magic number of an RFC 8878 frame or skippable frame. libzstd would also decode
 * its legacy formats, whose decoders ignore the window limit and do not show up in ZSTD_sizeof_DCtx(). */
static int magic_fits(decoder *d, const unsigned char *bytes, size_t size) {
  static const unsigned char frame[] = {0x28, 0xB5, 0x2F, 0xFD}, skip[] = {0x50, 0x2A, 0x4D, 0x18};
  for (size_t i = 0; i < size && d->magic_seen < sizeof frame; i++, d->magic_seen++) {
    if (d->magic_seen == 0) {
      d->kind = bytes[i];
    }
    int skipped = (d->kind & 0xF0) == skip[0];
    unsigned char want = (skipped ? skip : frame)[d->magic_seen], is = bytes[i];
    if (is != want && !(skipped && d->magic_seen == 0)) {
      return 0;
    }
  }
  return 1;
}

static decode_result feed_zstd(decoder *d, const char *bytes, size_t size, decode_sink sink, void *user) {
  char out[PIECE];
  ZSTD_inBuffer in = {bytes, size, 0};
  for (;;) {
    if (!magic_fits(d, (const unsigned char *)bytes + in.pos, in.size - in.pos)) {
      return DECODE_BROKEN;
    }
    ZSTD_outBuffer made = {out, sizeof out, 0};
    size_t before = in.pos, left = ZSTD_decompressStream(d->zstd, &made, &in);
    if (ZSTD_isError(left)) {
      ZSTD_ErrorCode code = ZSTD_getErrorCode(left);
      return code == ZSTD_error_frameParameter_windowTooLarge ? DECODE_WINDOW
             : code == ZSTD_error_memory_allocation           ? DECODE_NO_MEMORY
                                                              : DECODE_BROKEN;
    }
    if (made.pos && !sink(user, out, made.pos)) {
      return DECODE_STOPPED;
    }
    if (in.pos > before || made.pos) {
      d->whole = left == 0;
      d->magic_seen = d->whole ? 0 : d->magic_seen;
    }
    if (in.pos == in.size && made.pos < made.size) {
      return DECODE_OK;
    }
  }
}

decode_result decoder_feed(decoder *d, const char *bytes, size_t size, decode_sink sink, void *user) {
  return d->which == CODING_GZIP ? feed_gzip(d, bytes, size, sink, user) : feed_zstd(d, bytes, size, sink, user);
}
