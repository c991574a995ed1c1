/* The error record of a context; orb_fail() and its readers are declared in orbmorph/context.h. */
#ifndef ORB_BASE_ERROR_H
#define ORB_BASE_ERROR_H

#include "orbmorph/context.h"

/* A record without facts: counts 0, numbers that do not apply −1. */
void orb_error_reset(orb_error *error);

#endif
