/* What of a glTF file's textures may stand in the asset: images that a program can open, samplers that glTF 2.0 has. */
#ifndef ORB_FORMAT_TEXTURE_H
#define ORB_FORMAT_TEXTURE_H

#include <stddef.h>
#include <stdint.h>

/* "image/png", "image/jpeg", or NULL where the bytes do not lead up to the pixels of a picture with a size. O(size). */
const char *orb_image_type(const unsigned char *bytes, size_t size);

/* The value where glTF 2.0 allows it for a sampler's wrapS and wrapT, magFilter or minFilter; 0, the default,
 * otherwise. */
int32_t orb_sampler_wrap(int64_t value);
int32_t orb_sampler_magnify(int64_t value);
int32_t orb_sampler_minify(int64_t value);

#endif
