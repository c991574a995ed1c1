#include "base/loops.h"

#include "base/check.h"
#include "base/parallel.h"

enum { SLICE = 65536 }; /* iterations between checks for cancellation */

orb_status orb_sliced_by(orb_context *ctx, int64_t count, int64_t slice, int64_t grain, orb_loop_fn body, void *arg) {
  slice = grain * ((slice + grain - 1) / grain);
  for (int64_t start = 0; start < count; start += slice) {
    ORB_TRY(orb_context_check(ctx));
    orb_parallel_slice(ctx, start, count - start < slice ? count - start : slice, grain, body, arg);
  }
  return ORB_OK;
}

orb_status orb_sliced_for(orb_context *ctx, int64_t count, int64_t grain, orb_loop_fn body, void *arg) {
  return orb_sliced_by(ctx, count, SLICE, grain, body, arg);
}
