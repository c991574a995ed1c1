#include "store/s3_sign.h"

#include <sodium.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

enum { DAY = 8, MAC = crypto_auth_hmacsha256_BYTES };

void s3_date(long long seconds, char out[S3_DATE]) {
  time_t at = (time_t)seconds;
  struct tm parts;
  gmtime_r(&at, &parts);
  strftime(out, S3_DATE, "%Y%m%dT%H%M%SZ", &parts);
}

static void mac(const unsigned char *key, size_t size, const char *text, unsigned char out[MAC]) {
  crypto_auth_hmacsha256_state state;
  crypto_auth_hmacsha256_init(&state, key, size);
  crypto_auth_hmacsha256_update(&state, (const unsigned char *)text, strlen(text));
  crypto_auth_hmacsha256_final(&state, out);
}

/* Hashes texts one after the other. */
static void hash(const char *const *texts, size_t count, char out[S3_SIGNATURE]) {
  unsigned char digest[crypto_hash_sha256_BYTES];
  crypto_hash_sha256_state state;
  crypto_hash_sha256_init(&state);
  for (size_t i = 0; i < count; i++) {
    crypto_hash_sha256_update(&state, (const unsigned char *)texts[i], strlen(texts[i]));
  }
  crypto_hash_sha256_final(&state, digest);
  sodium_bin2hex(out, S3_SIGNATURE, digest, sizeof digest);
}

void s3_sign(const s3_keys *keys, const char *region, const char *service, const char date[S3_DATE],
             const s3_canonical *r, char out[S3_SIGNATURE]) {
  const char *texts[] = {r->method, "\n", r->path, "\n", r->query, "\n", r->headers, "\n", r->names, "\n", r->payload};
  char hashed[S3_SIGNATURE], day[DAY + 1], text[512];
  unsigned char key[MAC];
  char secret[S3_KEY + 4];
  hash(texts, sizeof texts / sizeof texts[0], hashed);
  snprintf(day, sizeof day, "%.8s", date);
  snprintf(text, sizeof text, "AWS4-HMAC-SHA256\n%s\n%s/%s/%s/aws4_request\n%s", date, day, region, service, hashed);
  int n = snprintf(secret, sizeof secret, "AWS4%s", keys->secret);
  mac((const unsigned char *)secret, (size_t)n, day, key);
  mac(key, MAC, region, key);
  mac(key, MAC, service, key);
  mac(key, MAC, "aws4_request", key);
  mac(key, MAC, text, key);
  sodium_bin2hex(out, S3_SIGNATURE, key, MAC);
  sodium_memzero(key, sizeof key);
  sodium_memzero(secret, sizeof secret);
}

int s3_encode(const char *text, char *out, size_t size) {
  static const char plain[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_.~";
  size_t at = 0;
  for (; *text; text++) {
    int n = strchr(plain, *text) ? 1 : 3;
    if (at + (size_t)n >= size) {
      return 0;
    }
    if (n == 1) {
      out[at] = *text;
    } else {
      snprintf(out + at, size - at, "%%%02X", (unsigned)(unsigned char)*text);
    }
    at += (size_t)n;
  }
  if (at >= size) {
    return 0;
  }
  out[at] = 0;
  return 1;
}

int s3_presign(const s3_keys *keys, const s3_presigned *u, char *out, size_t size) {
  char credential[2 * S3_KEY], encoded[3 * sizeof credential], token[2 * S3_TOKEN], headers[512];
  char signature[S3_SIGNATURE];
  snprintf(credential, sizeof credential, "%s/%.8s/%s/s3/aws4_request", keys->access, u->date, u->region);
  snprintf(headers, sizeof headers, "host:%s\n", u->host);
  if (!s3_encode(credential, encoded, sizeof encoded) || !s3_encode(keys->token, token, sizeof token)) {
    return 0;
  }
  int n = snprintf(out, size,
                   "X-Amz-Algorithm=AWS4-HMAC-SHA256&X-Amz-Credential=%s&X-Amz-Date=%s&X-Amz-Expires=%ld%s%s"
                   "&X-Amz-SignedHeaders=host%s%s",
                   encoded, u->date, u->seconds, *token ? "&X-Amz-Security-Token=" : "", token, *u->more ? "&" : "",
                   u->more);
  if (n < 0 || (size_t)n >= size) {
    return 0;
  }
  const s3_canonical request = {u->method, u->path, out, headers, "host", "UNSIGNED-PAYLOAD"};
  s3_sign(keys, u->region, "s3", u->date, &request, signature);
  int m = snprintf(out + n, size - (size_t)n, "&X-Amz-Signature=%s", signature);
  return m > 0 && (size_t)(n + m) < size;
}
