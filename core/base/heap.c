/* The heap of a program that computes. */
#include <stdlib.h>
#if defined(__GLIBC__)
#include <malloc.h>
#endif

#include "orbmorph/context.h"

#if defined(__GLIBC__)
/* TOP_PAD: bytes by which the heap grows at once. Huge pages fill only what grows at once: with 2 MiB a job had three
 * times the page faults, beyond 16 MiB nothing changed. KEPT: bytes free at the end of the heap before it shrinks; more
 * than one stage of an alignment of two shapes of 100,000 triangles frees. MAPPED: from this size on malloc() maps
 * blocks one by one; twice what blocks of a context have at most. */
enum { TOP_PAD = 16 << 20, KEPT = 64 << 20, MAPPED = 4 << 20 };
#endif

void orb_keep_heap(void) {
#if defined(__GLIBC__)
  (void)mallopt(M_TOP_PAD, TOP_PAD);
  (void)mallopt(M_TRIM_THRESHOLD, KEPT);
  (void)mallopt(M_MMAP_THRESHOLD, MAPPED);
#endif
}
