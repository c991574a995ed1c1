/* Object File Format: ASCII and big-endian binary, with prefixes ST, C and N, or without its keyword. Each vertex has a
 * line of its own; plain OFF may have colours after the three coordinates. Faces of one or two corners (points and
 * lines) are skipped. */
#include "base/check.h"
#include "format/bytes.h"
#include "format/readers.h"
#include "format/text.h"

typedef struct off_reader {
  orb_build build;
  orb_text text;
  const unsigned char *begin;
  int has_texcoord, has_color, has_normal, has_4, has_n, has_keyword, is_binary;
  int64_t vertices, faces;
} off_reader;

static orb_status malformed(off_reader *r, const char *what) {
  return orb_build_malformed(r->build.ctx, !r->is_binary, r->is_binary ? r->text.at - r->begin : r->text.line, "%s",
                             what);
}

static int take(off_reader *r, const char *letters) {
  size_t length = strlen(letters);
  if ((size_t)(r->text.end - r->text.at) < length || memcmp(r->text.at, letters, length) != 0) {
    return 0;
  }
  r->text.at += length;
  return 1;
}

/* Reads the keyword with its prefixes; leaves the text where it was if there is none. */
static void read_keyword(off_reader *r) {
  orb_text start = r->text;
  if (!orb_text_next(&r->text)) {
    return;
  }
  r->has_texcoord = take(r, "ST");
  r->has_color = take(r, "C");
  r->has_normal = take(r, "N");
  r->has_4 = take(r, "4");
  r->has_n = take(r, "n");
  r->has_keyword = take(r, "OFF") && (r->text.at == r->text.end || orb_is_break(*r->text.at));
  if (!r->has_keyword) {
    *r = (off_reader){.build = r->build, .text = start, .begin = r->begin};
    return;
  }
  if (orb_text_blanks(&r->text) && orb_text_is(&r->text, "binary")) {
    r->text.at += 6;
    orb_text_skip_line(&r->text);
    r->is_binary = 1;
  }
}

/* Reads the counts of vertices, faces and perhaps edges, on one line. */
static int take_counts(off_reader *r) {
  int64_t edges;
  return orb_text_next(&r->text) && orb_text_integer(&r->text, &r->vertices) && orb_text_blanks(&r->text) &&
         orb_text_integer(&r->text, &r->faces) && r->vertices >= 0 && r->faces >= 0 &&
         (!orb_text_blanks(&r->text) || orb_text_integer(&r->text, &edges)) && !orb_text_blanks(&r->text);
}

static orb_status add_vertex(off_reader *r, const double *value, int count) {
  ORB_TRY(orb_build_vertex(&r->build, value));
  int at = 3;
  if (r->has_normal) {
    if (count < at + 3) {
      return malformed(r, "A vertex lacks its normal.");
    }
    ORB_TRY(orb_build_normal(&r->build, value + at));
    at += 3;
  }
  int rest = count - at - (r->has_texcoord ? 2 : 0);
  if (rest < 0) {
    return malformed(r, "A vertex lacks its texture coordinates.");
  }
  if (rest == 3 || rest == 4) {
    ORB_TRY(orb_build_color(&r->build, value + at, rest));
    at += rest;
  } else if (r->has_color) {
    return malformed(r, "A vertex lacks its colour.");
  }
  return r->has_texcoord ? orb_build_texcoord(&r->build, value + at) : ORB_OK;
}

static orb_status read_vertex(off_reader *r) {
  double value[16];
  int count = 0;
  do {
    if (!orb_text_next(&r->text)) {
      return malformed(r, "The file ends among its vertices.");
    }
    do {
      double number;
      if (!orb_text_number(&r->text, &number)) {
        return malformed(r, "A vertex contains something that is not a number.");
      }
      if (count < 16) {
        value[count++] = number;
      }
    } while (orb_text_blanks(&r->text));
  } while (count < 3);
  return add_vertex(r, value, count);
}

static orb_status read_face(off_reader *r) {
  int64_t corners;
  if (!orb_text_next(&r->text)) {
    return malformed(r, "The file ends among its faces.");
  }
  if (!orb_text_integer(&r->text, &corners) || corners < 1 || corners > ORB_FACE_CORNERS_MAX) {
    return malformed(r, "A face does not begin with its number of corners.");
  }
  for (int64_t i = 0; i < corners; i++) {
    int64_t index;
    if (!orb_text_next(&r->text)) {
      return malformed(r, "The file ends within a face.");
    }
    if (!orb_text_integer(&r->text, &index) || index < 0 || index >= r->vertices) {
      return malformed(r, "A face names a vertex that the file does not have.");
    }
    if (corners >= 3) {
      ORB_TRY(orb_build_corner(&r->build, (orb_corner){(int32_t)index, -1, -1}, r->text.line));
    }
  }
  while (r->text.at < r->text.end && !orb_is_eol(*r->text.at)) { /* perhaps a colour */
    r->text.at++;
  }
  return corners >= 3 ? orb_build_face_end(&r->build, corners) : ORB_OK;
}

