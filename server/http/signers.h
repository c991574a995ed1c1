/* The signing keys of the catalogue in memory. A key command or SIGHUP reloads them while requests use them. A request
 * holds a reference to its key. When a key is removed, it is revoked: its waiting requests end.
 *
 * A signed URL ends in &key=NAME&expires=UNIX_SECONDS&signature=HEX, in this order. The signature is the HMAC-SHA256 of
 * the path, "?" and the query as sent, up to and without "&signature=", with the secret's 64 digits as the key.
 */
#ifndef ORB_HTTP_SIGNERS_H
#define ORB_HTTP_SIGNERS_H

#include "store/keys.h"

typedef struct signer {
  key_row row;            /* name, tenant, origins and created never change; the rest under the lock of signers */
  int64_t counted, since; /* requests of the day `row.day`, and those not yet in the catalogue; under the lock */
  int revoked, refs;      /* __atomic */
} signer;

typedef struct signers signers;
signers *signers_open(catalogue *cat); /* NULL if the keys cannot be read */
void signers_close(signers *all);
/* Reads the keys again. 0 on failure: known keys stay as they are. */
int signers_reload(signers *all);
/* Stores how many requests each key has made since the last call. Does not wait for the commit. */
void signers_store_use(signers *all);
void signer_release(signer *who);
int signer_revoked(const signer *who); /* NULL: no */

/* A target that ends in a signature. */
typedef struct signed_target {
  char name[KEY_NAME];
  int64_t expires;
  unsigned char signature[32];
  size_t size; /* bytes of the target that are signed */
} signed_target;
/* Whether the target has a parameter `signature`: 1 with *out; −1: it has one, but does not end as it must; 0: none. */
int signature_read(const char *target, signed_target *out);

typedef enum sign_result { SIGN_OK, SIGN_BAD, SIGN_EXPIRED, SIGN_TOO_MANY } sign_result;
/* Checks a signature in constant time and counts the request. now: Unix time in seconds. With SIGN_OK, *out is the key
 * with a reference; with SIGN_TOO_MANY, *limit is its limit of requests a day. */
sign_result signers_check(signers *all, const char *target, const signed_target *parts, int64_t now, signer **out,
                          int64_t *limit);

#endif
