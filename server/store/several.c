#include "store/several.h"

#include <pthread.h>

typedef struct several {
  int (*one)(void *user, int k);
  void *user;
  int count;
  int next, stopped; /* __atomic */
} several;

static void *work(void *user) {
  several *s = user;
  for (int k; !__atomic_load_n(&s->stopped, __ATOMIC_RELAXED) &&
              (k = __atomic_fetch_add(&s->next, 1, __ATOMIC_RELAXED)) < s->count;) {
    if (!s->one(s->user, k)) {
      __atomic_store_n(&s->stopped, 1, __ATOMIC_RELAXED);
    }
  }
  return NULL;
}

void several_run(int count, int (*one)(void *user, int k), void *user) {
  several s = {.one = one, .user = user, .count = count};
  pthread_t threads[SEVERAL_THREADS];
  int started = 0;
  while (started < SEVERAL_THREADS - 1 && started < count - 1 &&
         pthread_create(&threads[started], NULL, work, &s) == 0) {
    started++;
  }
  work(&s);
  for (int i = 0; i < started; i++) {
    pthread_join(threads[i], NULL);
  }
}
