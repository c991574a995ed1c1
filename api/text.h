/* A growing text, and a JSON writer that appends to it.
 *
 * The writer inserts commas itself by looking at the last byte, so calls read like the document. `failed` stays set
 * once memory has run out: check it once, at the end. Numbers are the shortest decimals that read back as the same
 * double; NaN and infinities become null.
 */
#ifndef ORB_API_TEXT_H
#define ORB_API_TEXT_H

#include <stddef.h>
#include <stdint.h>

/* Lets the compiler check the arguments of a function that formats like printf(). text, first: the numbers of the
 * format and of its first argument among the parameters, from 1. */
#if defined(__GNUC__)
#define API_PRINTF(text, first) __attribute__((format(printf, text, first)))
#else
#define API_PRINTF(text, first)
#endif

typedef struct api_text {
  char *data; /* ends in a NUL that `size` does not count; NULL until something is appended */
  size_t size, capacity;
  int failed;
} api_text;

void api_text_free(api_text *text);
void api_text_append(api_text *text, const char *bytes, size_t size);
void api_text_add(api_text *text, const char *string);
void api_text_printf(api_text *text, const char *format, ...) API_PRINTF(2, 3);

/* JSON values. `open` is '{' or '[', `close` is '}' or ']'. */
void api_json_open(api_text *text, char open);
void api_json_close(api_text *text, char close);
void api_json_key(api_text *text, const char *name);
void api_json_string(api_text *text, const char *utf8);
void api_json_number(api_text *text, double value);
void api_json_integer(api_text *text, int64_t value);
void api_json_bool(api_text *text, int value);
void api_json_null(api_text *text);
void api_json_raw(api_text *text, const char *json); /* a complete value; NULL writes null */

/* JSON members. */
void api_json_member_string(api_text *text, const char *name, const char *utf8);
/* Bytes of any kind, for people who look at them in a terminal: what moves its cursor, or the order of its text, is
 * escaped. NUL becomes U+FFFD. */
void api_json_member_output(api_text *text, const char *name, const char *bytes, size_t size);
void api_json_member_number(api_text *text, const char *name, double value);
void api_json_member_integer(api_text *text, const char *name, int64_t value);
void api_json_member_bool(api_text *text, const char *name, int value);
void api_json_member_raw(api_text *text, const char *name, const char *json);
/* Writes milliseconds since 1970 as an RFC 3339 string in UTC, and 0 as null. */
void api_json_member_instant(api_text *text, const char *name, int64_t unix_ms);

#endif
