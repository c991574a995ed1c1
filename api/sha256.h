/* SHA-256 of many bytes. libsodium computes it in plain C; a processor with instructions for it takes a fifth of that
 * time. */
#ifndef ORB_API_SHA256_H
#define ORB_API_SHA256_H

#include <sodium.h>
#include <stddef.h>

/* As crypto_hash_sha256_update(), with the same state: libsodium begins it and ends it. */
void api_sha256_add(crypto_hash_sha256_state *state, const void *bytes, size_t size);

#endif
