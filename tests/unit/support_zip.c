#include "support_zip.h"

#include <stdlib.h>
#include <string.h>
#include <zlib.h>

static void put(unsigned char **at, size_t *size, size_t *room, const void *bytes, size_t count) {
  if (count == 0) {
    return;
  }
  if (*size + count > *room) {
    *room = 2 * (*room + count);
    *at = realloc(*at, *room);
    if (!*at) {
      abort();
    }
  }
  memcpy(*at + *size, bytes, count);
  *size += count;
}

static unsigned char *number(unsigned char *p, uint64_t value, int bytes) {
  for (int i = 0; i < bytes; i++) {
    *p++ = (unsigned char)(i < 8 ? value >> (8 * i) : 0);
  }
  return p;
}

void archive_add(archive *a, const char *name, const void *bytes, size_t size, int deflated) {
  uLong most = compressBound(size) + 64;
  unsigned char *packed = malloc(most), head[128], *p = head;
  size_t length = strlen(name), packed_size = size, local = a->size;
  if (!packed) {
    abort();
  }
  if (deflated) {
    z_stream stream = {0};
    if (deflateInit2(&stream, 9, Z_DEFLATED, -MAX_WBITS, 9, Z_DEFAULT_STRATEGY) != Z_OK) {
      abort();
    }
    stream.next_in = (z_const Bytef *)bytes;
    stream.avail_in = (uInt)size;
    stream.next_out = packed;
    stream.avail_out = (uInt)most;
    if (deflate(&stream, Z_FINISH) != Z_STREAM_END) {
      abort();
    }
    packed_size = stream.total_out;
    deflateEnd(&stream);
  } else if (size) {
    memcpy(packed, bytes, size);
  }
  uLong crc = crc32(crc32(0, NULL, 0), bytes, (uInt)size);
  for (int central = 0; central < 2; central++) {
    int is_wide = central && a->is_wide;
    p = number(head, central ? 0x02014b50 : 0x04034b50, 4);
    p = number(p, 20, central ? 2 : 0);
    p = number(p, 20, 2);
    p = number(p, 0, 2);
    p = number(p, deflated ? 8 : 0, 2);
    p = number(p, 0, 4);
    p = number(p, crc, 4);
    p = number(p, is_wide ? UINT32_MAX : packed_size, 4);
    p = number(p, is_wide ? UINT32_MAX : size, 4);
    p = number(p, length, 2);
    p = number(p, is_wide ? 28 : 0, 2);
    if (!central) {
      put(&a->bytes, &a->size, &a->room, head, (size_t)(p - head));
      put(&a->bytes, &a->size, &a->room, name, length);
      put(&a->bytes, &a->size, &a->room, packed, packed_size);
      continue;
    }
    p = number(p, 0, 10);
    p = number(p, is_wide ? UINT32_MAX : local, 4);
    put(&a->directory, &a->directory_size, &a->directory_room, head, (size_t)(p - head));
    put(&a->directory, &a->directory_size, &a->directory_room, name, length);
    if (is_wide) {
      p = number(number(head, 1, 2), 24, 2);
      p = number(number(number(p, size, 8), packed_size, 8), local, 8);
      put(&a->directory, &a->directory_size, &a->directory_room, head, (size_t)(p - head));
    }
  }
  free(packed);
  a->entries++;
}

void archive_end(archive *a) {
  unsigned char end[128], *p = end;
  uint64_t at = a->size, length = a->directory_size, count = (uint64_t)a->entries;
  put(&a->bytes, &a->size, &a->room, a->directory, a->directory_size);
  if (a->is_wide) {
    uint64_t wide = a->size;
    p = number(number(number(p, 0x06064b50, 4), 44, 8), 45, 2);
    p = number(number(p, 45, 2), 0, 8);
    p = number(number(number(number(p, count, 8), count, 8), length, 8), at, 8);
    p = number(number(number(number(p, 0x07064b50, 4), 0, 4), wide, 8), 1, 4);
    length = at = UINT32_MAX;
  }
  p = number(number(p, 0x06054b50, 4), 0, 4);
  p = number(number(number(number(number(p, count, 2), count, 2), length, 4), at, 4), 0, 2);
  put(&a->bytes, &a->size, &a->room, end, (size_t)(p - end));
}

void archive_free(archive *a) {
  free(a->bytes);
  free(a->directory);
  *a = (archive){0};
}
