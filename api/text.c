#include "api/text.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "orbmorph/utf8.h"

void api_text_free(api_text *text) {
  free(text->data);
  memset(text, 0, sizeof *text);
}

static int reserve(api_text *text, size_t more) {
  if (text->failed || more > SIZE_MAX / 4 || text->size > SIZE_MAX / 4) {
    text->failed = 1;
    return 0;
  }
  size_t need = text->size + more + 1;
  if (need <= text->capacity) {
    return 1;
  }
  size_t capacity = text->capacity < 256 ? 256 : text->capacity * 2;
  if (capacity < need) {
    capacity = need;
  }
  char *data = realloc(text->data, capacity);
  if (!data) {
    text->failed = 1;
    return 0;
  }
  text->data = data;
  text->capacity = capacity;
  return 1;
}

void api_text_append(api_text *text, const char *bytes, size_t size) {
  if (reserve(text, size)) {
    if (size) {
      memcpy(text->data + text->size, bytes, size);
    }
    text->size += size;
    text->data[text->size] = 0;
  }
}

void api_text_add(api_text *text, const char *string) {
  api_text_append(text, string, strlen(string));
}

/* Formats a second time only what the room does not hold. */
void api_text_printf(api_text *text, const char *format, ...) {
  va_list args, again;
  va_start(args, format);
  va_copy(again, args);
  const size_t room = text->failed ? 0 : text->capacity - text->size;
  int length = vsnprintf(room ? text->data + text->size : NULL, room, format, args);
  va_end(args);
  if (length < 0) {
    text->failed = 1;
  } else if ((size_t)length < room) {
    text->size += (size_t)length;
  } else if (reserve(text, (size_t)length)) {
    vsnprintf(text->data + text->size, (size_t)length + 1, format, again);
    text->size += (size_t)length;
  } else if (room) {
    text->data[text->size] = 0;
  }
  va_end(again);
}

/* Writes the comma before a value or key, unless the text is empty or ends in an opening bracket or a colon. */
static void separate(api_text *text) {
  char last = text->size ? text->data[text->size - 1] : '{';
  if (last != '{' && last != '[' && last != ':') {
    api_text_append(text, ",", 1);
  }
}

void api_json_open(api_text *text, char open) {
  separate(text);
  api_text_append(text, &open, 1);
}

void api_json_close(api_text *text, char close) {
  api_text_append(text, &close, 1);
}

/* Bytes that are not UTF-8 become U+FFFD: details quote requests, and truncation may split a character. */
static void escaped(api_text *text, const char *s) {
  const char *run = s;
  for (size_t n; *s; s += n) {
    unsigned char c = (unsigned char)*s;
    size_t whole = c < 0x80 ? 1 : orb_utf8_length((const unsigned char *)s, 4);
    n = whole ? whole : 1;
    if (whole && c >= 0x20 && c != '"' && c != '\\') {
      continue;
    }
    api_text_append(text, run, (size_t)(s - run));
    run = s + 1;
    if (!whole) {
      api_text_add(text, "\xef\xbf\xbd");
    } else if (c == '"' || c == '\\') {
      api_text_printf(text, "\\%c", c);
    } else if (c == '\n') {
      api_text_add(text, "\\n");
    } else {
      api_text_printf(text, "\\u%04x", c);
    }
  }
  api_text_append(text, run, (size_t)(s - run));
}

static void quoted(api_text *text, const char *s) {
  api_text_append(text, "\"", 1);
  escaped(text, s);
  api_text_append(text, "\"", 1);
}

void api_json_key(api_text *text, const char *name) {
  separate(text);
  quoted(text, name);
  api_text_append(text, ":", 1);
}

void api_json_string(api_text *text, const char *utf8) {
  separate(text);
  quoted(text, utf8);
}

/* Writes a number of at least this many digits in front of `end`; returns where it begins. */
static char *digits_before(char *end, uint64_t value, int least) {
  for (; value > 0 || least > 0; value /= 10, least--) {
    *--end = (char)('0' + value % 10);
  }
  return end;
}

static void add_integer(api_text *text, int64_t value) {
  char room[24], *const end = room + sizeof room;
  char *begin = digits_before(end, value < 0 ? 0 - (uint64_t)value : (uint64_t)value, 1);
  if (value < 0) {
    *--begin = '-';
  }
  api_text_append(text, begin, (size_t)(end - begin));
}

void api_json_number(api_text *text, double value) {
  separate(text);
  if (!isfinite(value)) {
    api_text_add(text, "null");
    return;
  }
  /* Fifteen digits hold such a number, so %.15g writes it without an exponent too. */
  if (fabs(value) < 1e15 && value == (double)(int64_t)value && !(value == 0 && signbit(value))) {
    add_integer(text, (int64_t)value);
    return;
  }
  char digits[40];
  for (int precision = 15; precision <= 17; precision++) {
    snprintf(digits, sizeof digits, "%.*g", precision, value);
    if (strtod(digits, NULL) == value) {
      break;
    }
  }
  api_text_add(text, digits);
}

