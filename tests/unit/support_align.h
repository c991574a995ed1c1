/* Checks an alignment independently of the library's certificate. */
#ifndef SUPPORT_ALIGN_H
#define SUPPORT_ALIGN_H

#include "orbmorph/align.h"

/* With sanitizers an alignment takes a quarter to half of a minute, so tests leave cases out where others run the same
 * code. */
#ifdef __SANITIZE_ADDRESS__
enum { IS_SLOW = 1 };
#else
enum { IS_SLOW = 0 };
#endif

/* Counts of threads for which results must have the same bytes. The release build compares them; with sanitizers the
 * first one runs alone. */
enum { THREAD_COUNTS = IS_SLOW ? 1 : 3 };
extern const int thread_counts[3];

/* Closed (T = 2V − 4), valid, positive by exact arithmetic on a sample, covers the sphere once by solid angles, and has
 * landmark k at bit-equal points on all shapes. */
void check_alignment(const orb_alignment *alignment, int landmarks_meet);

/* Runs orb_align() and checks the result and that no surface has changed. Prints the reason on failure. The caller
 * frees `out`. */
void align_and_check(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                     const orb_landmark *landmarks, int32_t landmark_count, const orb_align_options *options,
                     orb_alignment *out);

#endif
