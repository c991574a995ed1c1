/* The hash of the server's tables. Callers can choose the keys of those tables, so the hash has a random key of its own
 * in each process. */
#ifndef ORB_SERVER_HASH_H
#define ORB_SERVER_HASH_H

#include <stddef.h>
#include <stdint.h>

/* Any thread. */
uint64_t keyed_hash(const void *bytes, size_t size);

#endif
