#include "tasks.h"

#include <pthread.h>
#include <stdlib.h>

#include "orbmorph/context.h"

enum { TURNS = 256 }; /* owners whose hashes agree modulo this share their turns */

struct tasks {
  pthread_mutex_t lock;
  pthread_cond_t wake;
  task *first, **last;
  struct turn {
    int64_t used_ms;
    int running, unfinished;
  } turns[TURNS];
  memory_budget *memory; /* may be NULL */
  int stopping, count;
  pthread_t threads[];
};

static struct turn *turn_of(tasks *pool, const task *t) {
  return &pool->turns[t->owner % TURNS];
}

static void enter(tasks *pool, const task *t) {
  struct turn *mine = turn_of(pool, t);
  int64_t least = -1;
  for (int i = 0; mine->unfinished == 0 && i < TURNS; i++) {
    const struct turn *other = &pool->turns[i];
    if (other->unfinished > 0 && (least < 0 || other->used_ms < least)) {
      least = other->used_ms;
    }
  }
  mine->used_ms = least > mine->used_ms ? least : mine->used_ms;
  mine->unfinished++;
}

static int has_room(tasks *pool, const task *t) {
  return !pool->memory || t->memory == 0 || budget_has_room(pool->memory, t->part, t->memory);
}

/* Takes the next task out of the list, with its memory; NULL: there is none, or none has memory now. O(waiting tasks).
 */
static task *choose(tasks *pool) {
  task **best = NULL;
  for (task **at = &pool->first; *at; at = &(*at)->next) {
    const struct turn *a = turn_of(pool, *at), *b = best ? turn_of(pool, *best) : NULL;
    if ((!b || a->running < b->running || (a->running == b->running && a->used_ms < b->used_ms)) &&
        has_room(pool, *at)) {
      best = at;
    }
  }
  task *t = best ? *best : NULL;
  if (t && pool->memory && t->memory > 0 && !budget_take(pool->memory, t->part, t->memory)) {
    t = NULL; /* others took it just now, and wake this pool when they end */
  }
  if (t) {
    *best = t->next;
    pool->last = t->next ? pool->last : best;
  }
  return t;
}

/* Under the lock, which it releases meanwhile. */
static void run(tasks *pool, task *t) {
  struct turn *turn = turn_of(pool, t);
  const budget_part part = t->part;
  int64_t began = orb_clock_ms(), memory = t->memory;
  turn->running++;
  pthread_mutex_unlock(&pool->lock);
  t->run(t); /* may free t */
  if (pool->memory && memory > 0) {
    budget_give(pool->memory, part, memory, NULL);
  }
  pthread_mutex_lock(&pool->lock);
  turn->running--;
  turn->unfinished--;
  turn->used_ms += orb_clock_ms() - began;
}

static void memory_freed(void *user) {
  tasks *pool = user;
  pthread_mutex_lock(&pool->lock);
  if (pool->first) {
    pthread_cond_broadcast(&pool->wake);
  }
  pthread_mutex_unlock(&pool->lock);
}

static void *thread_main(void *argument) {
  tasks *pool = argument;
  pthread_mutex_lock(&pool->lock);
  for (;;) {
    task *t = choose(pool);
    if (!t && pool->stopping && !pool->first) {
      break;
    }
    if (!t) {
      pthread_cond_wait(&pool->wake, &pool->lock);
      continue;
    }
    run(pool, t);
  }
  pthread_mutex_unlock(&pool->lock);
  return NULL;
}

tasks *tasks_start(int threads, memory_budget *memory) {
  tasks *pool = calloc(1, sizeof *pool + (size_t)threads * sizeof(pthread_t));
  if (!pool) {
    return NULL;
  }
  pool->last = &pool->first;
  pool->memory = memory;
  pthread_mutex_init(&pool->lock, NULL);
  pthread_cond_init(&pool->wake, NULL);
  if (memory) {
    budget_listen(memory, memory_freed, pool);
  }
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
  enter(pool, t);
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
}

void tasks_free(tasks *pool) {
  free(pool);
}
