/* Polygon File Format, ASCII and binary of either order: any scalar types, polygons and triangle strips. Properties and
 * elements without a known meaning are skipped. */
#include <math.h>

#include "base/check.h"
#include "format/bytes.h"
#include "format/ply_header.h"
#include "format/readers.h"

typedef struct ply_reader {
  orb_build build;
  orb_text text;
  const unsigned char *begin;
  ply_header header;
  double color_scale; /* of the current element */
} ply_reader;

static orb_status malformed(ply_reader *r, const char *what) {
  int is_text = r->header.encoding == PLY_ASCII;
  return orb_build_malformed(r->build.ctx, is_text, is_text ? r->text.line : r->text.at - r->begin, "%s", what);
}

/* Where the reader is: line or offset. */
static int64_t where_of(const ply_reader *r) {
  return r->header.encoding == PLY_ASCII ? r->text.line : r->text.at - r->begin;
}

static double decode(const unsigned char *p, ply_type type, int big) {
  switch (type) {
    case PLY_I8:
      return (signed char)*p;
    case PLY_U8:
      return *p;
    case PLY_I16:
      return (int16_t)orb_read_u16(p, big);
    case PLY_U16:
      return orb_read_u16(p, big);
    case PLY_I32:
      return (int32_t)orb_read_u32(p, big);
    case PLY_U32:
      return orb_read_u32(p, big);
    case PLY_F32:
      return orb_read_f32(p, big);
    case PLY_F64:
      return orb_read_f64(p, big);
    case PLY_NONE:
      break;
  }
  return 0;
}

static inline orb_status take_value(ply_reader *r, ply_type type, double *out) {
  if (r->header.encoding == PLY_ASCII) {
    if (!orb_text_next(&r->text)) {
      return malformed(r, "The file is shorter than its header announces.");
    }
    return orb_text_number(&r->text, out) ? ORB_OK
                                          : malformed(r, "The PLY data contain something that is not a number.");
  }
  int size = orb_ply_type_size(type);
  if (r->text.end - r->text.at < size) {
    r->text.at = r->text.end;
    return malformed(r, "The file is shorter than its header announces.");
  }
  *out = decode(r->text.at, type, r->header.encoding == PLY_BIG);
  r->text.at += size;
  return ORB_OK;
}

/* An index of a list; lowest is −1 for strips, whose −1 ends a strip, and 0 for faces. */
static orb_status take_index(ply_reader *r, ply_type type, int64_t lowest, int64_t *out) {
  double value = 0;
  ORB_TRY(take_value(r, type, &value));
  if (!(value >= (double)lowest && value <= INT32_MAX) || value != floor(value)) {
    return malformed(r, "A face has a vertex index that is not valid.");
  }
  *out = (int64_t)value;
  return ORB_OK;
}

static orb_status take_polygon(ply_reader *r, const ply_property *property, int64_t count) {
  for (int64_t i = 0; i < count; i++) {
    int64_t index = -1, where = where_of(r);
    ORB_TRY(take_index(r, property->type, 0, &index));
    if (count >= 3) {
      ORB_TRY(orb_build_corner(&r->build, (orb_corner){(int32_t)index, -1, -1}, where));
    }
  }
  if (count == 0) {
    return malformed(r, "A face has no corners.");
  }
  return count >= 3 ? orb_build_face_end(&r->build, count) : ORB_OK;
}

static orb_status take_strip(ply_reader *r, const ply_property *property, int64_t count) {
  int64_t a = -1, b = -1, reversed = 0; /* every second triangle of a strip is */
  for (int64_t i = 0; i < count; i++) {
    int64_t c = -1, where = where_of(r);
    ORB_TRY(take_index(r, property->type, -1, &c));
    if (c < 0) {
      a = b = -1;
      reversed = 0;
      continue;
    }
    if (a >= 0) {
      ORB_TRY(orb_build_corner(&r->build, (orb_corner){(int32_t)(reversed ? b : a), -1, -1}, where));
      ORB_TRY(orb_build_corner(&r->build, (orb_corner){(int32_t)(reversed ? a : b), -1, -1}, where));
      ORB_TRY(orb_build_corner(&r->build, (orb_corner){(int32_t)c, -1, -1}, where));
      ORB_TRY(orb_build_face_end(&r->build, 3));
      reversed = !reversed;
    }
    a = b;
    b = c;
  }
  return ORB_OK;
}

