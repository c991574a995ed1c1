/* What an operator runs beside the service: verifying and clearing the data folder. */
#ifndef ORB_MAINTAIN_H
#define ORB_MAINTAIN_H

#include "config.h"

/* Verifies the catalogue, and every object against its hash; prints what is wrong. 0 clean, 1 not. */
int maintain_check(const config *options);
/* Removes objects without a row, and the least used derived ones beyond derived-bytes. 0 done. */
int maintain_gc(const config *options);

#endif
