/* A wall clock that is one hour fast until ORB_CLOCK_AHEAD_MS after the first reading, and correct from then on. */
#include <stdlib.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

static long long now_ms(clockid_t which, struct timespec *at) {
  syscall(SYS_clock_gettime, which, at);
  return at->tv_sec * 1000LL + at->tv_nsec / 1000000;
}

int clock_gettime(clockid_t which, struct timespec *out) {
  static long long began;
  struct timespec unused;
  const char *text = getenv("ORB_CLOCK_AHEAD_MS");
  long long now = now_ms(CLOCK_MONOTONIC, &unused), none = 0;
  __atomic_compare_exchange_n(&began, &none, now, 0, __ATOMIC_RELAXED, __ATOMIC_RELAXED);
  now_ms(which, out);
  if (which == CLOCK_REALTIME && now - __atomic_load_n(&began, __ATOMIC_RELAXED) < (text ? atoll(text) : 0)) {
    out->tv_sec += 3600;
  }
  return 0;
}
