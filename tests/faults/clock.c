/* A wall clock that is wrong until ORB_CLOCK_AHEAD_MS after the first reading, and correct from then on: by
 * ORB_CLOCK_OFF seconds (3600: an hour fast; −3600: an hour slow, so that it jumps ahead). */
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
  const char *text = getenv("ORB_CLOCK_AHEAD_MS"), *off = getenv("ORB_CLOCK_OFF");
  long long now = now_ms(CLOCK_MONOTONIC, &unused), none = 0;
  __atomic_compare_exchange_n(&began, &none, now, 0, __ATOMIC_RELAXED, __ATOMIC_RELAXED);
  now_ms(which, out);
  if ((which == CLOCK_REALTIME || which == CLOCK_REALTIME_COARSE) &&
      now - __atomic_load_n(&began, __ATOMIC_RELAXED) < (text ? atoll(text) : 0)) {
    out->tv_sec += off ? atoll(off) : 3600;
  }
  return 0;
}

time_t time(time_t *out) {
  struct timespec now;
  clock_gettime(CLOCK_REALTIME_COARSE, &now);
  if (out) {
    *out = now.tv_sec;
  }
  return now.tv_sec;
}
