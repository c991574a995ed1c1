#include "base/loops.h"

#include "base/check.h"
#include "base/parallel.h"

enum { SLICE = 65536 }; /* iterations between checks for cancellation */

typedef struct shifted_loop {
  orb_loop_fn body;
  void *arg;
  int64_t start;
} shifted_loop;

static void run_shifted(void *arg, int64_t begin, int64_t end, int thread) {
  const shifted_loop *loop = arg;
  loop->body(loop->arg, loop->start + begin, loop->start + end, thread);
}

orb_status orb_sliced_by(orb_context *ctx, int64_t count, int64_t slice, int64_t grain, orb_loop_fn body, void *arg) {
  slice = grain * ((slice + grain - 1) / grain);
  for (int64_t start = 0; start < count; start += slice) {
    ORB_TRY(orb_context_check(ctx));
    shifted_loop loop = {.body = body, .arg = arg, .start = start};
    orb_parallel_for(ctx, count - start < slice ? count - start : slice, grain, run_shifted, &loop);
  }
  return ORB_OK;
}

orb_status orb_sliced_for(orb_context *ctx, int64_t count, int64_t grain, orb_loop_fn body, void *arg) {
  return orb_sliced_by(ctx, count, SLICE, grain, body, arg);
}
