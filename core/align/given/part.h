/* A part and its whole, with too few landmarks to show it: pairs that lie on each other in space become landmarks.
 *
 * In: shapes, their landmarks, and a part that these agree with (find/inset/inset.h). Out: a longer list of landmarks.
 */
#ifndef ORB_ALIGN_GIVEN_PART_H
#define ORB_ALIGN_GIVEN_PART_H

#include "align/find/inset/inset.h"
#include "orbmorph/alignment.h"

/* The given landmarks, which come first, and the pairs of the part. */
typedef struct orb_part_landmarks {
  int32_t count;
  orb_landmark *landmark;
  orb_place *at; /* what the landmarks point to: two each */
} orb_part_landmarks;

/* Leaves out pairs that lie near a landmark on either shape, or at a vertex that a shape does not have: those of the
 * inset are on copies that may have more. out->count is landmark_count if the rest is too few to hold a part. Free
 * `out` in any case. O(pairs · n). */
ORB_MUST_CHECK orb_status orb_part_landmarks_create(orb_context *ctx, const orb_align_shape shapes[2],
                                                    const orb_landmark *landmarks, int32_t landmark_count,
                                                    const orb_inset *inset, orb_part_landmarks *out);
void orb_part_landmarks_free(orb_context *ctx, orb_part_landmarks *landmarks);

#endif
