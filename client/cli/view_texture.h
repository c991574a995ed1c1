/* Textures: decoded PNG and JPEG images with their halved levels, sampled in linear light. */
#ifndef ORB_CLI_VIEW_TEXTURE_H
#define ORB_CLI_VIEW_TEXTURE_H

#include <stddef.h>

enum { VIEW_LEVELS = 16, VIEW_REPEAT = 10497, VIEW_CLAMP = 33071, VIEW_MIRROR = 33648 }; /* wrap modes of glTF */

/* sRGB bytes, 3 per pixel, rows from the top; level 0 is the full image. */
typedef struct view_texture {
  int levels, width[VIEW_LEVELS], height[VIEW_LEVELS];
  unsigned char *pixels[VIEW_LEVELS];
  int wrap[2]; /* horizontal, vertical */
} view_texture;

/* Decodes a PNG or JPEG image in memory. Returns 0, or −1 if it is neither, damaged or too large. */
int view_texture_decode(const unsigned char *bytes, size_t size, view_texture *out);
void view_texture_free(view_texture *texture);

/* Linear RGB at (u, v), interpolated between pixels. span: pixels of level 0 that one pixel of the canvas covers in
 * each direction. */
void view_texture_sample(const view_texture *texture, float u, float v, float span, float out[3]);

#endif
