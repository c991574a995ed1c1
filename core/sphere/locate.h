/* Point location on an embedded mesh that also returns the exact hit. */
#ifndef ORB_SPHERE_LOCATE_H
#define ORB_SPHERE_LOCATE_H

#include "orbmorph/locate.h"
#include "sphere/walk.h"

/* As orb_locate(); the hit is in the triangle of the place. */
orb_hit orb_locate_hit(const orb_locator *locator, const double p[3], int32_t hint, orb_place *out);

#endif
