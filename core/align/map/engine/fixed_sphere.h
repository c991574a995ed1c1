/* Which points on the sphere the fixed shape has: a landmark walk gives it others. */
#ifndef ORB_ALIGN_MAP_ENGINE_FIXED_SPHERE_H
#define ORB_ALIGN_MAP_ENGINE_FIXED_SPHERE_H

#include "align/map/engine/run.h"

/* Gives the fixed shape other points, 3 a vertex; the run takes *points over and sets it to NULL. Places on the shape
 * stay what they are. The best map so far is set aside as run->kept, which must be empty; run->best becomes run->start,
 * of no energy yet. */
ORB_MUST_CHECK orb_status orb_map_take_sphere(orb_map_run *run, double **points);

/* Makes the better of run->best and run->kept run->best, with its points of the fixed shape. */
ORB_MUST_CHECK orb_status orb_map_take_best(orb_map_run *run);

#endif
