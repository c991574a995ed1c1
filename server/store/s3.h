/* Requests to a bucket in S3, signed, by libcurl. Any thread may call any function. */
#ifndef ORB_STORE_S3_H
#define ORB_STORE_S3_H

#include <stdint.h>

#include "net/s3_url.h"
#include "store/s3_sign.h"

enum { S3_WHY = 200, S3_TAG = 80 };

typedef struct s3 s3;

typedef struct s3_options {
  s3_place place;
  s3_keys keys;
  const char *authorities; /* PEM file; "": those of the system */
} s3_options;

typedef struct s3_request {
  const char *method; /* GET, HEAD, PUT, POST, DELETE */
  const char *key;    /* without the prefix; NULL: the bucket itself */
  const char *query;  /* sorted and encoded; NULL: none */
  const char *body;   /* from memory, or NULL */
  int from;           /* from a file, if `body` is NULL and size is not 0 */
  uint64_t offset, size;
  const char *sha;  /* SHA-256 of the body, in hexadecimal digits; NULL: it has none */
  const char *meta; /* kept beside the object as x-amz-meta-sha256; NULL: nothing */
  int to;           /* a file that takes the body of an answer 2xx from its start; −1: `text` takes it */
  int tries;        /* at most; ≥ 1 */
  /* Not 0: it is signed as of this time of s3_clock(), and S3 refuses it after so many seconds, however late it comes.
   */
  int64_t signed_at;
  long seconds;
} s3_request;

typedef struct s3_answer {
  int status;       /* 0: no complete answer, see `why` */
  char *text;       /* the body, of malloc(); NULL: none */
  uint64_t size;    /* of the object: its Content-Length */
  char meta[65];    /* x-amz-meta-sha256; "": none */
  char tag[S3_TAG]; /* ETag */
  int64_t modified; /* Last-Modified, a Unix time; −1: not said */
  char why[S3_WHY]; /* of a failure, the end of a sentence */
} s3_answer;

/* NULL: out of memory, or libcurl cannot be initialised. */
s3 *s3_open(const s3_options *options);
void s3_close(s3 *store);
/* For the requests from now on. */
void s3_use_keys(s3 *store, const s3_keys *keys);
/* Sends a request, again after 5xx, 429, a lost connection or half an answer, after pauses that grow and are drawn at
 * random. The caller frees out->text. */
void s3_send(s3 *store, const s3_request *request, s3_answer *out);
/* What time it is for S3, a Unix time, as far as its last answer says: never ahead of S3, but behind it by the time
 * that an answer took, and by what this process did not run. */
int64_t s3_clock(s3 *store);
/* The pause after so many tries before, from 0. */
void s3_pause(int tried);
/* A URL that lets anyone GET an object for so many seconds. more: see s3_presign(). 0: it does not fit. */
int s3_link(s3 *store, const char *key, long seconds, const char *more, char *out, size_t size);

/* The text of an XML element, after *at, which then is behind it; with the five entities decoded. 0: there is none, or
 * it does not fit. */
int s3_element(const char **at, const char *name, char *out, size_t size);

#endif
