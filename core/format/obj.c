/* Wavefront OBJ: v (with colours after the position), vt, vn, f, o, usemtl; everything else is skipped. Indices may be
 * negative (counted back from the last element) or point forward. */
#include <string.h>

#include "base/check.h"
#include "format/readers.h"
#include "format/text.h"

typedef struct obj_reader {
  orb_build build;
  orb_text text;
  int has_objects; /* an "o" has been read */
  int has_library; /* a "mtllib" has been noted */
} obj_reader;

/* The file ends within the line that is being read, as it does where a download was interrupted. */
static int is_cut(const orb_text *text) {
  const unsigned char *p = text->at;
  while (p < text->end && !orb_is_eol(*p)) {
    p++;
  }
  return p == text->end;
}

static orb_status malformed(obj_reader *r, const char *what) {
  return orb_build_malformed(r->build.ctx, 1, r->text.line, "%s%s", what,
                             is_cut(&r->text) ? " The file ends within this line, so its rest is probably missing: "
                                                "download or export it again. If you cannot, delete this line and "
                                                "send what is left with repair=fill_holes."
                                              : "");
}

static orb_status read_vertex(obj_reader *r) {
  double value[8];
  int count = 0;
  while (orb_text_blanks(&r->text)) {
    double number;
    if (!orb_text_number(&r->text, &number)) {
      return malformed(r, "A vertex contains something that is not a number.");
    }
    if (count < 8) {
      value[count++] = number;
    }
  }
  if (count < 3) {
    return malformed(r, "A vertex needs three coordinates.");
  }
  ORB_TRY(orb_build_vertex(&r->build, value));
  if (count >= 6) { /* x y z r g b [a] */
    ORB_TRY(orb_build_color(&r->build, value + 3, count == 7 ? 4 : 3));
  }
  return ORB_OK;
}

static orb_status read_direction(obj_reader *r, int wanted, double value[3]) {
  value[0] = value[1] = value[2] = 0;
  for (int i = 0; i < wanted; i++) {
    if (!orb_text_blanks(&r->text)) {
      if (wanted == 2 && i == 1) {
        return ORB_OK; /* a texture coordinate of one number */
      }
      return malformed(r, "A line ends before its numbers are complete.");
    }
    if (!orb_text_number(&r->text, &value[i])) {
      return malformed(r, "A line contains something that is not a number.");
    }
  }
  return ORB_OK;
}

/* One index of a corner: 1-based or negative; *out is 0-based. */
static orb_status read_index(obj_reader *r, int64_t count, int32_t *out) {
  const unsigned char *p = r->text.at;
  int negative = 0;
  if (p < r->text.end && (*p == '-' || *p == '+')) {
    negative = *p++ == '-';
  }
  const unsigned char *first = p;
  int64_t value = 0;
  while (p < r->text.end && (unsigned)(*p - '0') < 10 && value <= INT32_MAX) {
    value = value * 10 + (*p++ - '0');
  }
  if (p == first) {
    return malformed(r, "A face contains something that is not an index.");
  }
  int64_t index = negative ? count - value : value - 1;
  if (value == 0 || value > INT32_MAX || index < 0) {
    return malformed(
        r, value == 0 ? "A face uses index 0; indices count from 1." : "A face uses an index that is out of range.");
  }
  r->text.at = p;
  *out = (int32_t)index;
  return ORB_OK;
}

static int at_slash(const obj_reader *r) {
  return r->text.at < r->text.end && *r->text.at == '/';
}

static orb_status read_corner(obj_reader *r, orb_corner *corner) {
  *corner = (orb_corner){-1, -1, -1};
  ORB_TRY(read_index(r, r->build.vertices, &corner->vertex));
  if (at_slash(r)) {
    r->text.at++;
    if (!at_slash(r) && r->text.at < r->text.end && !orb_is_break(*r->text.at)) {
      ORB_TRY(read_index(r, r->build.texcoord_count, &corner->texcoord));
    }
    if (at_slash(r)) {
      r->text.at++;
      if (r->text.at < r->text.end && !orb_is_break(*r->text.at)) {
        ORB_TRY(read_index(r, r->build.normal_count, &corner->normal));
      }
    }
  }
  if (r->text.at < r->text.end && !orb_is_break(*r->text.at) && *r->text.at != '\\') {
    return malformed(r, "A corner of a face is not of the form v, v/vt, v//vn or v/vt/vn.");
  }
  return ORB_OK;
}

static orb_status read_face(obj_reader *r) {
  int64_t corners = 0;
  while (orb_text_blanks(&r->text)) {
    orb_corner corner;
    ORB_TRY(read_corner(r, &corner));
    ORB_TRY(orb_build_corner(&r->build, corner, r->text.line));
    corners++;
  }
  if (corners < 3) {
    return malformed(r, "A face needs three corners or more.");
  }
  return orb_build_face_end(&r->build, corners);
}

