#include "format/zip.h"

#include <zlib.h>

#include "base/check.h"
#include "base/error.h"
#include "base/memory.h"
#include "format/build.h"
#include "format/bytes.h"

enum {
  END_SIZE = 22, /* bytes of the record that ends an archive, without its comment */
  COMMENT_MAX = 65535,
  LOCATOR_SIZE = 20, /* of that which leads to the record of ZIP64 */
  END64_SIZE = 56,
  CENTRAL_SIZE = 46, /* of an entry of the directory, without its name */
  LOCAL_SIZE = 30,   /* of what precedes the bytes of a file, without its name */
  STORED = 0,
  DEFLATED = 8,
  PIECE = 1 << 16 /* bytes that a sink gets at once, at most */
};
static const uint32_t END_SIGNATURE = 0x06054b50, LOCATOR_SIGNATURE = 0x07064b50, END64_SIGNATURE = 0x06064b50,
                      CENTRAL_SIGNATURE = 0x02014b50, LOCAL_SIGNATURE = 0x04034b50, WIDE = 0xffffffff;

static int is_within(size_t size, uint64_t at, uint64_t length) {
  return at <= size && length <= size - at;
}

/* Where the record lies that ends the archive; size: nowhere. */
static size_t find_end(const unsigned char *bytes, size_t size) {
  for (size_t back = END_SIZE; back <= size && back <= END_SIZE + COMMENT_MAX; back++) {
    if (orb_read_u32(bytes + size - back, 0) == END_SIGNATURE) {
      return size - back;
    }
  }
  return size;
}

int orb_zip_open(const unsigned char *bytes, size_t size, orb_zip *out) {
  size_t end = size >= END_SIZE ? find_end(bytes, size) : size;
  if (end == size) {
    return 0;
  }
  uint64_t length = orb_read_u32(bytes + end + 12, 0), at = orb_read_u32(bytes + end + 16, 0);
  if ((length == WIDE || at == WIDE) && end >= LOCATOR_SIZE &&
      orb_read_u32(bytes + end - LOCATOR_SIZE, 0) == LOCATOR_SIGNATURE) {
    uint64_t wide = orb_read_u64(bytes + end - LOCATOR_SIZE + 8, 0);
    if (!is_within(size, wide, END64_SIZE) || orb_read_u32(bytes + wide, 0) != END64_SIGNATURE) {
      return 0;
    }
    length = orb_read_u64(bytes + wide + 40, 0);
    at = orb_read_u64(bytes + wide + 48, 0);
  }
  if (!is_within(end, at, length)) {
    return 0;
  }
  *out = (orb_zip){.bytes = bytes, .size = size, .directory = bytes + at, .directory_size = (size_t)length};
  return 1;
}

/* ZIP64: the fields that do not fit 32 bits follow each other in an extra field of kind 1. */
static int read_wide(const unsigned char *extra, size_t length, uint64_t *fields[3]) {
  for (size_t at = 0; length - at >= 4;) {
    size_t kind = orb_read_u16(extra + at, 0), size = orb_read_u16(extra + at + 2, 0);
    at += 4;
    if (size > length - at) {
      return 0;
    }
    if (kind == 1) {
      const unsigned char *p = extra + at, *end = p + size;
      for (int i = 0; i < 3; i++) {
        if (*fields[i] == WIDE) {
          if (end - p < 8) {
            return 0;
          }
          *fields[i] = orb_read_u64(p, 0);
          p += 8;
        }
      }
      return 1;
    }
    at += size;
  }
  return 0;
}

int orb_zip_next(const orb_zip *zip, size_t *at, orb_zip_entry *out) {
  const unsigned char *p = zip->directory + *at;
  size_t left = zip->directory_size - *at;
  if (left < CENTRAL_SIZE || orb_read_u32(p, 0) != CENTRAL_SIGNATURE) {
    return 0;
  }
  size_t name = orb_read_u16(p + 28, 0), extra = orb_read_u16(p + 30, 0), comment = orb_read_u16(p + 32, 0);
  if (left - CENTRAL_SIZE < name + extra + comment) {
    return 0;
  }
  uint64_t packed = orb_read_u32(p + 20, 0), size = orb_read_u32(p + 24, 0), local = orb_read_u32(p + 42, 0);
  if ((packed == WIDE || size == WIDE || local == WIDE) &&
      !read_wide(p + CENTRAL_SIZE + name, extra, (uint64_t *[3]){&size, &packed, &local})) {
    return 0;
  }
  *out = (orb_zip_entry){.name = p + CENTRAL_SIZE,
                         .name_length = name,
                         .local = local,
                         .packed = packed,
                         .size = size,
                         .crc = orb_read_u32(p + 16, 0),
                         .method = orb_read_u16(p + 10, 0),
                         .is_encrypted = orb_read_u16(p + 8, 0) & 1};
  *at += CENTRAL_SIZE + name + extra + comment;
  return 1;
}

