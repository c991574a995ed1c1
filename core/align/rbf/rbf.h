/* Method `rbf`: the warp by radial basis functions of Peng & Timalsena 2016, section 7.2. */
#ifndef ORB_ALIGN_RBF_RBF_H
#define ORB_ALIGN_RBF_RBF_H

#include "align/sheet/sheet.h"

/* The warp by radial basis functions of Peng & Timalsena 2016, section 7.2. */
ORB_MUST_CHECK orb_status orb_align_rbf(orb_context *ctx, orb_sheet *sheets, int32_t shape_count,
                                        const orb_landmark *given, const int32_t *landmarks, int32_t count,
                                        const orb_align_options *options);

#endif
