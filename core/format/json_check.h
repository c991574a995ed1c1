/* Tells a JSON text that is not valid from a parser that ran out of memory. */
#ifndef ORB_FORMAT_JSON_CHECK_H
#define ORB_FORMAT_JSON_CHECK_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Whether the text begins with a value as in RFC 8259 that nests at most 1,000 deep and has no number of more than 63
 * characters. cJSON reads all of these, so when it refuses one it has run out of memory. O(size), no allocation. */
int orb_json_begins(const char *text, size_t size);

#ifdef __cplusplus
}
#endif
#endif
