/* Pulls of a registration to the nearest places. */
#ifndef ORB_ELASTIC_PLACES_H
#define ORB_ELASTIC_PLACES_H

#include "elastic/registration.h"

/* Each vertex of a is pulled to the nearest place of b, and each vertex of b pulls the nearest one of a. A slide looks
 * from ahead of where a is, and its places follow the relief. O(n · m). */
void orb_pull_by_places(orb_registration *r, double weight);

#endif
