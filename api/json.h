/* Strict JSON over cJSON.
 *
 * The bytes are checked by a scanner of our own before cJSON sees them: the grammar of RFC 8259 to the letter, valid
 * UTF-8, no NUL (also not as \u0000), paired surrogates, finite numbers, a bounded depth, nothing after the value, no
 * name twice in an object.
 */
#ifndef ORB_API_JSON_H
#define ORB_API_JSON_H

#include <cjson/cJSON.h>
#include <stddef.h>

enum { API_JSON_DEPTH = 32, API_JSON_BYTES = 1 << 20 };

/* Why bytes were refused, and where. */
typedef struct api_json_error {
  const char *why; /* a literal, plain words; NULL: out of memory */
  size_t offset;
} api_json_error;

/* The value, to be given to cJSON_Delete(); NULL with *error filled. O(n log n). */
cJSON *api_json_parse(const char *bytes, size_t size, api_json_error *error);

/* True for well-formed UTF-8 without NUL. */
int api_utf8_valid(const char *bytes, size_t size);

#endif
