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
  /* Not 0: the URL is signed with this time of s3_clock(), and S3 refuses the request if it comes more than so many
   * seconds later. */
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
/* Signs the requests from now on with these keys. */
void s3_use_keys(s3 *store, const s3_keys *keys);
/* Sends a request, and sends it again after 5xx, 429, a lost connection or half an answer. It pauses before each
 * further try: see s3_pause(). Requests are signed with the time of s3_clock(). If S3 refuses one with 403 and its
 * answer shows that this time was wrong, s3_send() signs and sends it again. The caller frees out->text. */
void s3_send(s3 *store, const s3_request *request, s3_answer *out);
/* What time it is for S3, a Unix time, counted on from the date of its last answer; before the first answer, the
 * time of this machine. After an answer it is never ahead of S3. It is behind by the time that passed until this
 * process had the answer, and by the time that the machine has slept since. */
int64_t s3_clock(s3 *store);
/* Pauses after try number `tried`, from 0. The pause is drawn at random, so that daemons do not try in step; its mean
 * doubles with each try. */
void s3_pause(int tried);
/* A URL that lets anyone GET an object for so many seconds. more: see s3_presign(). 0: it does not fit. */
int s3_link(s3 *store, const char *key, long seconds, const char *more, char *out, size_t size);

/* The text of the first XML element of this name after *at; moves *at behind it. Decodes the five entities of XML, and
 * &#34;. 0: there is none, or it does not fit. */
int s3_element(const char **at, const char *name, char *out, size_t size);

#endif
