/* The part of a registration that follows a rough map. */
#ifndef ORB_ELASTIC_ROUGH_MAP_H
#define ORB_ELASTIC_ROUGH_MAP_H

#include "elastic/registration.h"

/* Sets the pose that r->map gives directly, and lets it settle along the map alone. O(n²): each vertex takes its first
 * rotation from a share of all. */
ORB_MUST_CHECK orb_status orb_follow_rough_map(orb_registration *r);

/* Pulls each vertex to its image. outlier: the distance at which an image counts a quarter. */
void orb_pull_by_rough_map(orb_registration *r, double weight, double outlier);

/* The square of the distance at which such a pull of weight 1 is as strong as the edges. */
double orb_rough_map_reach2(void);

#endif
