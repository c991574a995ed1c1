/* Palettes of up to 256 colours. */
#ifndef ORB_CLI_VIEW_PALETTE_H
#define ORB_CLI_VIEW_PALETTE_H

#include <stddef.h>

/* Makes a palette for RGB pixels and writes the palette index of each pixel. Returns the number of colours, or 0
 * without memory. */
int view_palette(const unsigned char *rgb, size_t pixels, unsigned char palette[256][3], unsigned char *out);

#endif
