/* The search for a better place among the samples of a whole ring, in single precision: see search.c. */
#ifndef ORB_EMBED_KERNEL_SAMPLING_SEARCH_H
#define ORB_EMBED_KERNEL_SAMPLING_SEARCH_H

#include "embed/kernel_sampling/sample.h"

/* Finds the sample (all ring triangles with `apex`, drawn in towards it by `draw`) of least error below `bound`.
 * Returns 1 and the point, with its error in double precision; 0 where no sample is better or the kernel holds none.
 * The point lies exactly in the kernel. s->kernel_points is set. */
int orb_ks_search(orb_ks_sampler *s, const double apex[3], double draw, double bound, double out[3], double *error);

#endif
