/* Threads that look around at intervals: a condition waited for by a clock that nobody sets, so that a wall clock that
 * is set back does not make them sleep. */
#ifndef ORB_SERVER_WAKE_H
#define ORB_SERVER_WAKE_H

#include <pthread.h>
#include <stdint.h>

void wake_init(pthread_cond_t *wake);
/* Until it is signalled, or so long. `wake` is of wake_init(), `lock` is held. */
void wake_wait_ms(pthread_cond_t *wake, pthread_mutex_t *lock, int64_t ms);

#endif
