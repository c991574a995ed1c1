#include "tasks.h"

#include <pthread.h>
#include <stdlib.h>

#include "orbmorph/context.h"
#include "wake.h"

enum { TURNS = 256 };   /* owners whose hashes agree modulo this share their turns */
enum { LOOK_MS = 500 }; /* how soon a task that waits for memory ends once it is no longer wanted */

struct tasks {
  pthread_mutex_t lock;
  pthread_cond_t wake;
  task *first, **last;
  struct turn {
    int64_t used_ms;
    int running, unfinished;
  } turns[TURNS];
  memory_budget *memory; /* may be NULL */
  budget_claim claim;    /* of the oldest task that waits for other parts of the budget */
  int lacking;           /* a task waits for memory */
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

static budget_room room_for(tasks *pool, task *t) {
  if (!pool->memory || t->memory == 0) {
    return BUDGET_FREE;
  }
  const budget_room room = budget_look(pool->memory, t->part, t->memory, &pool->claim);
  if (room == BUDGET_FREE || !t->is_wanted || t->is_wanted(t)) {
    return room;
  }
  t->memory = 0;
  return BUDGET_FREE;
}

/* A thread is free: claims the memory of this task. NULL: none waits. */
static void claim_memory(tasks *pool, const task *t) {
  if (pool->memory && (t || pool->claim.bytes > 0)) {
    budget_claim_bytes(pool->memory, &pool->claim, t ? t->memory : 0);
  }
}

/* Takes the next task out of the list, with its memory; NULL: there is none, or none has memory now. O(waiting tasks).
 */
static task *choose(tasks *pool) {
  task **best = NULL;
  const task *waiting = NULL; /* the oldest for which others hold the memory */
  pool->lacking = 0;
  for (task **at = &pool->first; *at; at = &(*at)->next) {
    const budget_room room = room_for(pool, *at);
    const struct turn *a = turn_of(pool, *at), *b = best ? turn_of(pool, *best) : NULL;
    if (room != BUDGET_FREE) {
      pool->lacking = 1;
      waiting = !waiting && room == BUDGET_OTHERS && (*at)->part == pool->claim.part ? *at : waiting;
    } else if (!b || a->running < b->running || (a->running == b->running && a->used_ms < b->used_ms)) {
      best = at;
    }
  }
  task *t = best ? *best : NULL;
  if (t && pool->memory && t->memory > 0 &&
      budget_take(pool->memory, t->part, t->memory, &pool->claim) != BUDGET_FREE) {
    t = NULL; /* others took it just now, and wake this pool when they end */
  }
  claim_memory(pool, t ? NULL : waiting);
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
  } else if (pool->memory) {
    budget_tell(pool->memory, NULL); /* it may have claimed memory until it was no longer wanted */
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
    if (!t && pool->lacking) {
      wake_wait_ms(&pool->wake, &pool->lock, LOOK_MS);
      continue;
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
  pool->claim.part = BUDGET_CHECKS;
  pthread_mutex_init(&pool->lock, NULL);
  wake_init(&pool->wake);
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
