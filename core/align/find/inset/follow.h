/* Lays a small shape onto a part of a large one by closest points, from many starts. */
#ifndef ORB_ALIGN_FIND_INSET_FOLLOW_H
#define ORB_ALIGN_FIND_INSET_FOLLOW_H

#include "align/find/inset/starts.h"

/* The samples are spread over the small shape, so that the first of them are as well. */
typedef struct orb_inset_pair {
  const orb_inset_sample *sample;
  int32_t sample_count; /* at least ORB_FIND_INSET_LOOKUPS, at most ORB_FIND_INSET_SAMPLES */
  const orb_mesh *large;
  const orb_nearest *tree;    /* of `large` */
  const orb_inset_grid *grid; /* likewise */
  int32_t landmark_count;
  const double *landmark[2]; /* on the small shape and on the large one, 3 each */
} orb_inset_pair;

/* Do the landmarks, which alone are needed, fix a similarity: are they apart on both shapes, and not in a row? */
int orb_inset_is_fixed(const orb_inset_pair *pair);
/* The similarity of the landmarks, which alone are needed. Returns 0 if it is not that of a part. */
int orb_inset_fit(const orb_inset_pair *pair, orb_similarity *out);

/* Lets all starts, ORB_INSET_STARTS_MOST at most, follow closest points by the stages of ORB_FIND_INSET_STAGE. A place
 * that takes a landmark far from its partner is left. *score: how well the samples lie on the large shape at last, 0 to
 * 1; 0: no start has led anywhere, and `out` is not set. */
ORB_MUST_CHECK orb_status orb_inset_follow(orb_context *ctx, const orb_inset_pair *pair, const orb_similarity *start,
                                           int32_t count, orb_similarity *out, double *score);

#endif
