#include "api/text.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

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

void api_text_printf(api_text *text, const char *format, ...) {
  va_list args, again;
  va_start(args, format);
  va_copy(again, args);
  int length = vsnprintf(NULL, 0, format, args);
  va_end(args);
  if (length < 0) {
    text->failed = 1;
  } else if (reserve(text, (size_t)length)) {
    vsnprintf(text->data + text->size, (size_t)length + 1, format, again);
    text->size += (size_t)length;
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
static void quoted(api_text *text, const char *s) {
  api_text_append(text, "\"", 1);
  const char *run = s;
  for (size_t n; *s; s += n) {
    unsigned char c = (unsigned char)*s;
    size_t whole = orb_utf8_length((const unsigned char *)s, 4);
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

void api_json_number(api_text *text, double value) {
  separate(text);
  if (!isfinite(value)) {
    api_text_add(text, "null");
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
  api_text_printf(text, "%lld", (long long)value);
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

void api_json_member_instant(api_text *text, const char *name, int64_t unix_ms) {
  api_json_key(text, name);
  if (unix_ms <= 0) {
    api_json_null(text);
    return;
  }
  time_t seconds = (time_t)(unix_ms / 1000);
  struct tm utc;
  char stamp[48];
  gmtime_r(&seconds, &utc);
  size_t n = strftime(stamp, sizeof stamp, "%Y-%m-%dT%H:%M:%S", &utc);
  snprintf(stamp + n, sizeof stamp - n, ".%03dZ", (int)(unix_ms % 1000));
  api_json_string(text, stamp);
}
