/* Strict JSON over cJSON.
 *
 * A scanner checks the bytes before cJSON sees them: the exact grammar of RFC 8259, valid UTF-8, no NUL (not even as
 * \u0000), paired surrogates, finite numbers, a bounded depth, and nothing after the value. No object may have the same
 * name twice.
 */
#ifndef ORB_API_JSON_H
#define ORB_API_JSON_H

#include <cjson/cJSON.h>
#include <stddef.h>

enum { API_JSON_DEPTH = 32 };

/* Why the bytes were refused, and where. */
typedef struct api_json_error {
  const char *why; /* a literal in plain words; NULL: out of memory */
  size_t offset;
} api_json_error;

/* Returns the value, which the caller frees with cJSON_Delete(), or NULL with *error filled. O(n log n). */
cJSON *api_json_parse(const char *bytes, size_t size, api_json_error *error);

/* The number of values in these bytes, as api_json_parse() takes them; 0: they are not JSON. Takes no memory, and does
 * not see names that repeat. O(n). */
size_t api_json_count(const char *bytes, size_t size);

/* True for well-formed UTF-8 without NUL. */
int api_utf8_valid(const char *bytes, size_t size);

#endif
