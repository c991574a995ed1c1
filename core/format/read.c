/* Mesh files in, GLB and sphere PLY out.
 *
 * In: read.c detects the format and calls a reader (obj.c, off.c, ply.c with ply_header.c, stl.c, 3mf.c, gltf.cc).
 * Readers take tokens from text.h and number.h or numbers from bytes.h, and fill an orb_build (build.h), which becomes
 * an orb_mesh. gltf.cc reads primitives; gltf_accessor.cc has their data, gltf_scene.cc the nodes, gltf_material.cc the
 * materials (with texture.c), gltf_packed.cc what is compressed, gltf_values.hh the JSON (with json_check.c). other.c
 * names files of other kinds. zip.c unpacks 3MF, xml.c parses it, 3mf.c and 3mf_*.c make objects and then a mesh of it.
 *
 * Out: gltf_write.c writes the asset, with gltf_write_material.c, and glb_text.c for the text; material_table.c says
 * what materials may have. sphere_ply.c writes a mesh with its embedding.
 */
#include <string.h>

#include "base/check.h"
#include "base/error.h"
#include "format/other.h"
#include "format/readers.h"

static const struct {
  orb_format format;
  const char *name;
  orb_certainty (*is)(const unsigned char *bytes, size_t size);
  orb_status (*read)(orb_context *ctx, const unsigned char *bytes, size_t size, orb_mesh *out);
} READERS[] = {
#define READER(id, value, function, name) {ORB_FORMAT_##id, name, orb_##function##_is, orb_##function##_read},
    ORB_FORMATS(READER)
#undef READER
};
enum { READER_COUNT = sizeof READERS / sizeof *READERS };

const char *orb_format_name(orb_format format) {
  for (int i = 0; i < READER_COUNT; i++) {
    if (READERS[i].format == format) {
      return READERS[i].name;
    }
  }
  return "auto";
}

orb_format orb_format_of_name(const char *name) {
  for (int i = 0; i < READER_COUNT; i++) {
    if (strcmp(name, READERS[i].name) == 0) {
      return READERS[i].format;
    }
  }
  return ORB_FORMAT_AUTO;
}

orb_format orb_format_detect(const unsigned char *bytes, size_t size) {
  orb_format found = ORB_FORMAT_AUTO;
  orb_certainty surest = ORB_NO;
  for (int i = 0; i < READER_COUNT && size > 0 && surest < ORB_SURE; i++) {
    orb_certainty certainty = READERS[i].is(bytes, size);
    if (certainty > surest) {
      surest = certainty;
      found = READERS[i].format;
    }
  }
  return surest < ORB_SURE && orb_format_other(bytes, size) ? ORB_FORMAT_AUTO : found;
}

orb_status orb_mesh_read(orb_context *ctx, const unsigned char *bytes, size_t size, orb_format format, orb_mesh *out,
                         orb_format *format_out) {
  memset(out, 0, sizeof *out);
  if (format == ORB_FORMAT_AUTO) {
    format = orb_format_detect(bytes, size);
  }
  if (format_out) {
    *format_out = format;
  }
  if (size == 0) {
    return orb_build_malformed(ctx, 0, 0, "The file is empty; send the bytes of a mesh file.");
  }
  const char *other = format == ORB_FORMAT_AUTO ? orb_format_other(bytes, size) : NULL;
  if (other) {
    return orb_fail(ctx, ORB_E_UNKNOWN_FORMAT, "This is %s.", other);
  }
  for (int i = 0; i < READER_COUNT; i++) {
    if (READERS[i].format == format) {
      return READERS[i].read(ctx, bytes, size, out);
    }
  }
  return orb_fail(ctx, ORB_E_UNKNOWN_FORMAT,
                  "The bytes are not OBJ, OFF, PLY, STL, 3MF, glTF or GLB; send one of these.");
}
