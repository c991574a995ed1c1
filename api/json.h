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

/* Whether a text is an object of at most `most` values, without names that are escaped or repeat at its top level.
 * Takes no memory. bare: the text is the members of the object without its braces, at least one. O(n). */
enum { API_JSON_NAMES = 64 };
int api_json_is_object(const char *text, size_t size, int bare, size_t most);

/* Parts of a text of valid JSON that ends in a NUL, for those who need few of its values. */
typedef struct api_json_span {
  const char *at, *end;
} api_json_span;
const char *api_json_blanks(const char *at); /* what follows blanks */
const char *api_json_after(const char *at);  /* the end of the value that begins here */
/* The member that begins at *at, with its name in quotes; moves to the next one. 0: there is none. */
int api_json_next_member(const char **at, api_json_span *name, api_json_span *value);

/* True for well-formed UTF-8 without NUL. */
int api_utf8_valid(const char *bytes, size_t size);

#endif
