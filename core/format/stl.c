/* STL, ASCII and binary. Vertices are numbered 3·facet + corner. Facet normals are ignored: the corners imply them. */
#include <math.h>
#include <string.h>

#include "base/check.h"
#include "format/bytes.h"
#include "format/readers.h"
#include "format/text.h"

enum { HEADER = 84, FACET = 50 }; /* bytes of a binary file */

static orb_status read_binary(orb_build *build, const unsigned char *bytes, size_t size, orb_mesh *out) {
  if (size < HEADER) {
    return orb_build_malformed(build->ctx, 0, (int64_t)size, "The binary STL ends within its header of 84 bytes.");
  }
  int64_t count = orb_read_u32(bytes + 80, 0), there = (int64_t)(size - HEADER) / FACET;
  if (count > there) {
    return orb_build_malformed(build->ctx, 0, (int64_t)size,
                               "The binary STL announces %lld facets but ends after %lld.", (long long)count,
                               (long long)there);
  }
  const unsigned char *p = bytes + HEADER;
  for (int64_t t = 0; t < count; t++, p += FACET) {
    for (int k = 0; k < 3; k++) {
      double position[3];
      for (int i = 0; i < 3; i++) {
        position[i] = orb_read_f32(p + 12 + 12 * k + 4 * i, 0);
      }
      ORB_TRY(orb_build_vertex(build, position));
      ORB_TRY(orb_build_corner(build, (orb_corner){(int32_t)(3 * t + k), -1, -1}, p - bytes));
    }
    ORB_TRY(orb_build_face_end(build, 3));
    if ((t & 0xffff) == 0xffff) {
      ORB_TRY(orb_context_check(build->ctx));
    }
  }
  return orb_build_finish(build, 0, (int64_t)size, out);
}

static orb_status expect(orb_build *build, orb_text *text, const char *word) {
  if (!orb_text_next(text) || !orb_text_is(text, word)) {
    return orb_build_malformed(build->ctx, 1, text->line, "The ASCII STL lacks \"%s\" here.", word);
  }
  text->at += strlen(word);
  return ORB_OK;
}

static orb_status read_numbers(orb_build *build, orb_text *text, double out[3]) {
  for (int i = 0; i < 3; i++) {
    if (!orb_text_next(text) || !orb_text_number(text, &out[i])) {
      return orb_build_malformed(build->ctx, 1, text->line, "The ASCII STL lacks a number here.");
    }
  }
  return ORB_OK;
}

static orb_status read_facet(orb_build *build, orb_text *text) {
  double value[3];
  if (orb_text_next(text) && orb_text_is(text, "normal")) {
    ORB_TRY(expect(build, text, "normal"));
    ORB_TRY(read_numbers(build, text, value));
  }
  ORB_TRY(expect(build, text, "outer"));
  ORB_TRY(expect(build, text, "loop"));
  for (int k = 0; k < 3; k++) {
    ORB_TRY(expect(build, text, "vertex"));
    ORB_TRY(read_numbers(build, text, value));
    ORB_TRY(orb_build_vertex(build, value));
    ORB_TRY(orb_build_corner(build, (orb_corner){(int32_t)(build->vertices - 1), -1, -1}, text->line));
  }
  ORB_TRY(expect(build, text, "endloop"));
  ORB_TRY(expect(build, text, "endfacet"));
  return orb_build_face_end(build, 3);
}

static orb_status read_text(orb_build *build, const unsigned char *bytes, size_t size, orb_mesh *out) {
  orb_text text = {bytes + orb_bom(bytes, size), bytes + size, 1};
  int inside = 0;
  while (orb_text_next(&text)) {
    if (inside && orb_text_is(&text, "facet")) {
      text.at += 5;
      ORB_TRY(read_facet(build, &text));
    } else if (inside && orb_text_is(&text, "endsolid")) {
      inside = 0;
      orb_text_skip_line(&text);
    } else if (!inside && orb_text_is(&text, "solid")) {
      inside = 1;
      orb_text_skip_line(&text);
    } else {
      return orb_build_malformed(build->ctx, 1, text.line, "The ASCII STL lacks \"%s\" here.",
                                 inside ? "facet\" or \"endsolid" : "solid");
    }
    if ((build->faces & 0x3fff) == 0) {
      ORB_TRY(orb_context_check(build->ctx));
    }
  }
  if (inside) {
    return orb_build_malformed(build->ctx, 1, text.line, "The ASCII STL ends without \"endsolid\".");
  }
  return orb_build_finish(build, 1, text.line, out);
}

/* Binary, and its count fits its size. */
static int is_exact(const unsigned char *bytes, size_t size) {
  return size >= HEADER && (size - HEADER) % FACET == 0 && (size - HEADER) / FACET == orb_read_u32(bytes + 80, 0);
}

/* "solid", and among the first bytes none that a text would not have. */
static int is_text(const unsigned char *bytes, size_t size) {
  orb_text text = {bytes + orb_bom(bytes, size), bytes + size, 1};
  if (!orb_text_next(&text) || !orb_text_is(&text, "solid")) {
    return 0;
  }
  for (size_t i = 0; i < size && i < 512; i++) {
    if (bytes[i] < ' ' && !orb_is_eol(bytes[i]) && !orb_is_blank(bytes[i])) {
      return 0;
    }
  }
  return 1;
}

/* Binary, going by its first facets. */
static int is_plausible(const unsigned char *bytes, size_t size) {
  if (size < HEADER + FACET || orb_read_u32(bytes + 80, 0) == 0) {
    return size >= 5 && memcmp(bytes, "solid", 5) == 0;
  }
  for (size_t t = 0; t < 8 && HEADER + FACET * (t + 1) <= size; t++) {
    double squared = 0;
    for (size_t i = 0; i < 12; i++) {
      double x = orb_read_f32(bytes + HEADER + FACET * t + 4 * i, 0);
      if (!isfinite(x) || fabs(x) > 1e12 || (x != 0 && fabs(x) < 1e-30)) {
        return 0;
      }
      squared += i < 3 ? x * x : 0;
    }
    if (squared != 0 && (squared < 0.8 || squared > 1.2)) {
      return 0;
    }
  }
  return 1;
}

orb_status orb_stl_read(orb_context *ctx, const unsigned char *bytes, size_t size, orb_mesh *out) {
  orb_build build;
  orb_build_init(&build, ctx);
  orb_status status = !is_exact(bytes, size) && is_text(bytes, size) ? read_text(&build, bytes, size, out)
                                                                     : read_binary(&build, bytes, size, out);
  orb_build_free(&build);
  return status;
}

/* A binary STL may begin with "solid" too, so its size decides before its words. */
orb_certainty orb_stl_is(const unsigned char *bytes, size_t size) {
  return is_exact(bytes, size)       ? ORB_SURE
         : is_text(bytes, size)      ? ORB_LIKELY
         : is_plausible(bytes, size) ? ORB_POSSIBLE
                                     : ORB_NO;
}
