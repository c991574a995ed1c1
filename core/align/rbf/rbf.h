/* Method `rbf`: the warp by radial basis functions of Peng & Timalsena 2016, section 7.2.
 *
 * In: sheets with landmarks. Out: the same with warped spheres, on which the landmarks coincide, certified.
 * Read warp.h first: one warp. rbf.c takes it in small steps.
 */
#ifndef ORB_ALIGN_RBF_RBF_H
#define ORB_ALIGN_RBF_RBF_H

#include "align/sheet/sheet.h"

/* Aligns all shapes; given: the landmarks of the request; landmarks: those that are distinct, as numbers of `given`. */
ORB_MUST_CHECK orb_status orb_align_rbf(orb_context *ctx, orb_sheet *sheets, int32_t shape_count,
                                        const orb_landmark *given, const int32_t *landmarks, int32_t count,
                                        const orb_align_options *options);

#endif
