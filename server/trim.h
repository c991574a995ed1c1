/* Gives memory that the daemon has freed back to the system. The C library keeps free memory that lies between what
 * lives: after many connections have closed, some hundred megabytes. */
#ifndef ORB_TRIM_H
#define ORB_TRIM_H

#include <stdint.h>

/* Gives back what is free in all heaps, but for at most a megabyte at the end of each. */
void trim_now(void);

/* Starts as {0}. */
typedef struct trim_state {
  int64_t looked_ms; /* orb_clock_ms() */
  int64_t stays;     /* free bytes that the last trim could not give back */
} trim_state;

/* Trims when TRIM_LEAST bytes more are free and in memory than the last trim has left. Looks at most every
 * TRIM_EVERY_MS; while little memory is in use that is one read of /proc. */
enum { TRIM_LEAST = 12 << 20, TRIM_EVERY_MS = 2000 };
void trim_when_free(trim_state *state);

#endif
