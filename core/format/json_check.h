/* Tells a broken JSON text from a parser without memory. */
#ifndef ORB_FORMAT_JSON_CHECK_H
#define ORB_FORMAT_JSON_CHECK_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Whether the text begins with a value by RFC 8259 that nests at most 1,000 deep and has no number of more than 63
 * characters. cJSON reads all of these, so that it can refuse them only for want of memory. Linear, no memory. */
int orb_json_begins(const char *text, size_t size);

#ifdef __cplusplus
}
#endif
#endif
