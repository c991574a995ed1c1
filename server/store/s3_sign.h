/* Signatures of requests to S3: AWS Signature Version 4.
 *
 * libcurl's own (CURLOPT_AWS_SIGV4) is not enough: it signs no URLs, 7.88 leaves queries as they are and does not sign
 * the hash of a body that is sent from a file, and a key with a colon cannot be given to it.
 */
#ifndef ORB_STORE_S3_SIGN_H
#define ORB_STORE_S3_SIGN_H

#include <stddef.h>

enum { S3_DATE = 17, S3_SIGNATURE = 65, S3_KEY = 160, S3_TOKEN = 4096 };

typedef struct s3_keys {
  char access[S3_KEY], secret[S3_KEY];
  char token[S3_TOKEN]; /* of temporary keys; "": none */
} s3_keys;

/* A request in its canonical form. */
typedef struct s3_canonical {
  const char *method, *path;
  const char *query;   /* sorted and encoded */
  const char *headers; /* "name:value\n" each, in lower case, sorted */
  const char *names;   /* of these headers, with semicolons between */
  const char *payload; /* SHA-256 of the body in hexadecimal digits, or UNSIGNED-PAYLOAD */
} s3_canonical;

/* Writes a Unix time as YYYYMMDDTHHMMSSZ. */
void s3_date(long long seconds, char out[S3_DATE]);
/* date: of s3_date(). service: s3, except in tests. */
void s3_sign(const s3_keys *keys, const char *region, const char *service, const char date[S3_DATE],
             const s3_canonical *request, char out[S3_SIGNATURE]);
/* Encodes a value for a query. 0: it does not fit. */
int s3_encode(const char *text, char *out, size_t size);

/* A URL that carries its signature, and is valid for so many seconds from a date. */
typedef struct s3_presigned {
  const char *method, *region, *host, *path;
  const char *date; /* of s3_date() */
  long seconds;
  const char *more; /* parameters to be sent and signed, sorted and encoded, all after X-Amz-…; "": none */
} s3_presigned;
/* Its query, without the question mark. 0: it does not fit. */
int s3_presign(const s3_keys *keys, const s3_presigned *url, char *out, size_t size);

#endif
