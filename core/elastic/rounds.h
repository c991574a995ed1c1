/* The rounds of a registration. */
#ifndef ORB_ELASTIC_ROUNDS_H
#define ORB_ELASTIC_ROUNDS_H

#include "elastic/registration.h"

/* One round to the nearest places. done: share of the rounds before this one, from 0 to 1. reach: the distance at which
 * a pull is as strong as the edges. */
ORB_MUST_CHECK orb_status orb_registration_round(orb_registration *r, double done, double reach);

/* So many rounds, at least 2, with a reach that shrinks from first to last. */
ORB_MUST_CHECK orb_status orb_registration_rounds(orb_registration *r, int rounds, double first, double last);

#endif
