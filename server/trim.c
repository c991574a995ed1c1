#include "trim.h"

#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>
#if defined(__GLIBC__)
#include <malloc.h>
#endif

#include "orbmorph/context.h"

/* Small blocks that a thread frees stay in its heap, whose end malloc_trim() shortens only if it is that of the
 * process. Any heap joins its free blocks and shortens itself when a block of MERGES bytes is freed at its end. */
void trim_now(void) {
#if defined(__GLIBC__)
  enum { MERGES = 96 << 10 };
  void *volatile block = malloc(MERGES);
  free(block);
  (void)malloc_trim(0);
#endif
}

/* Bytes in memory that are not pages of files; 0: unknown. */
static int64_t resident(void) {
  long long all = 0, shared = 0;
  FILE *file = fopen("/proc/self/statm", "re");
  const int read = file ? fscanf(file, "%*s %lld %lld", &all, &shared) : 0;
  if (file) {
    fclose(file);
  }
  return read == 2 ? (all - shared) * sysconf(_SC_PAGESIZE) : 0;
}

/* Bytes that are free and in memory. What the heaps call free alone would not do: it includes what was given back. */
static int64_t idle_bytes(int64_t in_memory) {
#if defined(__GLIBC__) && (__GLIBC__ > 2 || __GLIBC_MINOR__ >= 33)
  const struct mallinfo2 heaps = mallinfo2();
  const int64_t rest = in_memory - (int64_t)heaps.uordblks - (int64_t)heaps.hblkhd;
  return rest < (int64_t)heaps.fordblks ? rest : (int64_t)heaps.fordblks;
#else
  (void)in_memory;
  return 0;
#endif
}

void trim_when_free(trim_state *state) {
  const int64_t now = orb_clock_ms();
  if (now - state->looked_ms < TRIM_EVERY_MS) {
    return;
  }
  state->looked_ms = now;
  const int64_t before = resident(), idle = before > 2 * TRIM_LEAST ? idle_bytes(before) : 0;
  if (idle < state->stays + TRIM_LEAST) {
    state->stays = idle < state->stays ? idle > 0 ? idle : 0 : state->stays;
    return;
  }
  trim_now();
  const int64_t stays = idle_bytes(resident());
  state->stays = stays > 0 ? stays : 0;
}
