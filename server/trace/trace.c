#include "trace/trace.h"

#include <sodium.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "api/text.h"
#include "trace/send.h"

/* Where the parts of a traceparent begin, and how long they are. */
enum { TRACE_AT = 3, TRACE_DIGITS = 32, SPAN_AT = 36, SPAN_DIGITS = 16, FLAGS_AT = 53 };

int64_t trace_now_us(void) {
  struct timespec now;
  clock_gettime(CLOCK_REALTIME, &now);
  return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}

/* All zeroes is not a valid value; it comes once in 2^64 times. */
static void random_digits(char *out, size_t digits) {
  unsigned char bytes[TRACE_DIGITS / 2];
  char text[TRACE_DIGITS + 1];
  randombytes_buf(bytes, digits / 2);
  bytes[0] |= 1;
  sodium_bin2hex(text, sizeof text, bytes, digits / 2);
  memcpy(out, text, digits);
}

static int is_recorded(const char *parent) {
  return strlen(parent) == TRACE_PARENT - 1 && strchr("13579bdf", parent[FLAGS_AT + 1]);
}

void trace_begin_below(const char *parent, char self[TRACE_PARENT]) {
  self[0] = 0;
  if (trace_is_on() && is_recorded(parent)) {
    memcpy(self, parent, TRACE_PARENT);
    random_digits(self + SPAN_AT, SPAN_DIGITS);
  }
}

void trace_begin(const char *parent, char self[TRACE_PARENT]) {
  static const char first[] = "00-00000000000000000000000000000000-0000000000000000-01";
  char fresh[sizeof first];
  if (!parent[0] && trace_is_on()) {
    memcpy(fresh, first, sizeof first);
    random_digits(fresh + TRACE_AT, TRACE_DIGITS);
    parent = fresh;
  }
  trace_begin_below(parent, self);
}

static void member_digits(api_text *json, const char *name, const char *digits, int count) {
  char text[TRACE_PARENT];
  snprintf(text, sizeof text, "%.*s", count, digits);
  api_json_member_string(json, name, text);
}

/* 64-bit integers are strings in the JSON of protocol buffers. */
static void member_number(api_text *json, const char *name, int64_t value) {
  char text[24];
  snprintf(text, sizeof text, "%lld", (long long)value);
  api_json_member_string(json, name, text);
}

static void write_attributes(api_text *json, const trace_attribute *list) {
  api_json_key(json, "attributes");
  api_json_open(json, '[');
  for (int i = 0; i < TRACE_ATTRIBUTES && list[i].key; i++) {
    api_json_open(json, '{');
    api_json_member_string(json, "key", list[i].key);
    api_json_key(json, "value");
    api_json_open(json, '{');
    if (list[i].text) {
      api_json_member_string(json, "stringValue", list[i].text);
    } else {
      member_number(json, "intValue", list[i].number);
    }
    api_json_close(json, '}');
    api_json_close(json, '}');
  }
  api_json_close(json, ']');
}

void trace_end(const trace_span *span) {
  enum { ERROR = 2, NANOSECONDS = 1000 };
  api_text json = {0};
  if (!span->self[0] || !trace_is_on()) {
    return;
  }
  const int64_t end = span->end_us > span->start_us ? span->end_us : span->start_us;
  api_json_open(&json, '{');
  member_digits(&json, "traceId", span->self + TRACE_AT, TRACE_DIGITS);
  member_digits(&json, "spanId", span->self + SPAN_AT, SPAN_DIGITS);
  if (span->parent[0]) {
    member_digits(&json, "parentSpanId", span->parent + SPAN_AT, SPAN_DIGITS);
  }
  api_json_member_string(&json, "name", span->name);
  api_json_member_integer(&json, "kind", (int64_t)span->kind);
  member_number(&json, "startTimeUnixNano", span->start_us * NANOSECONDS);
  member_number(&json, "endTimeUnixNano", end * NANOSECONDS);
  write_attributes(&json, span->attributes);
  if (span->error) {
    api_json_key(&json, "status");
    api_json_open(&json, '{');
    api_json_member_integer(&json, "code", ERROR);
    api_json_member_string(&json, "message", span->error);
    api_json_close(&json, '}');
  }
  api_json_close(&json, '}');
  if (json.failed) {
    api_text_free(&json);
  }
  trace_send(json.data);
}
