#include "store/marks.h"

#include <pthread.h>
#include <stddef.h>
#include <stdlib.h>

/* Open addressing; 0 marks a free slot, so the hash 0 is stored as 1. At most half of the slots are used. */
struct marks {
  pthread_rwlock_t lock;
  uint64_t *slots;
  size_t room, used; /* room: a power of two */
};

marks *marks_create(void) {
  marks *m = calloc(1, sizeof *m);
  if (m) {
    pthread_rwlock_init(&m->lock, NULL);
  }
  return m;
}

void marks_destroy(marks *m) {
  if (m) {
    pthread_rwlock_destroy(&m->lock);
    free(m->slots);
  }
  free(m);
}

/* The slot of the hash, or the free one where it belongs. */
static uint64_t *find(uint64_t *slots, size_t room, uint64_t hash) {
  size_t at = (size_t)hash & (room - 1);
  while (slots[at] && slots[at] != hash) {
    at = (at + 1) & (room - 1);
  }
  return &slots[at];
}

static int grow(marks *m) {
  size_t room = m->room ? 2 * m->room : 1024;
  uint64_t *slots = calloc(room, sizeof *slots);
  for (size_t i = 0; slots && i < m->room; i++) {
    if (m->slots[i]) {
      *find(slots, room, m->slots[i]) = m->slots[i];
    }
  }
  if (slots) {
    free(m->slots);
    m->slots = slots;
    m->room = room;
  }
  return slots != NULL;
}

void marks_add(marks *m, uint64_t hash) {
  hash = hash ? hash : 1;
  pthread_rwlock_wrlock(&m->lock);
  if (2 * (m->used + 1) <= m->room || grow(m)) {
    uint64_t *slot = find(m->slots, m->room, hash);
    m->used += *slot == 0;
    *slot = hash;
  }
  pthread_rwlock_unlock(&m->lock);
}

int marks_have(marks *m, uint64_t hash) {
  pthread_rwlock_rdlock(&m->lock);
  int have = m->room && *find(m->slots, m->room, hash ? hash : 1);
  pthread_rwlock_unlock(&m->lock);
  return have;
}
