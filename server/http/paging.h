/* Page tokens: the sequence numbers of rows under a key of the data folder, so that a token tells nobody how many rows
 * others have made. */
#ifndef ORB_PAGING_H
#define ORB_PAGING_H

#include <stdint.h>

#include "store/catalogue.h"

/* A token of a number from 1 on, the same in every run on the same data folder. */
uint64_t paging_seal(const unsigned char key[CATALOGUE_SECRET], int64_t number);
/* The number of a token; 0 where it is none that was given out, but for one guess of millions. */
int64_t paging_open(const unsigned char key[CATALOGUE_SECRET], uint64_t token);

#endif
