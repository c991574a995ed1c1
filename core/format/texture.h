/* Which textures of a glTF file the asset may hold: images that programs can open, samplers that glTF 2.0 defines. */
#ifndef ORB_FORMAT_TEXTURE_H
#define ORB_FORMAT_TEXTURE_H

#include <stddef.h>
#include <stdint.h>

/* "image/png", "image/jpeg", or NULL where the headers up to the first pixel are not complete and valid. O(size). */
const char *orb_image_type(const unsigned char *bytes, size_t size);

/* Removes what says how to convert colours, and what says that pixels are not square. Viewers of glTF must ignore the
 * former (glTF 2.0, 3.8.3), and some do not. PNG: iCCP, sRGB, gAMA, cHRM, cICP, mDCV, cLLI, pHYs of unequal numbers,
 * all before the first pixel. JPEG: APP2, which holds ICC profiles and the offsets of further pictures. Returns the new
 * size; other bytes stay as they are. bytes: an image that orb_image_type() knows. O(size). */
size_t orb_image_strip(unsigned char *bytes, size_t size);

/* Returns the value if glTF 2.0 allows it for a sampler's wrapS and wrapT, magFilter or minFilter; otherwise 0, the
 * default. */
int32_t orb_sampler_wrap(int64_t value);
int32_t orb_sampler_magnify(int64_t value);
int32_t orb_sampler_minify(int64_t value);

#endif
