/* Pictures as pixels: PNG and JPEG are read, PNG is written. */
#ifndef ORB_FORMAT_IMAGE_H
#define ORB_FORMAT_IMAGE_H

#include "orbmorph/context.h"

typedef struct orb_pixels {
  int32_t width, height;
  unsigned char *rgba; /* 4 per pixel, the upper row first; colours as the file has them (sRGB), alpha not multiplied */
} orb_pixels;

enum { ORB_IMAGE_SIDE_MAX = 16384 };

/* ORB_E_CORRUPT: not a PNG or JPEG that can be read, or a JPEG of more than 100 scans; ORB_E_TOO_LARGE;
 * ORB_E_NO_MEMORY. Free the pixels with orb_free(). */
ORB_MUST_CHECK orb_status orb_image_decode(orb_context *ctx, const unsigned char *bytes, size_t size, orb_pixels *out);

/* Appends a PNG of 8 bits per channel, without facts about colours, as glTF tells viewers to ignore these. has_alpha:
 * with the fourth channel. */
ORB_MUST_CHECK orb_status orb_png_encode(orb_context *ctx, const orb_pixels *pixels, int has_alpha, orb_buffer *out);

#endif