/* The rest of the line, without blanks around it. */
static const unsigned char *read_name(obj_reader *r, size_t *length) {
  (void)orb_text_blanks(&r->text);
  const unsigned char *first = r->text.at, *last = first;
  while (r->text.at < r->text.end && !orb_is_eol(*r->text.at)) {
    last = orb_is_blank(*r->text.at) ? last : r->text.at + 1;
    r->text.at++;
  }
  *length = (size_t)(last - first);
  return first;
}

static orb_status read_usemtl(obj_reader *r) {
  size_t length;
  const unsigned char *name = read_name(r, &length);
  return orb_build_use_material(&r->build, name, length);
}

/* Objects have names; groups name parts only in files without objects. */
static orb_status read_object(obj_reader *r, int is_object) {
  size_t length;
  const unsigned char *name = read_name(r, &length);
  if (!is_object && r->has_objects) {
    return ORB_OK;
  }
  r->has_objects = is_object;
  return orb_build_object(&r->build, name, length);
}

/* The file that holds the materials; an upload has only one file. */
static orb_status note_library(obj_reader *r) {
  char name[100] = "";
  size_t length = 0;
  orb_text text = r->text;
  text.at += strlen("mtllib");
  (void)orb_text_blanks(&text);
  while (text.at < text.end && !orb_is_eol(*text.at) && length < sizeof name - 1) {
    name[length++] = (char)*text.at++;
  }
  while (length > 0 && orb_is_blank((unsigned char)name[length - 1])) {
    length--;
  }
  name[length] = 0;
  return orb_build_drop(&r->build, "mtllib", name,
                        "Materials of an OBJ are in another file. Export a GLB, which holds them.");
}

static orb_status read_line(obj_reader *r) {
  double value[3];
  const unsigned char *p = r->text.at;
  size_t length = orb_text_word(&r->text);
  r->text.at += length;
  if (length == 1 && *p == 'v') {
    return read_vertex(r);
  }
  if (length == 1 && *p == 'f') {
    return read_face(r);
  }
  if (length == 2 && p[0] == 'v' && p[1] == 'n') {
    ORB_TRY(read_direction(r, 3, value));
    return orb_build_normal(&r->build, value);
  }
  if (length == 2 && p[0] == 'v' && p[1] == 't') {
    ORB_TRY(read_direction(r, 2, value));
    return orb_build_texcoord(&r->build, value);
  }
  if (length == 2 && p[0] == 'f' && p[1] == 'o') {
    return read_face(r);
  }
  r->text.at = p;
  if (length == 1 && (p[0] == 'o' || p[0] == 'g')) {
    r->text.at += length;
    ORB_TRY(read_object(r, p[0] == 'o'));
    r->text.at = p;
  }
  if (orb_text_is(&r->text, "usemtl")) {
    r->text.at += length;
    return read_usemtl(r);
  }
  if (orb_text_is(&r->text, "mtllib") && !r->has_library) {
    r->has_library = 1;
    ORB_TRY(note_library(r));
  }
  if (*p < ' ' || *p == 127) {
    return malformed(r, "The file contains control characters where text should be.");
  }
  /* skipped, with the lines that continue it */
  while (r->text.at < r->text.end && !orb_is_eol(*r->text.at)) {
    if (*r->text.at == '\\' && r->text.at + 1 < r->text.end && orb_is_eol(r->text.at[1])) {
      r->text.at++;
      orb_text_eol(&r->text);
    } else {
      r->text.at++;
    }
  }
  return ORB_OK;
}

orb_status orb_obj_read(orb_context *ctx, const unsigned char *bytes, size_t size, orb_mesh *out) {
  obj_reader r = {.text = {bytes + orb_bom(bytes, size), bytes + size, 1}};
  orb_build_init(&r.build, ctx);
  r.build.colors_are_srgb = 1;
  orb_status status = ORB_OK;
  for (int64_t lines = 0; status == ORB_OK && orb_text_next(&r.text); lines++) {
    status = read_line(&r);
    if ((lines & 0xffff) == 0xffff && status == ORB_OK) {
      status = orb_context_check(ctx);
    }
  }
  if (status == ORB_OK) {
    status = orb_build_finish(&r.build, 1, r.text.line, out);
  }
  orb_build_free(&r.build);
  return status;
}

orb_certainty orb_obj_is(const unsigned char *bytes, size_t size) {
  static const char *const words[] = {
      "v",      "vt", "vn",     "vp",     "f",      "fo",         "o",     "g",        "s",        "l",   "p",
      "usemtl", "mg", "mtllib", "usemap", "maplib", "shadow_obj", "bevel", "c_interp", "d_interp", "lod", "cstype"};
  orb_text text = {bytes + orb_bom(bytes, size), bytes + size, 1};
  if (!orb_text_next(&text)) {
    int is_comments = bytes[orb_bom(bytes, size) < size ? orb_bom(bytes, size) : 0] == '#';
    return is_comments ? ORB_LIKELY : ORB_NO;
  }
  for (size_t i = 0; i < sizeof words / sizeof *words; i++) {
    if (orb_text_is(&text, words[i])) {
      return ORB_LIKELY;
    }
  }
  return ORB_NO;
}
