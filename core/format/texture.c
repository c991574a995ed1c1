/* Which images an asset may hold.
 *
 * Pixels are not decoded here. An image is accepted when its headers are complete up to the first pixel, which tells a
 * viewer of the asset, and a validator, its size and kind. Sources: PNG (W3C, 3rd edition) 5.3, 11.2; JPEG (ITU-T T.81)
 * B.1, B.2.2. Of JPEG only what viewers of glTF show is accepted: baseline, extended or progressive, with one component
 * or three (four are inks).
 */
#include "format/texture.h"

#include <string.h>

#include "format/bytes.h"

enum { PNG_HEADER = 13, PNG_AROUND = 12, PNG_SIZE_MAX = 0x7fffffff };

/* Checks the content of the chunk IHDR. */
static int is_png_header(const unsigned char *p) {
  uint32_t width = orb_read_u32(p, 1), height = orb_read_u32(p + 4, 1);
  static const unsigned depths[] = {
      1 | 2 | 4 | 8 | 16, 0, 8 | 16, 1 | 2 | 4 | 8, 8 | 16, 0, 8 | 16}; /* by colour type */
  unsigned depth = p[8], type = p[9];
  return width - 1 < PNG_SIZE_MAX && height - 1 < PNG_SIZE_MAX && type < sizeof depths / sizeof *depths &&
         (depth & (depth - 1)) == 0 && (depth & depths[type]) != 0 && p[10] == 0 && p[11] == 0 && p[12] <= 1;
}

/* Whether a chunk whose length PNG fixes, and which programs read without a check, has that length. */
static int has_its_length(const unsigned char *type, size_t length) {
  static const struct {
    char type[5];
    size_t length;
  } fixed[] = {{"cHRM", 32}, {"gAMA", 4}, {"pHYs", 9}, {"sRGB", 1}};
  for (size_t i = 0; i < sizeof fixed / sizeof *fixed; i++) {
    if (memcmp(type, fixed[i].type, 4) == 0) {
      return length == fixed[i].length;
    }
  }
  return memcmp(type, "IHDR", 4) != 0; /* a second one */
}

static int is_png(const unsigned char *bytes, size_t size) {
  static const unsigned char signature[8] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
  int has_palette = 0;
  size_t at = sizeof signature;
  if (size < at + PNG_AROUND + PNG_HEADER || memcmp(bytes, signature, sizeof signature) != 0 ||
      orb_read_u32(bytes + at, 1) != PNG_HEADER || memcmp(bytes + at + 4, "IHDR", 4) != 0 ||
      !is_png_header(bytes + at + 8)) {
    return 0;
  }
  int wants_palette = bytes[at + 8 + 9] == 3;
  while (size - at >= PNG_AROUND) {
    size_t length = orb_read_u32(bytes + at, 1);
    const unsigned char *type = bytes + at + 4;
    if (length > size - at - PNG_AROUND) {
      return 0;
    }
    if (memcmp(type, "IDAT", 4) == 0) {
      return has_palette || !wants_palette;
    }
    if (at > sizeof signature && !has_its_length(type, length)) {
      return 0;
    }
    has_palette |= memcmp(type, "PLTE", 4) == 0 && length >= 3;
    at += PNG_AROUND + length;
  }
  return 0;
}

/* Checks the segment of a frame header, from its length on. */
static int is_jpeg_frame(const unsigned char *p, size_t length) {
  if (length < 8) {
    return 0;
  }
  size_t components = p[7];
  return p[2] == 8 && orb_read_u16(p + 3, 1) > 0 && orb_read_u16(p + 5, 1) > 0 &&
         (components == 1 || components == 3) && length == 8 + 3 * components;
}

