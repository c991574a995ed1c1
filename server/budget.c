#include "budget.h"

#include <pthread.h>
#include <stdlib.h>

/* Bytes of memory per byte of the file. FILE_BYTES: real files take up to 5.4 in the budget of the check, and its
 * process takes some more. A larger figure would let fewer checks run side by side. */
enum { FILE_BASE = 4 << 20, FILE_BYTES = 9, DENSEST_BYTES = 200 };
/* Filling holes makes up to 24 triangles for each edge of a hole, of which a file has one in 4 bytes, and 131,072 in
 * all. Each takes 1.2 KB while the fill is made fair. */
enum { FILL_BYTES = 7200, FILL_MOST = 160 << 20 };

struct memory_budget {
  pthread_mutex_t lock;
  pthread_cond_t freed;
  int64_t most[BUDGET_PARTS], taken[BUDGET_PARTS];      /* by part */
  unsigned shortages[BUDGET_PARTS], told[BUDGET_PARTS]; /* told: how many there were when the listeners were called */
  struct {
    void (*freed)(void *user);
    void *user;
  } listeners[BUDGET_LISTENERS];
  int listener_count;
};

memory_budget *budget_create(int64_t job_memory) {
  memory_budget *b = calloc(1, sizeof *b);
  if (b) {
    b->most[BUDGET_JOBS] = job_memory;
    b->most[BUDGET_CHECKS] = job_memory / 2;
    b->most[BUDGET_SMALL] = job_memory / 4;
    pthread_mutex_init(&b->lock, NULL);
    pthread_cond_init(&b->freed, NULL);
  }
  return b;
}

void budget_destroy(memory_budget *b) {
  if (b) {
    pthread_mutex_destroy(&b->lock);
    pthread_cond_destroy(&b->freed);
  }
  free(b);
}

void budget_listen(memory_budget *b, void (*freed)(void *user), void *user) {
  b->listeners[b->listener_count].freed = freed;
  b->listeners[b->listener_count++].user = user;
}

int64_t budget_most(const memory_budget *b, budget_part part) {
  return b->most[part];
}

static int has_room(memory_budget *b, budget_part part, int64_t bytes) {
  int room = bytes <= b->most[part] - b->taken[part];
  b->shortages[part] += !room;
  return room;
}

int budget_has_room(memory_budget *b, budget_part part, int64_t bytes) {
  pthread_mutex_lock(&b->lock);
  int room = has_room(b, part, bytes);
  pthread_mutex_unlock(&b->lock);
  return room;
}

int64_t budget_left(memory_budget *b, budget_part part) {
  pthread_mutex_lock(&b->lock);
  int64_t left = b->most[part] - b->taken[part];
  pthread_mutex_unlock(&b->lock);
  return left;
}

int budget_take(memory_budget *b, budget_part part, int64_t bytes) {
  pthread_mutex_lock(&b->lock);
  int room = has_room(b, part, bytes);
  b->taken[part] += room ? bytes : 0;
  pthread_mutex_unlock(&b->lock);
  return room;
}

unsigned budget_shortages(memory_budget *b, budget_part part) {
  pthread_mutex_lock(&b->lock);
  unsigned shortages = b->shortages[part];
  pthread_mutex_unlock(&b->lock);
  return shortages;
}

void budget_wait(memory_budget *b, budget_part part, int64_t bytes) {
  pthread_mutex_lock(&b->lock);
  while (!has_room(b, part, bytes)) {
    pthread_cond_wait(&b->freed, &b->lock);
  }
  b->taken[part] += bytes;
  pthread_mutex_unlock(&b->lock);
}

void budget_give(memory_budget *b, budget_part part, int64_t bytes, const void *self) {
  pthread_mutex_lock(&b->lock);
  b->taken[part] -= bytes;
  pthread_cond_broadcast(&b->freed);
  int wanted = b->shortages[part] != b->told[part];
  b->told[part] = b->shortages[part];
  pthread_mutex_unlock(&b->lock);
  for (int i = 0; i < b->listener_count && wanted; i++) {
    if (b->listeners[i].user != self) {
      b->listeners[i].freed(b->listeners[i].user);
    }
  }
}

static int64_t for_file(const memory_budget *b, budget_part part, int64_t bytes, int64_t multiple, int64_t more) {
  const int64_t most = b->most[part], base = FILE_BASE + more;
  return most <= base || bytes > (most - base) / multiple ? most : base + multiple * bytes;
}

int64_t budget_for_file(const memory_budget *b, budget_part part, int64_t bytes) {
  return for_file(b, part, bytes, FILE_BYTES, 0);
}

int64_t budget_for_densest_file(const memory_budget *b, budget_part part, int64_t bytes, int fills) {
  const int64_t fill = bytes < FILL_MOST / FILL_BYTES ? FILL_BYTES * bytes : FILL_MOST;
  return for_file(b, part, bytes, DENSEST_BYTES, fills ? fill : 0);
}
