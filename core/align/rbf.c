#include "align/methods.h"
orb_status orb_align_rbf(orb_context *ctx, orb_sheet *sheets, int32_t shape_count, const orb_landmark *given,
                         const int32_t *landmarks, int32_t count, const orb_align_options *options) {
  (void)sheets;
  (void)shape_count;
  (void)given;
  (void)landmarks;
  (void)count;
  (void)options;
  return orb_fail(ctx, ORB_E_UNSUPPORTED, "The alignment rbf is not part of this build.");
}
