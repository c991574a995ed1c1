#include "http/disposition.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/ids.h"

enum { NAMES_MOST = DISPOSITION_NAME - 10 }; /* bytes of the shapes' names; ".glb" follows */

static int is_plain(unsigned char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '_' || c == '.';
}

/* Whether a byte continues a character of UTF-8. */
static int continues(unsigned char c) {
  return (c & 0xC0) == 0x80;
}

/* Appends one name of JSON text, up to its closing mark, as far as there is room for whole characters. */
static const char *append_name(const char *at, char *out, size_t *n) {
  while (*at && *at != '"') {
    size_t size = 1;
    char c = *at;
    if (c == '\\') { /* \", \\ and control characters: none belongs in a file name */
      size = at[1] == 'u' ? 6 : 2;
      c = '_';
    } else if ((unsigned char)c < 0x20 || strchr("/:*?<>|\x7f", c)) {
      c = '_';
    } else {
      while (continues((unsigned char)at[size])) {
        size++;
      }
    }
    size_t room = c == *at ? size : 1;
    if (*n + room > NAMES_MOST) {
      return at;
    }
    out[*n] = c;
    memcpy(out + *n + 1, at + 1, room - 1);
    *n += room;
    at += strnlen(at, size);
  }
  return at;
}

/* Ends a name of n bytes. otherwise: the name if these are none. */
static void end_name(char out[DISPOSITION_NAME], size_t n, const char *otherwise, const char *format) {
  if (n == 0) {
    n = (size_t)snprintf(out, DISPOSITION_NAME, "%s", otherwise);
  } else if (out[0] == '.' || out[0] == '-') { /* a hidden file, or one that a command takes for an option */
    out[0] = '_';
  }
  (void)snprintf(out + n, DISPOSITION_NAME - n, ".%s", format);
}

void disposition_mesh_name(const char *description, const char *format, char out[DISPOSITION_NAME]) {
  static const char mark[] = "\",\"name\":\"";
  const char *at = strstr(description, mark);
  size_t n = 0;
  if (at) {
    append_name(at + sizeof mark - 1, out, &n);
  }
  end_name(out, n, "mesh", format);
}

/* The description begins with its shapes, and in JSON no name can contain the unescaped mark. */
void disposition_name(const char *description, char out[DISPOSITION_NAME]) {
  static const char mark[] = "{\"mesh\":\"", after[] = "\",\"name\":\"";
  const char *end = strstr(description, "],\"landmarks\":"), *at = description;
  size_t n = 0;
  while (end && (at = strstr(at, mark)) && at < end) {
    at += sizeof mark - 1 + API_ID_SIZE - 1;
    if (strncmp(at, after, sizeof after - 1) != 0) {
      continue;
    }
    if (n > 0 && n < NAMES_MOST) {
      out[n++] = '-';
    }
    at = append_name(at + sizeof after - 1, out, &n);
  }
  end_name(out, n, "asset", "glb");
}

void disposition_write(const char *name, char out[DISPOSITION_SIZE]) {
  static const char marks[] = "!#$&+-.^_`|~"; /* attr-char of RFC 8187 besides letters and digits */
  int plain = 1;
  size_t n = (size_t)snprintf(out, DISPOSITION_SIZE, "inline; filename=\"");
  for (const char *c = name; *c; c++) {
    plain &= is_plain((unsigned char)*c);
    if (!continues((unsigned char)*c)) { /* one "_" for a character of several bytes */
      out[n++] = is_plain((unsigned char)*c) ? *c : '_';
    }
  }
  out[n++] = '"';
  out[n] = 0;
  if (plain) {
    return;
  }
  n += (size_t)snprintf(out + n, DISPOSITION_SIZE - n, "; filename*=UTF-8''");
  for (const char *c = name; *c; c++) {
    int kept = is_plain((unsigned char)*c) || strchr(marks, *c);
    n += (size_t)snprintf(out + n, DISPOSITION_SIZE - n, kept ? "%c" : "%%%02X", (unsigned char)*c);
  }
}
