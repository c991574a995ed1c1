/* Timed waits on a condition by the monotonic clock, so that setting the wall clock back does not prolong them. */
#ifndef ORB_SERVER_WAKE_H
#define ORB_SERVER_WAKE_H

#include <pthread.h>
#include <stdint.h>

void wake_init(pthread_cond_t *wake);
/* Waits until `wake` is signalled, but at most this long. `wake` is from wake_init(); the caller holds `lock`. */
void wake_wait_ms(pthread_cond_t *wake, pthread_mutex_t *lock, int64_t ms);

#endif
