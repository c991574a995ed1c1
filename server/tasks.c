#include "tasks.h"

#include <pthread.h>
#include <stdlib.h>

struct tasks {
  pthread_mutex_t lock;
  pthread_cond_t wake;
  task *first, **last;
  int stopping, count;
  pthread_t threads[];
};

static void *thread_main(void *argument) {
  tasks *pool = argument;
  pthread_mutex_lock(&pool->lock);
  for (;;) {
    while (!pool->first && !pool->stopping) {
      pthread_cond_wait(&pool->wake, &pool->lock);
    }
    task *t = pool->first;
    if (!t) {
      break;
    }
    pool->first = t->next;
    if (!pool->first) {
      pool->last = &pool->first;
    }
    pthread_mutex_unlock(&pool->lock);
    t->run(t); /* may free t */
    pthread_mutex_lock(&pool->lock);
  }
  pthread_mutex_unlock(&pool->lock);
  return NULL;
}

tasks *tasks_start(int threads) {
  tasks *pool = calloc(1, sizeof *pool + (size_t)threads * sizeof(pthread_t));
  if (!pool) {
    return NULL;
  }
  pool->last = &pool->first;
  pthread_mutex_init(&pool->lock, NULL);
  pthread_cond_init(&pool->wake, NULL);
  for (int i = 0; i < threads; i++) {
    if (pthread_create(&pool->threads[i], NULL, thread_main, pool) != 0) {
      break;
    }
    pool->count++;
  }
  if (pool->count == 0) {
    free(pool);
    return NULL;
  }
  return pool;
}

void tasks_add(tasks *pool, task *t) {
  t->next = NULL;
  pthread_mutex_lock(&pool->lock);
  *pool->last = t;
  pool->last = &t->next;
  pthread_cond_signal(&pool->wake);
  pthread_mutex_unlock(&pool->lock);
}

void tasks_stop(tasks *pool) {
  if (!pool) {
    return;
  }
  pthread_mutex_lock(&pool->lock);
  pool->stopping = 1;
  pthread_cond_broadcast(&pool->wake);
  pthread_mutex_unlock(&pool->lock);
  for (int i = 0; i < pool->count; i++) {
    pthread_join(pool->threads[i], NULL);
  }
  free(pool);
}
