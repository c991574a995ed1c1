/* The search for a better point among the samples of a whole ring, in single precision: see search.c. */
#ifndef ORB_EMBED_KERNEL_SAMPLING_SEARCH_H
#define ORB_EMBED_KERNEL_SAMPLING_SEARCH_H

#include "embed/kernel_sampling/sample.h"

/* Finds the sample of least error below `bound` in the triangles of `apex` and the ring, pulled towards the apex by
 * `draw`. Returns 1 with the point, which lies exactly in the kernel, and its error in double precision; 0 if no sample
 * in the kernel is better. Sets s->kernel_points. */
int orb_ks_search(orb_ks_sampler *s, const double apex[3], double draw, double bound, double out[3], double *error);

#endif
