/* Page tokens: sequence numbers of rows, encrypted with a key of the data folder, so that a token does not reveal how
 * many rows other tenants have. */
#ifndef ORB_PAGING_H
#define ORB_PAGING_H

#include <stdint.h>

#include "store/catalogue.h"

/* The token of a number ≥ 1. The same data folder always gives the same token. */
uint64_t paging_seal(const unsigned char key[CATALOGUE_SECRET], int64_t number);
/* The number of a token; 0 if it was never issued (a random guess passes once in 2^24). */
int64_t paging_open(const unsigned char key[CATALOGUE_SECRET], uint64_t token);

#endif
