/* The heap of a program that computes. */
#include "base/heap.h"

#include <stdatomic.h>
#include <stdlib.h>
#if defined(__GLIBC__)
#include <malloc.h>
#endif

#include "orbmorph/context.h"

#if defined(__GLIBC__)
/* TOP_PAD: bytes by which the heap grows at once. Huge pages fill only what grows at once: with 2 MiB a job had three
 * times the page faults, beyond 16 MiB nothing changed. KEPT: bytes free at the end of the heap before it shrinks; more
 * than one stage of an alignment of two shapes of 100,000 triangles frees. A context counts what is kept against its
 * memory_limit. MAPPED: from this size on malloc() maps blocks one by one: the most that the C library allows, and more
 * than what a context leaves to it (memory.c). ARENAS: one, since only the main heap gives back what is asked of it;
 * threads take blocks too seldom to wait for each other. */
enum { TOP_PAD = 16 << 20, KEPT = 64 << 20, MAPPED = 32 << 20, ARENAS = 1 };

/* The settings are of the process, and so is this. */
static atomic_int is_kept;
#endif

void orb_keep_heap(void) {
#if defined(__GLIBC__)
  if (mallopt(M_TOP_PAD, TOP_PAD) && mallopt(M_TRIM_THRESHOLD, KEPT) && mallopt(M_MMAP_THRESHOLD, MAPPED) &&
      mallopt(M_ARENA_MAX, ARENAS)) {
    atomic_store(&is_kept, 1);
  }
#endif
}

int orb_heap_is_kept(void) {
#if defined(__GLIBC__)
  return atomic_load_explicit(&is_kept, memory_order_relaxed);
#else
  return 0;
#endif
}

void orb_heap_give_back(void) {
#if defined(__GLIBC__)
  (void)malloc_trim(0);
#endif
}
