/* Which points on the sphere the fixed shape has: a landmark walk may give it others. */
#ifndef ORB_ALIGN_MAP_FIXED_SPHERE_H
#define ORB_ALIGN_MAP_FIXED_SPHERE_H

#include "align/map/engine/run.h"

/* Gives the fixed shape other points (3 a vertex, copied; NULL: as given). Places on it stay what they are. The best
 * map so far is set aside: run->best is empty afterwards. Does nothing if it has these points already. */
ORB_MUST_CHECK orb_status orb_map_take_sphere(orb_map_run *run, const double *points);

/* Makes the best of all maps run->best, and gives the fixed shape its points. */
ORB_MUST_CHECK orb_status orb_map_take_best(orb_map_run *run);

#endif