void api_json_integer(api_text *text, int64_t value) {
  separate(text);
  add_integer(text, value);
}

void api_json_bool(api_text *text, int value) {
  separate(text);
  api_text_add(text, value ? "true" : "false");
}

void api_json_null(api_text *text) {
  separate(text);
  api_text_add(text, "null");
}

void api_json_raw(api_text *text, const char *json) {
  separate(text);
  api_text_add(text, json ? json : "null");
}

void api_json_member_string(api_text *text, const char *name, const char *utf8) {
  api_json_key(text, name);
  api_json_string(text, utf8);
}

/* DEL, the controls C1 and those of text in two directions (Unicode, UAX 9). Returns the code; 0: another character. */
static unsigned hidden_control(const unsigned char *s, size_t length) {
  unsigned code = s[0];
  if (length == 2) {
    code = (s[0] & 0x1fu) << 6 | (s[1] & 0x3fu);
  } else if (length == 3) {
    code = (s[0] & 0x0fu) << 12 | (s[1] & 0x3fu) << 6 | (s[2] & 0x3fu);
  }
  const int two_ways = code == 0x061c || code == 0x200e || code == 0x200f || (code >= 0x202a && code <= 0x202e) ||
                       (code >= 0x2066 && code <= 0x2069);
  return length < 4 && ((code >= 0x7f && code <= 0x9f) || two_ways) ? code : 0;
}

void api_json_member_output(api_text *text, const char *name, const char *bytes, size_t size) {
  api_json_key(text, name);
  api_text_append(text, "\"", 1);
  for (size_t at = 0, n; at < size; at += n) {
    const unsigned char *s = (const unsigned char *)bytes + at;
    const size_t whole = *s ? orb_utf8_length(s, size - at) : 0;
    const unsigned code = whole ? hidden_control(s, whole) : 0;
    char character[5] = "";
    n = whole ? whole : 1;
    memcpy(character, s, n);
    if (code) {
      api_text_printf(text, "\\u%04x", code);
    } else {
      escaped(text, whole ? character : "\xef\xbf\xbd");
    }
  }
  api_text_append(text, "\"", 1);
}

void api_json_member_number(api_text *text, const char *name, double value) {
  api_json_key(text, name);
  api_json_number(text, value);
}
void api_json_member_integer(api_text *text, const char *name, int64_t value) {
  api_json_key(text, name);
  api_json_integer(text, value);
}
void api_json_member_bool(api_text *text, const char *name, int value) {
  api_json_key(text, name);
  api_json_bool(text, value);
}
void api_json_member_raw(api_text *text, const char *name, const char *json) {
  api_json_key(text, name);
  api_json_raw(text, json);
}

/* Writes the date of a day since 1 January 1970 in front of `end`. Years begin in March here, so that a leap day is the
 * last one of its year; 400 of them have 146,097 days. (H. Hinnant, chrono-Compatible Low-Level Date Algorithms.) */
static char *date_before(char *end, uint64_t day) {
  const uint64_t since = day + 719468, cycle = since / 146097, of_cycle = since % 146097; /* from 1 March of year 0 */
  const uint64_t year = (of_cycle - of_cycle / 1460 + of_cycle / 36524 - of_cycle / 146096) / 365;
  const uint64_t of_year = of_cycle - (365 * year + year / 4 - year / 100);
  const uint64_t month = (5 * of_year + 2) / 153; /* 0: March */
  char *at = digits_before(end, of_year - (153 * month + 2) / 5 + 1, 2);
  *--at = '-';
  at = digits_before(at, month < 10 ? month + 3 : month - 9, 2);
  *--at = '-';
  return digits_before(at, 400 * cycle + year + (month >= 10), 4);
}

void api_json_member_instant(api_text *text, const char *name, int64_t unix_ms) {
  api_json_key(text, name);
  if (unix_ms <= 0) {
    api_json_null(text);
    return;
  }
  const uint64_t ms = (uint64_t)unix_ms, second = ms / 1000 % 86400;
  const uint64_t parts[] = {ms % 1000, second % 60, second / 60 % 60, second / 3600};
  static const char after[] = {'Z', '.', ':', ':'}, widths[] = {3, 2, 2, 2};
  char stamp[40], *const end = stamp + sizeof stamp, *at = end;
  *--at = '"';
  for (int i = 0; i < 4; i++) {
    *--at = after[i];
    at = digits_before(at, parts[i], widths[i]);
  }
  *--at = 'T';
  at = date_before(at, ms / 86400000);
  *--at = '"';
  api_text_append(text, at, (size_t)(end - at));
}
