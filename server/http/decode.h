/* Undoing the content coding of a request's body, as it comes in.
 *
 * gzip (RFC 1952, also several members one after another) and zstd (RFC 8878, several frames; windows of at most 8 MB,
 * which is what RFC 9659 lets senders use). Input and output are streamed: what is held is the coding's window and no
 * more, so the caller can stop as soon as it has seen too much.
 */
#ifndef ORB_HTTP_DECODE_H
#define ORB_HTTP_DECODE_H

#include <stddef.h>

typedef enum coding { CODING_UNKNOWN = -1, CODING_NONE, CODING_GZIP, CODING_ZSTD } coding;

/* Of a Content-Encoding header (NULL: none). Several codings on top of each other are unknown. */
coding coding_of(const char *header);

typedef struct decoder decoder;
decoder *decoder_create(coding which); /* NULL: no memory */
void decoder_free(decoder *d);
/* What it holds now, in bytes. */
size_t decoder_memory(const decoder *d);

typedef enum decode_result {
  DECODE_OK,
  DECODE_STOPPED,   /* the sink wants no more */
  DECODE_BROKEN,    /* the bytes are not of this coding */
  DECODE_WINDOW,    /* a zstd frame that needs a window above 8 MB */
  DECODE_NO_MEMORY, /* malloc() failed */
} decode_result;
typedef int (*decode_sink)(void *user, const char *bytes, size_t size); /* 0: stop */

/* Decodes all of it, giving the output to the sink in pieces. After anything but DECODE_OK the decoder is done for. */
decode_result decoder_feed(decoder *d, const char *bytes, size_t size, decode_sink sink, void *user);
/* Whether what was fed is whole: at least one member or frame, and none cut short. */
int decoder_complete(const decoder *d);

#endif
