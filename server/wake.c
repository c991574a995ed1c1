#include "wake.h"

#include <time.h>

void wake_init(pthread_cond_t *wake) {
  pthread_condattr_t attributes;
  pthread_condattr_init(&attributes);
  pthread_condattr_setclock(&attributes, CLOCK_MONOTONIC);
  pthread_cond_init(wake, &attributes);
  pthread_condattr_destroy(&attributes);
}

void wake_wait_ms(pthread_cond_t *wake, pthread_mutex_t *lock, int64_t ms) {
  struct timespec until;
  clock_gettime(CLOCK_MONOTONIC, &until);
  until.tv_sec += ms / 1000;
  until.tv_nsec += ms % 1000 * 1000000;
  until.tv_sec += until.tv_nsec / 1000000000;
  until.tv_nsec %= 1000000000;
  pthread_cond_timedwait(wake, lock, &until);
}
