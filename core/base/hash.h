/* The hash of every table that is filled with data of callers.
 *
 * SipHash-1-3 under a random key of the context: without the key, nobody can choose data that collide. It is written
 * out here, because libsodium has only the slower SipHash-2-4, and core links no library for 40 lines. Results must
 * not depend on the order of the slots, since that differs from run to run.
 */
#ifndef ORB_BASE_HASH_H
#define ORB_BASE_HASH_H

#include "orbmorph/context.h"

/* Any thread. O(size). */
uint64_t orb_hash(const orb_context *ctx, const void *bytes, size_t size);

/* The same under any key: for orb_hash(), and for the test against its published values. */
uint64_t orb_siphash13(const uint64_t key[2], const void *bytes, size_t size);

/* A key from the operating system. */
void orb_hash_key(uint64_t key[2]);

#endif
