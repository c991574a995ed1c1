/* Which textures of a glTF file the asset may hold: images that programs can open, samplers that glTF 2.0 defines. */
#ifndef ORB_FORMAT_TEXTURE_H
#define ORB_FORMAT_TEXTURE_H

#include <stddef.h>
#include <stdint.h>

/* "image/png", "image/jpeg", or NULL where the headers up to the first pixel are not complete and valid. O(size). */
const char *orb_image_type(const unsigned char *bytes, size_t size);

/* Returns the value if glTF 2.0 allows it for a sampler's wrapS and wrapT, magFilter or minFilter; otherwise 0, the
 * default. */
int32_t orb_sampler_wrap(int64_t value);
int32_t orb_sampler_magnify(int64_t value);
int32_t orb_sampler_minify(int64_t value);

#endif
