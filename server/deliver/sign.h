/* Signatures of Standard Webhooks: "v1," and the base64 of the HMAC-SHA256 of "ID.TIMESTAMP.BODY". The key is the
 * decoded base64 that follows "whsec_" in the secret. */
#ifndef ORB_DELIVER_SIGN_H
#define ORB_DELIVER_SIGN_H

#include <stddef.h>
#include <stdint.h>

enum { WEBHOOK_SIGNATURE = 48 };

/* timestamp: Unix time in seconds. 0: the secret is malformed. */
int webhook_sign(const char *secret, const char *id, int64_t timestamp, const char *body, size_t size,
                 char out[WEBHOOK_SIGNATURE]);

#endif