/* What one file unpacks to, on its way to the sink. */
typedef struct unpacking {
  orb_context *ctx;
  const orb_zip_entry *entry;
  uint64_t *allowance;
  orb_zip_sink sink;
  void *user;
  uLong crc;
  size_t given;
} unpacking;

static orb_status damaged(const unpacking *u) {
  return orb_build_malformed(u->ctx, 0, (int64_t)u->entry->local,
                             "A file of the ZIP archive is damaged; export the mesh again.");
}

static orb_status give(unpacking *u, const unsigned char *bytes, size_t size, int is_last) {
  ORB_TRY(orb_context_check(u->ctx));
  if (size > *u->allowance) {
    return orb_fail(u->ctx, ORB_E_TOO_LARGE,
                    "The ZIP archive unpacks to more than its size justifies; export the mesh alone.");
  }
  *u->allowance -= size;
  u->given += size;
  u->crc = crc32(u->crc, bytes, (uInt)size);
  if (u->given > u->entry->size || (is_last && (u->given != u->entry->size || u->crc != u->entry->crc))) {
    return damaged(u);
  }
  return u->sink(u->user, bytes, size, is_last);
}

static orb_status give_stored(unpacking *u, const unsigned char *bytes, size_t size) {
  for (; size > PIECE; bytes += PIECE, size -= PIECE) {
    ORB_TRY(give(u, bytes, PIECE, 0));
  }
  return give(u, bytes, size, 1);
}

static void *inflate_alloc(void *ctx, uInt count, uInt size) {
  return orb_alloc(ctx, count, size);
}

static void inflate_free(void *ctx, void *block) {
  orb_free(ctx, block);
}

static orb_status give_inflated(unpacking *u, const unsigned char *bytes, size_t size) {
  orb_context *ctx = u->ctx;
  z_stream stream = {.zalloc = inflate_alloc, .zfree = inflate_free, .opaque = ctx};
  unsigned char *piece = ORB_NEW(ctx, unsigned char, PIECE);
  if (!piece || inflateInit2(&stream, -MAX_WBITS) != Z_OK) {
    orb_free(ctx, piece);
    return ORB_E_NO_MEMORY;
  }
  orb_status status = ORB_OK;
  int result = Z_OK;
  while (status == ORB_OK && result == Z_OK) {
    if (stream.avail_in == 0) {
      uInt more = size < (1u << 30) ? (uInt)size : 1u << 30;
      stream.next_in = (z_const Bytef *)bytes;
      stream.avail_in = more;
      bytes += more;
      size -= more;
    }
    stream.next_out = piece;
    stream.avail_out = PIECE;
    result = inflate(&stream, Z_NO_FLUSH);
    if (result != Z_OK && result != Z_STREAM_END) {
      status = result == Z_MEM_ERROR ? ORB_E_NO_MEMORY : damaged(u);
    } else {
      status = give(u, piece, PIECE - stream.avail_out, result == Z_STREAM_END);
    }
  }
  inflateEnd(&stream);
  orb_free(ctx, piece);
  return status;
}

orb_status orb_zip_read(orb_context *ctx, const orb_zip *zip, const orb_zip_entry *entry, uint64_t *allowance,
                        orb_zip_sink sink, void *user) {
  unpacking u = {
      .ctx = ctx, .entry = entry, .allowance = allowance, .sink = sink, .user = user, .crc = crc32(0, NULL, 0)};
  if (entry->is_encrypted) {
    return orb_build_malformed(ctx, 0, (int64_t)entry->local, "The ZIP archive is encrypted; send one that is not.");
  }
  if (!is_within(zip->size, entry->local, LOCAL_SIZE)) {
    return damaged(&u);
  }
  const unsigned char *local = zip->bytes + entry->local;
  if (orb_read_u32(local, 0) != LOCAL_SIGNATURE) {
    return damaged(&u);
  }
  uint64_t begin = (uint64_t)entry->local + LOCAL_SIZE + orb_read_u16(local + 26, 0) + orb_read_u16(local + 28, 0);
  if (!is_within(zip->size, begin, entry->packed)) {
    return damaged(&u);
  }
  switch (entry->method) {
    case STORED:
      return give_stored(&u, zip->bytes + begin, entry->packed);
    case DEFLATED:
      return give_inflated(&u, zip->bytes + begin, entry->packed);
    default:
      return orb_build_malformed(ctx, 0, (int64_t)entry->local,
                                 "A file of the ZIP archive is compressed by method %d; the reader knows 0 and 8.",
                                 entry->method);
  }
}
