/* The context: creation, cancel flag, deadline, progress, the processor. */
#include "base/context.h"

#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/check.h"
#include "base/error.h"
#include "base/hash.h"
#include "base/memory.h"
#include "base/parallel.h"
#include "base/state.h"

enum {
  CONTEXT_MAGIC = 0x0eb3c07e, /* tells a context from any other pointer */
  MAX_THREADS = 64            /* of a context, as its header says */
};
static const int64_t DEFAULT_MAX_TRIANGLES = 5000000; /* as its header says */

static int default_threads(void) {
  long online = sysconf(_SC_NPROCESSORS_ONLN);
  return online < 1 ? 1 : online > MAX_THREADS ? MAX_THREADS : (int)online;
}

static void begin(orb_context *ctx, orb_context *root, const orb_context_options *options) {
  memset(ctx, 0, offsetof(orb_context, error)); /* what follows is set below: the error takes 1.5 MB */
  ctx->in_loop = 0;
  ctx->stage = NULL;
  ctx->steps_expected = ctx->steps_shown = 0;
  atomic_init(&ctx->steps, 0);
  ctx->pool = NULL;
  ctx->magic = CONTEXT_MAGIC;
  ctx->root = root;
  ctx->options = *options;
  orb_error_reset(&ctx->error);
  pthread_mutex_init(&ctx->error_lock, NULL);
  pthread_mutex_init(&ctx->progress_lock, NULL);
}

orb_status orb_context_create(const orb_context_options *options, orb_context **out) {
  static const orb_context_options defaults = {0};
  if (!options) {
    options = &defaults;
  }
  orb_context *ctx =
      options->allocator.alloc ? options->allocator.alloc(options->allocator.user, sizeof *ctx) : malloc(sizeof *ctx);
  if (!ctx) {
    return ORB_E_NO_MEMORY;
  }
  begin(ctx, ctx, options);
  if (ctx->options.max_triangles == 0) {
    ctx->options.max_triangles = DEFAULT_MAX_TRIANGLES;
  }
  if (ctx->options.threads <= 0) {
    ctx->options.threads = default_threads();
  }
  if (ctx->options.threads > MAX_THREADS) {
    ctx->options.threads = MAX_THREADS;
  }
  orb_hash_key(ctx->hash_key);
  *out = ctx;
  return ORB_OK;
}

orb_status orb_context_part(orb_context *ctx, orb_context **out) {
  orb_context *part = orb_alloc(ctx, 1, sizeof *part);
  if (!part) {
    return ORB_E_NO_MEMORY;
  }
  begin(part, ctx->root, &ctx->root->options);
  part->options.threads = 1; /* it starts none; others enter its pool */
  memcpy(part->hash_key, ctx->hash_key, sizeof part->hash_key);
  *out = part;
  return ORB_OK;
}

void orb_context_destroy(orb_context *ctx) {
  if (!ctx) {
    return;
  }
  ORB_ASSERT(ctx->magic == CONTEXT_MAGIC);
  orb_pool_stop(ctx);
  ORB_ASSERT(atomic_load(&ctx->memory_used) == 0);
  pthread_mutex_destroy(&ctx->error_lock);
  pthread_mutex_destroy(&ctx->progress_lock);
  ctx->magic = 0;
  if (ctx->root != ctx) {
    orb_free(ctx->root, ctx);
  } else if (ctx->options.allocator.free) {
    ctx->options.allocator.free(ctx->options.allocator.user, ctx);
  } else {
    free(ctx);
  }
}

void orb_library_runs(orb_context *ctx, size_t counted) {
  if (ctx->options.meter) {
    ctx->options.meter(ctx, counted);
  }
}

void orb_library_ends(orb_context *ctx) {
  if (ctx->options.meter) {
    ctx->options.meter(NULL, 0);
  }
}

void orb_context_cancel(orb_context *ctx) {
  atomic_store(&ctx->root->cancelled, 1);
}

orb_status orb_context_check(orb_context *ctx) {
  if (atomic_load_explicit(&ctx->root->cancelled, memory_order_relaxed)) {
    return orb_fail(ctx, ORB_E_CANCELLED, "The job was cancelled.");
  }
  if (ctx->options.deadline_ms && orb_clock_ms() > ctx->options.deadline_ms) {
    return orb_fail(ctx, ORB_E_TIMEOUT, "The job exceeded its time limit; raise the limit or send a smaller mesh.");
  }
  return ORB_OK;
}

void orb_progress(orb_context *part, const char *stage, double fraction) {
  orb_context *ctx = part->root;
  if (!ctx->options.progress || pthread_mutex_trylock(&ctx->progress_lock) != 0) {
    return;
  }
  if (!ctx->stage || strcmp(ctx->stage, stage) == 0) {
    ctx->options.progress(ctx->options.progress_user, stage, fraction < 0 ? 0 : fraction > 1 ? 1 : fraction);
  }
  pthread_mutex_unlock(&ctx->progress_lock);
}

void orb_progress_expect(orb_context *part, double steps) {
  orb_context *ctx = part->root;
  pthread_mutex_lock(&ctx->progress_lock);
  atomic_store(&ctx->steps, 0);
  ctx->steps_expected = steps;
  ctx->steps_shown = 0;
  pthread_mutex_unlock(&ctx->progress_lock);
}

void orb_progress_steps(orb_context *part, int64_t steps) {
  static const double STEADY = 0.8, LEAST = 1e-3; /* fractions; LEAST: what is worth a report */
  orb_context *ctx = part->root;
  const double made = (double)(atomic_fetch_add_explicit(&ctx->steps, steps, memory_order_relaxed) + steps);
  if (!ctx->options.progress || pthread_mutex_trylock(&ctx->progress_lock) != 0) {
    return;
  }
  const double share = ctx->steps_expected > 0 ? made / ctx->steps_expected : 0, rest = 1 - STEADY;
  const double fraction = share < STEADY ? share : 1 - rest * exp((STEADY - share) / rest);
  if (ctx->stage && fraction >= ctx->steps_shown + LEAST) {
    ctx->steps_shown = fraction;
    ctx->options.progress(ctx->options.progress_user, ctx->stage, fraction);
  }
  pthread_mutex_unlock(&ctx->progress_lock);
}

const char *orb_progress_only(orb_context *part, const char *stage) {
  orb_context *ctx = part->root;
  pthread_mutex_lock(&ctx->progress_lock);
  const char *before = ctx->stage;
  ctx->stage = stage;
  pthread_mutex_unlock(&ctx->progress_lock);
  return before;
}

static orb_cpu widest_of_machine(void) {
#if defined(__x86_64__)
  __builtin_cpu_init();
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl") &&
      __builtin_cpu_supports("avx512bw")) {
    return ORB_CPU_AVX512;
  }
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) {
    return ORB_CPU_AVX2;
  }
#endif
  return ORB_CPU_PLAIN;
}

orb_cpu orb_context_cpu(const orb_context *ctx) {
  orb_cpu widest = widest_of_machine();
  return ctx->options.cpu == ORB_CPU_AUTO || ctx->options.cpu > widest ? widest : ctx->options.cpu;
}

int orb_threads(const orb_context *ctx) {
  return ctx->root->options.threads;
}
int64_t orb_context_max_triangles(const orb_context *ctx) {
  return ctx->options.max_triangles;
}
