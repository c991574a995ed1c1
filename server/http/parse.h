/* What the texts of a request say: ranges, waits, pages, tags, the query of an upload. None of it needs a connection,
 * so tests can feed it anything. Texts may be NULL where the request has none.
 */
#ifndef ORB_HTTP_PARSE_H
#define ORB_HTTP_PARSE_H

#include <stddef.h>
#include <stdint.h>

#include "api/mesh_codec.h"

/* A Range header for a file of `size` bytes. −1: outside the file; 0: not a range to be used, the whole file is the
 * answer (RFC 9110, section 14.2); 1: [*first, *first + *length). */
int parse_range(const char *text, uint64_t size, uint64_t *first, uint64_t *length);

/* Whether a list of entity tags (If-Match, If-None-Match) names this one. Weak tags match as strong ones do. */
int parse_tag_matches(const char *list, const char *tag);
/* Likewise for If-Match, where a weak tag matches nothing (RFC 9110 section 13.1.1). */
int parse_tag_matches_strong(const char *list, const char *tag);
/* The path of a request's target, which may be in absolute form (RFC 9112 section 3.2.2). */
const char *parse_target(const char *url);

/* ?wait=SECONDS in ms, at most a minute; 0: not to wait; −1: it is no number. */
int64_t parse_wait_ms(const char *query);
/* Likewise the preference wait=SECONDS of a Prefer header (RFC 7240); 0 also where there is none or it is not
 * understood. */
int64_t parse_preferred_ms(const char *prefer);

/* The urgency that a Priority header asks for (RFC 9218): 0, the most urgent, to 7; 3 where it says nothing. */
int parse_urgency(const char *text);

/* The number of the last event that a caller has seen (Last-Event-ID); 0: none. */
int64_t parse_event_number(const char *text);

/* limit and page_token of a list; *sealed is 0 without one. 1, or 0 with *why, a sentence. */
enum { PAGE_MOST = 1000, PAGE_STANDARD = 100 };
int parse_page(const char *limit_text, const char *token, int *limit, uint64_t *sealed, const char **why);
extern const char PARSE_PAGE_TOKEN[]; /* why another is none */

/* The query of an upload. 1, or 0 with the problem. */
typedef struct upload_query {
  char name[ORB_NAME_MAX], repair[API_REPAIR_TEXT];
  unsigned flags;
  orb_format hint;
} upload_query;
int parse_upload(const char *name, const char *repair, const char *format, upload_query *out, api_problem *problem);

/* W3C Trace Context, version 00. Others are passed over. */
enum { TRACE_SIZE = 56 };
int parse_trace(const char *text, char out[TRACE_SIZE]);

#endif
