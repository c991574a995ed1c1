/* The error record: the first failure of a parallel loop wins, otherwise the last one. */
#include "base/error.h"

#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include "base/check.h"
#include "base/state.h"

void orb_error_reset(orb_error *error) {
  memset(error, 0, offsetof(orb_error, loop_start)); /* loop_count says how much of the rest is set */
  error->loop_start[0] = 0;
  error->line = error->offset = error->boundary_loops = error->genus = -1;
  error->shape = error->transfer = -1;
}

void orb_error_clear(orb_context *ctx) {
  pthread_mutex_lock(&ctx->error_lock);
  orb_error_reset(&ctx->error);
  pthread_mutex_unlock(&ctx->error_lock);
}

const orb_error *orb_context_error(const orb_context *ctx) {
  return &ctx->error;
}
orb_error *orb_context_error_edit(orb_context *ctx) {
  return &ctx->error;
}

orb_status orb_fail(orb_context *ctx, orb_status status, const char *format, ...) {
  ORB_ASSERT(status != ORB_OK);
  pthread_mutex_lock(&ctx->error_lock);
  if (!ctx->in_loop || ctx->error.status == ORB_OK) {
    orb_error_reset(&ctx->error);
    ctx->error.status = status;
    va_list args;
    va_start(args, format);
    vsnprintf(ctx->error.detail, sizeof ctx->error.detail, format, args);
    va_end(args);
  }
  pthread_mutex_unlock(&ctx->error_lock);
  return status;
}
