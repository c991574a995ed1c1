#include "profile/attribute.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "format/bytes.h"
#include "format/gltf_write.h"

orb_status orb_attribute_indices(orb_context *ctx, uint32_t *indices, int32_t index_count, int32_t vertex_count,
                                 orb_stream *out) {
  int wide = vertex_count > 65535;
  *out = (orb_stream){.count = index_count,
                      .stride = wide ? 4 : 2,
                      .components = 1,
                      .component_type = wide ? ORB_GLTF_UINT : ORB_GLTF_USHORT,
                      .triangles = 1};
  orb_status status = orb_stream_allocate(ctx, out, 0);
  out->stored = (unsigned char *)indices;
  for (int32_t i = 0; status == ORB_OK && i < index_count; i++) {
    uint16_t narrow = (uint16_t)indices[i];
    memcpy(out->bytes + (size_t)i * (size_t)out->stride, wide ? (const void *)&indices[i] : (const void *)&narrow,
           (size_t)out->stride);
  }
  return status;
}

/* A float that the filter EXPONENTIAL stores with this exponent: a multiple of 2^-13 below 256. */
enum { EXPONENT = -13, DIGITS_MOST = 256 };

/* The rounding that all values allow. */
static orb_rounding allowed(const orb_source_accessor *from, orb_rounding wanted) {
  double least = wanted == ORB_ROUNDING_UNIT ? 0 : -DIGITS_MOST, most = wanted == ORB_ROUNDING_UNIT ? 1 : DIGITS_MOST;
  if (from->component_type != ORB_GLTF_FLOAT) {
    return ORB_ROUNDING_NONE;
  }
  for (size_t i = 0; i < (size_t)from->count * (size_t)from->components; i++) {
    double value = orb_read_f32(from->bytes + 4 * i, 0);
    if (!(value >= least && value <= most)) {
      return ORB_ROUNDING_NONE;
    }
  }
  return wanted;
}

static void put_unit(const unsigned char *value, int32_t components, unsigned char *to) {
  for (size_t c = 0; c < (size_t)components; c++) {
    uint16_t rounded = (uint16_t)(orb_read_f32(value + 4 * c, 0) * 65535 + 0.5);
    memcpy(to + 2 * c, &rounded, sizeof rounded);
  }
}

static void put_digits(const unsigned char *value, int32_t components, unsigned char *to, unsigned char *stored) {
  for (size_t c = 0; c < (size_t)components; c++) {
    double mantissa = floor(ldexp(orb_read_f32(value + 4 * c, 0), -EXPONENT) + 0.5);
    float shown = (float)ldexp(mantissa, EXPONENT);
    uint32_t word = (uint32_t)EXPONENT << 24 | ((uint32_t)(int32_t)mantissa & 0xffffff);
    memcpy(to + 4 * c, &shown, sizeof shown);
    memcpy(stored + 4 * c, &word, sizeof word);
  }
}

orb_status orb_attribute_copy(orb_context *ctx, const orb_source *source, int32_t accessor, const uint32_t *order,
                              orb_rounding rounding, orb_stream *out) {
  const orb_source_accessor *from = &source->accessors[accessor];
  orb_rounding as = rounding == ORB_ROUNDING_NONE ? rounding : allowed(from, rounding);
  int32_t width = as == ORB_ROUNDING_UNIT ? 2 * from->components : from->stride;
  *out = (orb_stream){.count = from->count,
                      .stride = (width + 3) & ~3,
                      .components = from->components,
                      .component_type = as == ORB_ROUNDING_UNIT ? ORB_GLTF_USHORT : from->component_type,
                      .normalized = as == ORB_ROUNDING_UNIT,
                      .filter = as == ORB_ROUNDING_DIGITS ? ORB_FILTER_EXPONENTIAL : ORB_FILTER_NONE};
  ORB_TRY(orb_stream_allocate(ctx, out, as == ORB_ROUNDING_DIGITS));
  for (size_t i = 0; i < (size_t)from->count; i++) {
    const unsigned char *value = from->bytes + i * (size_t)from->stride;
    size_t at = (size_t)out->stride * (order ? order[i] : i);
    if (as == ORB_ROUNDING_UNIT) {
      put_unit(value, from->components, out->bytes + at);
    } else if (as == ORB_ROUNDING_DIGITS) {
      put_digits(value, from->components, out->bytes + at, out->stored + at);
    } else {
      memcpy(out->bytes + at, value, (size_t)width);
    }
  }
  return ORB_OK;
}
