/* Parsers for the texts of a request: ranges, waits, pages, tags. They need no connection, so tests can call them
 * directly. A text is NULL if the request has none.
 */
#ifndef ORB_HTTP_PARSE_H
#define ORB_HTTP_PARSE_H

#include <stddef.h>
#include <stdint.h>

#include "trace/trace.h"

/* A Range header for a file of `size` bytes. −1: outside the file; 0: ignored, respond with the whole file (RFC 9110
 * section 14.2); 1: [*first, *first + *length). */
int parse_range(const char *text, uint64_t size, uint64_t *first, uint64_t *length);

/* Whether a list of entity tags (If-Match, If-None-Match) names this one. Weak tags match as strong ones do. */
int parse_tag_matches(const char *list, const char *tag);
/* Likewise for If-Match, where a weak tag matches nothing (RFC 9110 section 13.1.1). */
int parse_tag_matches_strong(const char *list, const char *tag);
/* The path of a request's target, which may be in absolute form (RFC 9112 section 3.2.2). */
const char *parse_target(const char *url);

/* ?wait=SECONDS in ms, at most a minute; 0: do not wait; −1: not a number. */
int64_t parse_wait_ms(const char *query);
/* The preference wait=SECONDS of a Prefer header (RFC 7240) in ms; 0 if it is absent or malformed. */
int64_t parse_preferred_ms(const char *prefer);

/* The urgency in a Priority header (RFC 9218), from 0, the most urgent, to 7; 3 by default. */
int parse_urgency(const char *text);

/* The number of the last event that the client has seen (Last-Event-ID); 0: none. */
int64_t parse_event_number(const char *text);

/* limit and page_token of a list; *sealed is 0 without a token. 1, or 0 with a sentence in *why. */
enum { PAGE_MOST = 1000, PAGE_STANDARD = 100 };
int parse_page(const char *limit_text, const char *token, int *limit, uint64_t *sealed, const char **why);
extern const char PARSE_PAGE_TOKEN[]; /* the sentence for an invalid page token */

/* Whether a text can begin an id: 1 to 64 lower-case hexadecimal digits. */
int parse_id_prefix(const char *text);

/* A traceparent of W3C Trace Context, version 00. 0 for any other text. */
enum { TRACE_SIZE = TRACE_PARENT };
int parse_trace(const char *text, char out[TRACE_SIZE]);

#endif
