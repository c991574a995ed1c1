/* What an input may cost: a target that exceeds it aborts, and libFuzzer reports the input. */
#ifndef ORB_FUZZ_COST_H
#define ORB_FUZZ_COST_H

#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "orbmorph/context.h"

/* How many times slower a build with sanitizers and coverage is. */
static const double FUZZ_SLOWER = 60;

/* Of a document that is read, changed and read again: bytes of memory for each of its bytes, and beside them. */
enum { DOCUMENT_BYTES = 1000, DOCUMENT_AT_LEAST = 4 << 20 };

static inline double fuzz_cpu_seconds(void) {
  struct timespec now;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* began: fuzz_cpu_seconds() before the work. bytes, seconds: the most that it may take, in this build. */
static inline void fuzz_check_cost(const orb_context *ctx, double began, size_t bytes, double seconds, size_t size,
                                   const char *what) {
  const double took = fuzz_cpu_seconds() - began;
  const size_t peak = orb_memory_peak(ctx);
  if (peak > bytes || took > seconds) {
    fprintf(stderr, "%s %zu bytes took %zu bytes of memory and %.3f s, %zu and %.3f were allowed\n", what, size, peak,
            took, bytes, seconds);
    abort();
  }
}

/* For a document that is read, changed and read again. */
static inline void fuzz_check_document(const orb_context *ctx, double began, size_t size, const char *what) {
  fuzz_check_cost(ctx, began, DOCUMENT_BYTES * size + DOCUMENT_AT_LEAST, 3 + FUZZ_SLOWER * 4e-6 * (double)size, size,
                  what);
}

#endif
