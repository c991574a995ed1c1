/* Decodes the content coding of a request's body while it arrives.
 *
 * gzip (RFC 1952, also several members in sequence) and zstd (RFC 8878, also several frames; windows of at most 8 MB,
 * the limit that RFC 9659 sets for senders). Input and output are streamed: a decoder holds only the coding's window,
 * so the caller can stop as soon as the output is too large.
 */
#ifndef ORB_HTTP_DECODE_H
#define ORB_HTTP_DECODE_H

#include <stddef.h>

typedef enum coding { CODING_UNKNOWN = -1, CODING_NONE, CODING_GZIP, CODING_ZSTD } coding;

/* The coding that a Content-Encoding header names (NULL: no header). A list of codings is CODING_UNKNOWN. */
coding coding_of(const char *header);

typedef struct decoder decoder;
decoder *decoder_create(coding which); /* NULL: out of memory */
void decoder_free(decoder *d);
/* Bytes that it holds now. */
size_t decoder_memory(const decoder *d);

typedef enum decode_result {
  DECODE_OK,
  DECODE_STOPPED,   /* the sink returned 0 */
  DECODE_BROKEN,    /* the bytes are not valid in this coding */
  DECODE_WINDOW,    /* a zstd frame needs a window above 8 MB */
  DECODE_NO_MEMORY, /* malloc() failed */
} decode_result;
typedef int (*decode_sink)(void *user, const char *bytes, size_t size); /* 0: stop */

/* Decodes all of the input and passes the output to the sink in pieces. After any result other than DECODE_OK, only
 * decoder_free() may be called. */
decode_result decoder_feed(decoder *d, const char *bytes, size_t size, decode_sink sink, void *user);
/* Whether the input so far ends at the end of a member or frame. */
int decoder_complete(const decoder *d);

#endif
