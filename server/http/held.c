#include "http/held.h"

#include <pthread.h>
#include <stdlib.h>

struct held {
  pthread_mutex_t lock;
  int64_t most, all, of[HELD_OWNERS + 1];
  int64_t free, free_of[HELD_OWNERS + 1]; /* beside them */
  void (*give_way)(void *user, int64_t bytes);
  void *user;
};

held *held_create(int64_t most) {
  held *h = calloc(1, sizeof *h);
  if (h) {
    pthread_mutex_init(&h->lock, NULL);
    h->most = most;
  }
  return h;
}

void held_destroy(held *h) {
  if (h) {
    pthread_mutex_destroy(&h->lock);
  }
  free(h);
}

void held_on_lack(held *h, void (*give_way)(void *user, int64_t bytes), void *user) {
  h->give_way = give_way;
  h->user = user;
}

static uint64_t place_of(uint64_t owner) {
  return owner == HELD_KEPT ? HELD_KEPT : owner % HELD_OWNERS;
}

static int64_t *part_of(held *h, uint64_t owner) {
  return &h->of[place_of(owner)];
}

/* How many bytes are lacking to an owner that has `own` of `all`; 0 or less: none. */
static int64_t lacking(const held *h, int64_t own, int64_t all, int64_t bytes) {
  return (own + bytes + HELD_SHARE - 1) / HELD_SHARE - (h->most - all - bytes);
}

/* Takes the bytes if the result is 0. Else so many are lacking; −1: kept answers cannot make so much room. */
static int64_t try_to_take(held *h, uint64_t owner, int64_t bytes) {
  pthread_mutex_lock(&h->lock);
  int64_t *own = part_of(h, owner), kept = h->of[HELD_KEPT];
  const int64_t lacks = lacking(h, *own, h->all, bytes);
  const int never = lacking(h, owner == HELD_KEPT ? 0 : *own, h->all - kept, bytes) > 0;
  if (lacks <= 0) {
    h->all += bytes;
    *own += bytes;
  }
  pthread_mutex_unlock(&h->lock);
  return lacks <= 0 ? 0 : never ? -1 : lacks;
}

int held_take(held *h, uint64_t owner, int64_t bytes) {
  if (!h || bytes <= 0) {
    return 1;
  }
  const int64_t lacks = try_to_take(h, owner, bytes);
  if (lacks > 0 && h->give_way) {
    h->give_way(h->user, lacks);
    return try_to_take(h, owner, bytes) == 0;
  }
  return lacks == 0;
}

void held_give(held *h, uint64_t owner, int64_t bytes) {
  if (h && bytes > 0) {
    pthread_mutex_lock(&h->lock);
    h->all -= bytes;
    *part_of(h, owner) -= bytes;
    pthread_mutex_unlock(&h->lock);
  }
}

/* Changes what a part has of the allowance; 0: it has no room for so much. */
static int set_free(held *h, uint64_t owner, held_part *part, int64_t now) {
  pthread_mutex_lock(&h->lock);
  const int64_t more = now - part->free;
  int64_t *own = &h->free_of[place_of(owner)];
  const int fits = more <= 0 || (h->free + more <= h->most / HELD_FREE_ALL && *own + more <= h->most / HELD_FREE_OWN);
  if (fits) {
    h->free += more;
    *own += more;
    part->free = now;
  }
  pthread_mutex_unlock(&h->lock);
  return fits;
}

int held_set(held *h, uint64_t owner, held_part *part, int64_t now) {
  if (!h || (now == 0 && part->free == 0 && part->counted == 0)) {
    return 1;
  }
  if (now <= part->counted || now > HELD_FREE || !set_free(h, owner, part, now)) {
    if (!held_take(h, owner, now - part->counted)) {
      return 0;
    }
    held_give(h, owner, part->counted - now);
    part->counted = now;
    set_free(h, owner, part, 0);
    return 1;
  }
  held_give(h, owner, part->counted);
  part->counted = 0;
  return 1;
}

int64_t held_bytes(held *h) {
  pthread_mutex_lock(&h->lock);
  const int64_t all = h->all;
  pthread_mutex_unlock(&h->lock);
  return all;
}
