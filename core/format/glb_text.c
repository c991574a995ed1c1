#include "format/glb_text.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "orbmorph/utf8.h"

void orb_glb_put(orb_glb_writer *w, const void *bytes, size_t size) {
  if (w->status == ORB_OK) {
    w->status = orb_buffer_append(w->ctx, w->out, bytes, size);
  }
}

void orb_glb_text(orb_glb_writer *w, const char *literal) {
  orb_glb_put(w, literal, strlen(literal));
}

void orb_glb_integer(orb_glb_writer *w, const char *before, size_t value) {
  char digits[24];
  orb_glb_text(w, before);
  orb_glb_put(w, digits, (size_t)snprintf(digits, sizeof digits, "%zu", value));
}

void orb_glb_number(orb_glb_writer *w, const char *before, double value) {
  char digits[40];
  int length = 0;
  for (int precision = 6; precision <= 17; precision++) {
    length = snprintf(digits, sizeof digits, "%.*g", precision, value);
    if (strtod(digits, NULL) == value) {
      break;
    }
  }
  orb_glb_text(w, before);
  for (int i = 0; i < length; i++) {
    orb_glb_put(w, strchr("+-0123456789e", digits[i]) ? &digits[i] : ".", 1);
  }
}

void orb_glb_numbers(orb_glb_writer *w, const char *before, const double *values, int count) {
  orb_glb_text(w, before);
  for (int i = 0; i < count; i++) {
    orb_glb_number(w, i ? "," : "[", values[i]);
  }
  orb_glb_text(w, "]");
}

void orb_glb_quoted(orb_glb_writer *w, const char *before, const char *string) {
  orb_glb_text(w, before);
  orb_glb_text(w, "\"");
  for (const unsigned char *p = (const unsigned char *)string; *p;) {
    size_t length = orb_utf8_length(p, 4);
    char escape[8];
    if (length == 0) {
      orb_glb_text(w, "\xef\xbf\xbd");
    } else if (*p == '"' || *p == '\\') {
      orb_glb_put(w, (char[]){'\\', (char)*p}, 2);
    } else if (*p < 0x20) {
      orb_glb_put(w, escape, (size_t)snprintf(escape, sizeof escape, "\\u%04x", *p));
    } else {
      orb_glb_put(w, p, length);
    }
    p += length ? length : 1;
  }
  orb_glb_text(w, "\"");
}