static orb_status skip_values(ply_reader *r, const ply_property *property, int64_t count) {
  double value;
  if (r->header.encoding != PLY_ASCII) {
    int64_t bytes = count * orb_ply_type_size(property->type);
    if (r->text.end - r->text.at < bytes) {
      r->text.at = r->text.end;
      return malformed(r, "The file is shorter than its header announces.");
    }
    r->text.at += bytes;
    return ORB_OK;
  }
  for (int64_t i = 0; i < count; i++) {
    ORB_TRY(take_value(r, property->type, &value));
  }
  return ORB_OK;
}

static orb_status take_list(ply_reader *r, const ply_element *element, const ply_property *property) {
  double count = 0;
  ORB_TRY(take_value(r, property->count_type, &count));
  if (!(count >= 0 && count <= INT32_MAX) || count != floor(count)) {
    return malformed(r, "A list has a length that is not valid.");
  }
  int is_indices = property->role == PLY_INDICES;
  if (is_indices && element->kind == PLY_FACES) {
    return take_polygon(r, property, (int64_t)count);
  }
  if (is_indices && element->kind == PLY_STRIPS) {
    return take_strip(r, property, (int64_t)count);
  }
  return skip_values(r, property, (int64_t)count);
}

static orb_status add_vertex(ply_reader *r, unsigned roles, const double *value) {
  ORB_TRY(orb_build_vertex(&r->build, value + PLY_X));
  const unsigned normal = 1u << PLY_NX | 1u << PLY_NY | 1u << PLY_NZ, texcoord = 1u << PLY_S | 1u << PLY_T;
  const unsigned color = 1u << PLY_RED | 1u << PLY_GREEN | 1u << PLY_BLUE;
  if ((roles & normal) == normal) {
    ORB_TRY(orb_build_normal(&r->build, value + PLY_NX));
  }
  if ((roles & texcoord) == texcoord) {
    ORB_TRY(orb_build_texcoord(&r->build, value + PLY_S));
  }
  if ((roles & color) == color) {
    double rgba[4];
    for (int i = 0; i < 4; i++) {
      rgba[i] = value[PLY_RED + i] * r->color_scale;
    }
    ORB_TRY(orb_build_color(&r->build, rgba, roles & 1u << PLY_ALPHA ? 4 : 3));
  }
  return ORB_OK;
}

static orb_status read_element(ply_reader *r, const ply_element *element) {
  const ply_property *property = r->header.property + element->first;
  double value[PLY_ROLES] = {0};
  r->color_scale = 1;
  for (int i = 0; i < element->properties; i++) {
    if (property[i].role == PLY_RED) {
      r->color_scale = property[i].type == PLY_U8 ? 1.0 / 255 : property[i].type == PLY_U16 ? 1.0 / 65535 : 1;
    }
  }
  if (element->properties == 0) {
    return ORB_OK; /* its rows hold nothing */
  }
  for (int64_t row = 0; row < element->count; row++) {
    for (int i = 0; i < element->properties; i++) {
      ORB_TRY(property[i].count_type != PLY_NONE ? take_list(r, element, &property[i])
                                                 : take_value(r, property[i].type, &value[property[i].role]));
    }
    if (element->kind == PLY_VERTICES) {
      ORB_TRY(add_vertex(r, element->roles, value));
    }
    if ((row & 0xffff) == 0xffff) {
      ORB_TRY(orb_context_check(r->build.ctx));
    }
  }
  return ORB_OK;
}

orb_status orb_ply_read(orb_context *ctx, const unsigned char *bytes, size_t size, orb_mesh *out) {
  ply_reader r = {.text = {bytes, bytes + size, 1}, .begin = bytes};
  orb_build_init(&r.build, ctx);
  r.build.by_vertex = 1;
  r.build.colors_are_srgb = 1;
  orb_status status = orb_ply_header(ctx, &r.text, &r.header);
  for (int i = 0; i < r.header.elements && status == ORB_OK; i++) {
    status = read_element(&r, &r.header.element[i]);
  }
  if (status == ORB_OK && r.header.names_texture) {
    status = orb_build_drop(&r.build, "TextureFile", "",
                            "The texture of a PLY is another file. Export a GLB, which holds it.");
  }
  if (status == ORB_OK) {
    int is_text = r.header.encoding == PLY_ASCII;
    status = orb_build_finish(&r.build, is_text, is_text ? r.text.line : (int64_t)size, out);
  }
  orb_build_free(&r.build);
  return status;
}

orb_certainty orb_ply_is(const unsigned char *bytes, size_t size) {
  return size >= 4 && memcmp(bytes, "ply", 3) == 0 && bytes[3] <= ' ' ? ORB_SURE : ORB_NO;
}