static int is_jpeg(const unsigned char *bytes, size_t size) {
  enum { SOF0 = 0xc0, SOF2 = 0xc2, SOF15 = 0xcf, DHT = 0xc4, DAC = 0xcc };
  enum { SOI = 0xd8, EOI = 0xd9, SOS = 0xda, DNL = 0xde, RST_FIRST = 0xd0, TEM = 0x01 };
  int has_frame = 0;
  if (size < 4 || bytes[0] != 0xff || bytes[1] != SOI) {
    return 0;
  }
  for (size_t at = 2; size - at >= 4;) {
    if (bytes[at] != 0xff) {
      return 0;
    }
    unsigned marker = bytes[at + 1];
    if (marker == 0xff) { /* fill */
      at++;
      continue;
    }
    size_t length = orb_read_u16(bytes + at + 2, 1);
    int is_bare = marker <= TEM || (marker >= RST_FIRST && marker <= EOI);
    if (is_bare || length < 2 || length > size - at - 2) {
      return 0;
    }
    if (marker == SOS) {
      return has_frame;
    }
    if (marker == DNL || (marker >= SOF0 && marker <= SOF15 && marker != DHT && marker != DAC)) {
      if (has_frame || marker == DNL || marker > SOF2 || !is_jpeg_frame(bytes + at + 2, length)) {
        return 0;
      }
      has_frame = 1;
    }
    at += 2 + length;
  }
  return 0;
}

const char *orb_image_type(const unsigned char *bytes, size_t size) {
  return is_png(bytes, size) ? "image/png" : is_jpeg(bytes, size) ? "image/jpeg" : NULL;
}

static int is_color_chunk(const unsigned char *chunk) {
  static const char types[][5] = {"iCCP", "sRGB", "gAMA", "cHRM", "cICP", "mDCV", "cLLI"};
  for (size_t i = 0; i < sizeof types / sizeof *types; i++) {
    if (memcmp(chunk + 4, types[i], 4) == 0) {
      return 1;
    }
  }
  return memcmp(chunk + 4, "pHYs", 4) == 0 && memcmp(chunk + 8, chunk + 12, 4) != 0;
}

/* Moves the bytes from `from` to the end back to `to`; returns the new size. */
static size_t close_gap(unsigned char *bytes, size_t size, size_t to, size_t from) {
  memmove(bytes + to, bytes + from, size - from);
  return size - (from - to);
}

static size_t strip_png(unsigned char *bytes, size_t size) {
  size_t out = 8, at = 8;
  while (memcmp(bytes + at + 4, "IDAT", 4) != 0) {
    size_t length = PNG_AROUND + orb_read_u32(bytes + at, 1);
    if (!is_color_chunk(bytes + at)) {
      memmove(bytes + out, bytes + at, length);
      out += length;
    }
    at += length;
  }
  return close_gap(bytes, size, out, at);
}

static size_t strip_jpeg(unsigned char *bytes, size_t size) {
  enum { SOS = 0xda, APP2 = 0xe2 };
  size_t out = 2, at = 2;
  while (bytes[at + 1] != SOS) {
    if (bytes[at + 1] == 0xff) { /* fill */
      bytes[out++] = bytes[at++];
      continue;
    }
    size_t length = 2 + (size_t)orb_read_u16(bytes + at + 2, 1);
    if (bytes[at + 1] != APP2) {
      memmove(bytes + out, bytes + at, length);
      out += length;
    }
    at += length;
  }
  return close_gap(bytes, size, out, at);
}

size_t orb_image_strip(unsigned char *bytes, size_t size) {
  return bytes[0] == 0xff ? strip_jpeg(bytes, size) : strip_png(bytes, size);
}

/* CLAMP_TO_EDGE, MIRRORED_REPEAT, REPEAT */
int32_t orb_sampler_wrap(int64_t value) {
  return value == 33071 || value == 33648 || value == 10497 ? (int32_t)value : 0;
}

/* NEAREST, LINEAR */
int32_t orb_sampler_magnify(int64_t value) {
  return value == 9728 || value == 9729 ? (int32_t)value : 0;
}

/* NEAREST, LINEAR, and the four with mipmaps */
int32_t orb_sampler_minify(int64_t value) {
  return orb_sampler_magnify(value) || (value >= 9984 && value <= 9987) ? (int32_t)value : 0;
}
