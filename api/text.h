/* A growing text and a writer of JSON into it.
 *
 * The writer puts commas by itself, looking at the last byte, so calls read like the document. Running out of memory
 * is sticky: look at `failed` once, at the end. Numbers are the shortest decimals that read back as the same double;
 * NaN and infinities become null.
 */
#ifndef ORB_API_TEXT_H
#define ORB_API_TEXT_H

#include <stddef.h>
#include <stdint.h>

#include "orbmorph/status.h"

typedef struct orb_text {
  char *data; /* ends in a NUL that `size` does not count; NULL while empty */
  size_t size, capacity;
  int failed;
} orb_text;

void orb_text_free(orb_text *text);
void orb_text_append(orb_text *text, const char *bytes, size_t size);
void orb_text_add(orb_text *text, const char *string);
void orb_text_printf(orb_text *text, const char *format, ...) ORB_PRINTF(2, 3);

/* JSON: values. `open` is '{' or '[', `close` '}' or ']'. */
void orb_json_open(orb_text *text, char open);
void orb_json_close(orb_text *text, char close);
void orb_json_key(orb_text *text, const char *name);
void orb_json_string(orb_text *text, const char *utf8);
void orb_json_number(orb_text *text, double value);
void orb_json_integer(orb_text *text, int64_t value);
void orb_json_bool(orb_text *text, int value);
void orb_json_null(orb_text *text);
void orb_json_raw(orb_text *text, const char *json); /* a whole value; NULL: null */

/* JSON: members. */
void orb_json_member_string(orb_text *text, const char *name, const char *utf8);
void orb_json_member_number(orb_text *text, const char *name, double value);
void orb_json_member_integer(orb_text *text, const char *name, int64_t value);
void orb_json_member_bool(orb_text *text, const char *name, int value);
void orb_json_member_raw(orb_text *text, const char *name, const char *json);
/* Milliseconds since 1970 as an RFC 3339 string in UTC; 0 as null. */
void orb_json_member_instant(orb_text *text, const char *name, int64_t unix_ms);

#endif