static int has_bytes(const off_reader *r, int64_t count) {
  return r->text.end - r->text.at >= count;
}

static int64_t take_i32(off_reader *r) {
  uint32_t bits = orb_read_u32(r->text.at, 1);
  r->text.at += 4;
  return (int32_t)bits;
}

static orb_status cut_short(off_reader *r) {
  r->text.at = r->text.end;
  return malformed(r, "The binary OFF is shorter than its header announces.");
}

static orb_status read_binary_face(off_reader *r) {
  if (!has_bytes(r, 4)) {
    return cut_short(r);
  }
  int64_t corners = take_i32(r);
  if (corners < 1 || corners > ORB_FACE_CORNERS_MAX) {
    return malformed(r, "A face does not begin with its number of corners.");
  }
  if (!has_bytes(r, 4 * corners + 4)) {
    return cut_short(r);
  }
  for (int64_t i = 0; i < corners; i++) {
    int64_t index = take_i32(r);
    if (index < 0 || index >= r->vertices) {
      return malformed(r, "A face names a vertex that the file does not have.");
    }
    if (corners >= 3) {
      ORB_TRY(orb_build_corner(&r->build, (orb_corner){(int32_t)index, -1, -1}, r->text.at - 4 - r->begin));
    }
  }
  int64_t colors = take_i32(r);
  if (colors < 0 || !has_bytes(r, 4 * colors)) {
    return cut_short(r);
  }
  r->text.at += 4 * colors;
  return corners >= 3 ? orb_build_face_end(&r->build, corners) : ORB_OK;
}

static orb_status read_binary(off_reader *r) {
  if (!has_bytes(r, 12)) {
    return cut_short(r);
  }
  r->vertices = take_i32(r);
  r->faces = take_i32(r);
  (void)take_i32(r);
  int floats = 3 + (r->has_normal ? 3 : 0) + (r->has_color ? 4 : 0) + (r->has_texcoord ? 2 : 0);
  if (r->vertices < 0 || r->faces < 0) {
    return malformed(r, "The binary OFF has a negative count.");
  }
  if (!has_bytes(r, 4 * floats * r->vertices)) {
    return cut_short(r);
  }
  for (int64_t v = 0; v < r->vertices; v++) {
    double value[12];
    for (int i = 0; i < floats; i++, r->text.at += 4) {
      value[i] = orb_read_f32(r->text.at, 1);
    }
    ORB_TRY(add_vertex(r, value, floats));
  }
  for (int64_t f = 0; f < r->faces; f++) {
    ORB_TRY(read_binary_face(r));
  }
  return ORB_OK;
}

static orb_status read_off(off_reader *r) {
  read_keyword(r);
  if (r->has_4 || r->has_n) {
    return malformed(r, "The OFF file has coordinates of four or of n dimensions; send it in three.");
  }
  r->build.by_vertex = 1;
  r->build.colors_are_srgb = 1;
  if (r->is_binary) {
    return read_binary(r);
  }
  if (!take_counts(r)) {
    return malformed(r, "The OFF header lacks its counts of vertices, faces and edges.");
  }
  for (int64_t v = 0; v < r->vertices; v++) {
    ORB_TRY(read_vertex(r));
    if ((v & 0xffff) == 0xffff) {
      ORB_TRY(orb_context_check(r->build.ctx));
    }
  }
  for (int64_t f = 0; f < r->faces; f++) {
    ORB_TRY(read_face(r));
    if ((f & 0xffff) == 0xffff) {
      ORB_TRY(orb_context_check(r->build.ctx));
    }
  }
  return ORB_OK;
}

orb_status orb_off_read(orb_context *ctx, const unsigned char *bytes, size_t size, orb_mesh *out) {
  off_reader r = {.text = {bytes + orb_bom(bytes, size), bytes + size, 1}, .begin = bytes};
  orb_build_init(&r.build, ctx);
  orb_status status = read_off(&r);
  if (status == ORB_OK) {
    status = orb_build_finish(&r.build, !r.is_binary, r.is_binary ? (int64_t)size : r.text.line, out);
  }
  orb_build_free(&r.build);
  return status;
}

orb_certainty orb_off_is(const unsigned char *bytes, size_t size) {
  off_reader r = {.text = {bytes + orb_bom(bytes, size), bytes + size, 1}, .begin = bytes};
  read_keyword(&r);
  return r.has_keyword || take_counts(&r) ? ORB_LIKELY : ORB_NO;
}
