/* The front door of the readers: which format, then its reader. */
#include <string.h>

#include "base/check.h"
#include "format/gltf.h"
#include "format/readers.h"

static const char *const NAMES[] = {"auto", "obj", "off", "ply", "stl", "gltf", "glb"};
enum { FORMAT_COUNT = sizeof NAMES / sizeof *NAMES };

const char *orb_format_name(orb_format format) {
  return (unsigned)format < FORMAT_COUNT ? NAMES[format] : NAMES[0];
}

orb_format orb_format_of_name(const char *name) {
  for (int i = 1; i < FORMAT_COUNT; i++) {
    if (strcmp(name, NAMES[i]) == 0) {
      return (orb_format)i;
    }
  }
  return ORB_FORMAT_AUTO;
}

static int is_json_object(const unsigned char *bytes, size_t size) {
  size_t i = orb_bom(bytes, size);
  while (i < size && (bytes[i] == ' ' || bytes[i] == '\t' || bytes[i] == '\n' || bytes[i] == '\r')) {
    i++;
  }
  return i < size && bytes[i] == '{';
}

orb_format orb_format_detect(const unsigned char *bytes, size_t size) {
  if (size == 0) {
    return ORB_FORMAT_AUTO;
  }
  if (size >= 4 && memcmp(bytes, "glTF", 4) == 0) {
    return ORB_FORMAT_GLB;
  }
  if (orb_ply_is(bytes, size)) {
    return ORB_FORMAT_PLY;
  }
  if (orb_stl_is_exact(bytes, size)) {
    return ORB_FORMAT_STL;
  }
  if (is_json_object(bytes, size)) {
    return ORB_FORMAT_GLTF;
  }
  if (orb_off_is(bytes, size)) {
    return ORB_FORMAT_OFF;
  }
  if (orb_stl_is_text(bytes, size)) {
    return ORB_FORMAT_STL;
  }
  if (orb_obj_is(bytes, size)) {
    return ORB_FORMAT_OBJ;
  }
  return orb_stl_is_plausible(bytes, size) ? ORB_FORMAT_STL : ORB_FORMAT_AUTO;
}

orb_status orb_mesh_read(orb_context *ctx, const unsigned char *bytes, size_t size, orb_format format, orb_mesh *out,
                         orb_format *format_out) {
  memset(out, 0, sizeof *out);
  if (size == 0) {
    if (format_out) {
      *format_out = format;
    }
    return orb_build_malformed(ctx, 0, 0, "The file is empty; send the bytes of a mesh file.");
  }
  if (format == ORB_FORMAT_AUTO) {
    format = orb_format_detect(bytes, size);
  }
  if (format_out) {
    *format_out = format;
  }
  switch (format) {
    case ORB_FORMAT_OBJ:
      return orb_obj_read(ctx, bytes, size, out);
    case ORB_FORMAT_OFF:
      return orb_off_read(ctx, bytes, size, out);
    case ORB_FORMAT_PLY:
      return orb_ply_read(ctx, bytes, size, out);
    case ORB_FORMAT_STL:
      return orb_stl_read(ctx, bytes, size, out);
    case ORB_FORMAT_GLTF:
    case ORB_FORMAT_GLB:
      return orb_gltf_read(ctx, bytes, size, format == ORB_FORMAT_GLB, out);
    case ORB_FORMAT_AUTO:
      break;
  }
  return orb_fail(ctx, ORB_E_UNKNOWN_FORMAT, "The bytes are not OBJ, OFF, PLY, STL, glTF or GLB; send one of these.");
}
