#include "support_context.h"

orb_context *ctx;

static int begin(int threads) {
  orb_context_options options = {.threads = threads};
  return orb_context_create(&options, &ctx) != ORB_OK;
}

int context_one_thread(void **unused) {
  (void)unused;
  return begin(1);
}

int context_two_threads(void **unused) {
  (void)unused;
  return begin(2);
}

int context_end(void **unused) {
  (void)unused;
  orb_context_destroy(ctx);
  return 0;
}
