/* Reading a text file token by token, with line numbers. */
#ifndef ORB_FORMAT_TEXT_H
#define ORB_FORMAT_TEXT_H

#include <stddef.h>
#include <stdint.h>

#include "format/number.h"

typedef struct orb_text {
  const unsigned char *at, *end;
  int64_t line; /* of `at`, 1-based */
} orb_text;

/* Bytes of a UTF-8 byte order mark at the start. */
static inline size_t orb_bom(const unsigned char *bytes, size_t size) {
  return size >= 3 && bytes[0] == 0xef && bytes[1] == 0xbb && bytes[2] == 0xbf ? 3 : 0;
}

static inline int orb_is_eol(unsigned char c) {
  return c == '\n' || c == '\r';
}
static inline int orb_is_blank(unsigned char c) {
  return c == ' ' || c == '\t' || c == '\v' || c == '\f';
}
/* What may follow a number or a word. */
static inline int orb_is_break(unsigned char c) {
  return c <= ' ' || c == '#';
}

/* Takes one line end: LF, CR LF or CR. */
static inline void orb_text_eol(orb_text *text) {
  text->at += *text->at == '\r' && text->at + 1 < text->end && text->at[1] == '\n' ? 2 : 1;
  text->line++;
}

/* Moves to the next token of this line; a backslash before a line end joins lines. Returns 0 at the end of the line, at
 * a comment and at the end of the file. */
static inline int orb_text_blanks(orb_text *text) {
  for (; text->at < text->end; text->at++) {
    unsigned char c = *text->at;
    if (c > ' ' && c != '\\') {
      return c != '#';
    }
    if (c == '\\') {
      if (text->at + 1 < text->end && orb_is_eol(text->at[1])) {
        text->at++;
        orb_text_eol(text);
        text->at--;
        continue;
      }
      return 1;
    }
    if (!orb_is_blank(c)) {
      return !orb_is_eol(c);
    }
  }
  return 0;
}

/* Moves past the end of this line. */
static inline void orb_text_skip_line(orb_text *text) {
  while (text->at < text->end && !orb_is_eol(*text->at)) {
    text->at++;
  }
  if (text->at < text->end) {
    orb_text_eol(text);
  }
}

/* Moves to the next token of the file, over line ends and comments. Returns 0 at the end of the file. */
static inline int orb_text_next(orb_text *text) {
  for (;;) {
    if (orb_text_blanks(text)) {
      return 1;
    }
    if (text->at >= text->end) {
      return 0;
    }
    orb_text_skip_line(text);
  }
}

/* The length of the word at `at`, up to a break. */
static inline size_t orb_text_word(const orb_text *text) {
  const unsigned char *p = text->at;
  while (p < text->end && !orb_is_break(*p)) {
    p++;
  }
  return (size_t)(p - text->at);
}

/* Takes the number at `at`, which a break must follow. Returns 0 if there is none. */
static inline int orb_text_number(orb_text *text, double *out) {
  const unsigned char *p = orb_number_parse(text->at, text->end, out);
  if (!p || (p < text->end && !orb_is_break(*p) && *p != '\\')) {
    return 0;
  }
  text->at = p;
  return 1;
}

/* Takes the decimal integer at `at`, which a break must follow. Returns 0 if there is none, or if it or
 * its opposite exceeds 2⁵⁸·10 + 9. */
static inline int orb_text_integer(orb_text *text, int64_t *out) {
  const unsigned char *p = text->at;
  int negative = 0;
  if (p < text->end && (*p == '-' || *p == '+')) {
    negative = *p++ == '-';
  }
  const unsigned char *first = p;
  int64_t value = 0;
  while (p < text->end && (unsigned)(*p - '0') < 10) {
    if (value > ((int64_t)1 << 58)) {
      return 0;
    }
    value = value * 10 + (*p++ - '0');
  }
  if (p == first || (p < text->end && !orb_is_break(*p) && *p != '\\')) {
    return 0;
  }
  *out = negative ? -value : value;
  text->at = p;
  return 1;
}

/* Whether the word at `at` is this one, in upper or lower case. */
static inline int orb_text_is(const orb_text *text, const char *word) {
  const unsigned char *p = text->at;
  for (; *word; p++, word++) {
    unsigned char c = p < text->end ? *p : 0;
    if (c >= 'A' && c <= 'Z') {
      c = (unsigned char)(c | 32);
    }
    if (c != (unsigned char)*word) {
      return 0;
    }
  }
  return p == text->end || orb_is_break(*p);
}

#endif
