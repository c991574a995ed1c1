/* The hash of the server's tables, whose keys callers choose or can find by trying: keyed at random in each process. */
#ifndef ORB_SERVER_HASH_H
#define ORB_SERVER_HASH_H

#include <stddef.h>
#include <stdint.h>

/* Any thread. */
uint64_t keyed_hash(const void *bytes, size_t size);

#endif
