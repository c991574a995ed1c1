/* Shapes of which only parts correspond: a head and a bust, say. */
#ifndef ORB_ALIGN_MAP_SPACE_PART_H
#define ORB_ALIGN_MAP_SPACE_PART_H

#include "align/map/engine/run.h"

/* Which shape is a part of the other one. */
typedef enum orb_map_part { ORB_MAP_NO_PART, ORB_MAP_PART_MOVES, ORB_MAP_PART_IS_FIXED } orb_map_part;

/* Do the landmarks show that only a part of one shape corresponds to the other one? They do if nearly all distances
 * between landmarks are larger on the same shape by about the same factor, though both shapes have the same area here:
 * longer limbs alone make some distances much larger than others. O(landmarks² + n). */
ORB_MUST_CHECK orb_status orb_map_find_part(orb_context *ctx, const orb_map_params *params,
                                            const orb_aligned_shape *fixed, const orb_aligned_shape *moving,
                                            int32_t landmark_count, orb_map_part *part);

/* Draws the best map to where the parts fit each other in space, and sets run->course.fits_part, unless few vertices of
 * the part fit, or that would raise the energy to more than params.part.most times what it is. */
ORB_MUST_CHECK orb_status orb_map_fit_part(orb_map_run *run, orb_map_part part);

#endif
