#include "deliver/sign.h"

#include <inttypes.h>
#include <sodium.h>
#include <stdio.h>
#include <string.h>

int webhook_sign(const char *secret, const char *id, int64_t timestamp, const char *body, size_t size,
                 char out[WEBHOOK_SIGNATURE]) {
  static const char prefix[] = "whsec_";
  unsigned char key[64], mac[crypto_auth_hmacsha256_BYTES];
  char head[128];
  size_t key_size = 0, skip = sizeof prefix - 1;
  if (strncmp(secret, prefix, skip) != 0 ||
      sodium_base642bin(key, sizeof key, secret + skip, strlen(secret + skip), NULL, &key_size, NULL,
                        sodium_base64_VARIANT_ORIGINAL) != 0) {
    return 0;
  }
  int n = snprintf(head, sizeof head, "%s.%" PRId64 ".", id, timestamp);
  crypto_auth_hmacsha256_state hmac;
  crypto_auth_hmacsha256_init(&hmac, key, key_size);
  crypto_auth_hmacsha256_update(&hmac, (const unsigned char *)head, (unsigned long long)n);
  crypto_auth_hmacsha256_update(&hmac, (const unsigned char *)body, size);
  crypto_auth_hmacsha256_final(&hmac, mac);
  sodium_memzero(key, sizeof key);
  sodium_memzero(&hmac, sizeof hmac);
  memcpy(out, "v1,", 4);
  sodium_bin2base64(out + 3, WEBHOOK_SIGNATURE - 3, mac, sizeof mac, sodium_base64_VARIANT_ORIGINAL);
  return 1;
}
