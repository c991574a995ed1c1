/* The hash of the server's tables. Callers can choose the keys of those tables, so the hash has a random key of its own
 * in each process. */
#ifndef ORB_SERVER_HASH_H
#define ORB_SERVER_HASH_H

#include <stddef.h>
#include <stdint.h>

/* Any thread. */
uint64_t keyed_hash(const void *bytes, size_t size);
/* Of the numbers of owners, where what each may hold is counted: so none is a small number with a meaning of its own.
 */
static const uint64_t HASH_OF_OWNER = UINT64_C(1) << 63;
/* The number of a tenant. */
uint64_t tenant_hash(const char *tenant);

#endif
