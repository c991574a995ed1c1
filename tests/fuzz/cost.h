/* What an input may cost: a target that exceeds it aborts, and libFuzzer reports the input. */
#ifndef ORB_FUZZ_COST_H
#define ORB_FUZZ_COST_H

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include <sanitizer/allocator_interface.h>

#include "orbmorph/context.h"

/* How many times slower a build with sanitizers and coverage is. */
static const double FUZZ_SLOWER = 60;

/* Of a document that is read, changed and read again: bytes of memory for each of its bytes, and beside them. */
enum { DOCUMENT_BYTES = 1000, DOCUMENT_AT_LEAST = 8 << 20 };

/* Heap that a budget need not count: of what runs beside the reader, and for each byte of the input, of the target. */
enum { HEAP_BESIDE = 1 << 20, HEAP_A_BYTE = 128 };

/* Bytes on the heap now, and the most since fuzz_begin(). */
static size_t fuzz_heap, fuzz_heap_most, fuzz_heap_before;

static inline void fuzz_on_malloc(const volatile void *at, size_t size) {
  (void)size;
  const size_t now = __atomic_add_fetch(&fuzz_heap, __sanitizer_get_allocated_size(at), __ATOMIC_RELAXED);
  if (now > fuzz_heap_most && now < SIZE_MAX / 2) { /* a block from before the hooks may have been freed */
    fuzz_heap_most = now;
  }
}

static inline void fuzz_on_free(const volatile void *at) {
  __atomic_sub_fetch(&fuzz_heap, at ? __sanitizer_get_allocated_size(at) : 0, __ATOMIC_RELAXED);
}

static inline double fuzz_cpu_seconds(void) {
  struct timespec now;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* Call it before the work that is measured; returns what fuzz_check_cost() takes. */
static inline double fuzz_begin(void) {
  static int is_hooked;
  if (!is_hooked) {
    is_hooked = 1;
    if (!__sanitizer_install_malloc_and_free_hooks(fuzz_on_malloc, fuzz_on_free)) {
      abort();
    }
    fuzz_heap = __sanitizer_get_current_allocated_bytes();
  }
  fuzz_heap_before = fuzz_heap_most = fuzz_heap;
  return fuzz_cpu_seconds();
}

/* began: fuzz_begin() before the work. bytes, seconds: the most that it may take, in this build. */
static inline void fuzz_check_cost(const orb_context *ctx, double began, size_t bytes, double seconds, size_t size,
                                   const char *what) {
  const double took = fuzz_cpu_seconds() - began;
  const size_t peak = orb_memory_peak(ctx);
  if (peak > bytes || took > seconds) {
    fprintf(stderr, "%s %zu bytes took %zu bytes of memory and %.3f s, %zu and %.3f were allowed\n", what, size, peak,
            took, bytes, seconds);
    abort();
  }
  /* What a parser allocates itself is counted by a block of the context that stands for it: it is there twice. */
  const size_t heap = fuzz_heap_most - fuzz_heap_before;
  if (heap > 2 * peak + HEAP_A_BYTE * size + HEAP_BESIDE) {
    fprintf(stderr, "%s %zu bytes took %zu bytes of the heap, and the budget counted %zu\n", what, size, heap, peak);
    abort();
  }
}

/* For a document that is read, changed and read again. */
static inline void fuzz_check_document(const orb_context *ctx, double began, size_t size, const char *what) {
  fuzz_check_cost(ctx, began, DOCUMENT_BYTES * size + DOCUMENT_AT_LEAST, 3 + FUZZ_SLOWER * 4e-6 * (double)size, size,
                  what);
}

#endif
