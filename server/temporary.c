#include "temporary.h"

#include <pthread.h>
#include <stdlib.h>

enum { BUCKETS = 256 };

/* One that has files. */
typedef struct owner {
  uint64_t hash;
  int64_t bytes;
  struct owner *next; /* in its bucket */
} owner;

struct temporary {
  pthread_mutex_t lock;
  int64_t bytes;
  owner *owners[BUCKETS];
};

temporary_limits temporary_limits_of(uint64_t free_bytes, int64_t reserve, int64_t largest) {
  const uint64_t room = free_bytes > (uint64_t)reserve ? free_bytes - (uint64_t)reserve : 0;
  return (temporary_limits){.room = room < INT64_MAX ? (int64_t)room : INT64_MAX,
                            .most = largest < INT64_MAX / 2 ? 2 * largest : INT64_MAX};
}

temporary *temporary_create(void) {
  temporary *t = calloc(1, sizeof *t);
  if (t) {
    pthread_mutex_init(&t->lock, NULL);
  }
  return t;
}

void temporary_destroy(temporary *t) {
  if (t) {
    pthread_mutex_destroy(&t->lock); /* without files there are no owners */
  }
  free(t);
}

/* Under the lock: where the owner is, or a new one goes. */
static owner **place_of(temporary *t, uint64_t hash) {
  owner **at = &t->owners[hash % BUCKETS];
  while (*at && (*at)->hash != hash) {
    at = &(*at)->next;
  }
  return at;
}

/* Under the lock. Were the owner's other files deleted, the disk would have so much more room. */
static temporary_room look(temporary *t, const temporary_file *file, int64_t bytes, const temporary_limits *limits) {
  const owner *who = *place_of(t, file->owner);
  const int64_t others = (who ? who->bytes : 0) - file->bytes, wanted = file->bytes + bytes,
                room = limits->room - bytes, most = limits->most;
  if (others + wanted <= room && (most == 0 || others + wanted <= most)) {
    return TEMPORARY_FREE;
  }
  return wanted <= room + others && (most == 0 || wanted <= most) ? TEMPORARY_OTHERS : TEMPORARY_FULL;
}

temporary_room temporary_look(temporary *t, const temporary_file *file, int64_t bytes, const temporary_limits *limits) {
  pthread_mutex_lock(&t->lock);
  const temporary_room room = look(t, file, bytes, limits);
  pthread_mutex_unlock(&t->lock);
  return room;
}

/* Under the lock. 0: out of memory. */
static int add(temporary *t, temporary_file *file, int64_t bytes) {
  owner **at = place_of(t, file->owner);
  if (!*at && !(*at = calloc(1, sizeof **at))) {
    return 0;
  }
  (*at)->hash = file->owner;
  (*at)->bytes += bytes;
  file->bytes += bytes;
  t->bytes += bytes;
  return 1;
}

temporary_room temporary_take(temporary *t, temporary_file *file, int64_t bytes, const temporary_limits *limits) {
  if (bytes <= 0) {
    return TEMPORARY_FREE;
  }
  pthread_mutex_lock(&t->lock);
  temporary_room room = look(t, file, bytes, limits);
  if (room == TEMPORARY_FREE && !add(t, file, bytes)) {
    room = TEMPORARY_OTHERS;
  }
  pthread_mutex_unlock(&t->lock);
  return room;
}

void temporary_give(temporary *t, temporary_file *file) {
  if (file->bytes == 0) {
    return;
  }
  pthread_mutex_lock(&t->lock);
  owner **at = place_of(t, file->owner), *who = *at;
  t->bytes -= file->bytes;
  who->bytes -= file->bytes;
  if (who->bytes == 0) {
    *at = who->next;
    free(who);
  }
  pthread_mutex_unlock(&t->lock);
  file->bytes = 0;
}

int64_t temporary_bytes(temporary *t) {
  pthread_mutex_lock(&t->lock);
  const int64_t bytes = t->bytes;
  pthread_mutex_unlock(&t->lock);
  return bytes;
}
