#include "http/encoded.h"

#include <pthread.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hash.h"
#include "http/regions.h"

enum { BUCKETS = 1024, TAG_ROOM = 96, OVERHEAD = 256 };

typedef struct item {
  encoded entry; /* first: pointers to it are pointers to the item */
  char tag[TAG_ROOM];
  coding which;
  encoded_cache *of;
  struct item *next_hash, *newer, *older;
  int refs;
  int64_t counted; /* bytes of the budget */
} item;

struct encoded_cache {
  pthread_mutex_t lock;
  size_t max_bytes, bytes;
  held *budget;
  item *buckets[BUCKETS], *newest, *oldest;
};

static item **bucket(encoded_cache *c, const char *tag, coding which) {
  return &c->buckets[(keyed_hash(tag, strlen(tag)) + (uint64_t)which) % BUCKETS];
}

static void unref(item *it) {
  if (--it->refs == 0) {
    if (!region_free(it->entry.bytes)) {
      free(it->entry.bytes);
    }
    held_give(it->of->budget, HELD_KEPT, it->counted);
    free(it);
  }
}

static void unlink_order(encoded_cache *c, item *it) {
  *(it->newer ? &it->newer->older : &c->newest) = it->older;
  *(it->older ? &it->older->newer : &c->oldest) = it->newer;
}

static void link_newest(encoded_cache *c, item *it) {
  it->newer = NULL;
  it->older = c->newest;
  *(c->newest ? &c->newest->newer : &c->oldest) = it;
  c->newest = it;
}

static void drop(encoded_cache *c, item *it) {
  item **at = bucket(c, it->tag, it->which);
  while (*at != it) {
    at = &(*at)->next_hash;
  }
  *at = it->next_hash;
  unlink_order(c, it);
  c->bytes -= it->entry.size + OVERHEAD;
  unref(it);
}

/* Drops the least recently sent answers. What is being sent is freed after that. */
static void give_way(void *user, int64_t bytes) {
  encoded_cache *c = user;
  pthread_mutex_lock(&c->lock);
  while (bytes > 0 && c->oldest) {
    bytes -= c->oldest->refs == 1 ? c->oldest->counted : 0;
    drop(c, c->oldest);
  }
  pthread_mutex_unlock(&c->lock);
}

encoded_cache *encoded_open(size_t max_bytes, held *budget) {
  encoded_cache *c = calloc(1, sizeof *c);
  if (c) {
    pthread_mutex_init(&c->lock, NULL);
    c->max_bytes = max_bytes;
    c->budget = budget;
  }
  if (c && budget) {
    held_on_lack(budget, give_way, c);
  }
  return c;
}

static item *find(encoded_cache *c, const char *tag, coding which) {
  item *it = *bucket(c, tag, which);
  while (it && (it->which != which || strcmp(it->tag, tag) != 0)) {
    it = it->next_hash;
  }
  return it;
}

static const encoded *take(encoded_cache *c, item *it) {
  it->refs++;
  unlink_order(c, it);
  link_newest(c, it);
  return &it->entry;
}

const encoded *encoded_find(encoded_cache *c, const char *tag, coding which) {
  pthread_mutex_lock(&c->lock);
  item *it = find(c, tag, which);
  const encoded *found = it ? take(c, it) : NULL;
  pthread_mutex_unlock(&c->lock);
  return found;
}

/* Leaves entry->bytes NULL if out of memory. */
static void fill(encoded *entry, coding which, const void *bytes, size_t size) {
  void *packed = NULL;
  if (which != CODING_NONE && encode_bytes(which, bytes, size, 0, &packed, &size)) {
    bytes = packed;
  } else if (which != CODING_NONE) {
    return;
  }
  *entry = (encoded){region_make(bytes, size), size};
  if (!entry->bytes && packed) {
    entry->bytes = packed;
    return;
  }
  if (!entry->bytes && (entry->bytes = malloc(size))) {
    memcpy(entry->bytes, bytes, size);
  }
  free(packed);
}

const encoded *encoded_make(encoded_cache *c, const char *tag, coding which, const void *bytes, size_t size) {
  const encoded *found = encoded_find(c, tag, which);
  if (found) {
    return found;
  }
  const int64_t most = bytes ? (int64_t)size : 0; /* compressed it has fewer */
  if (!held_take(c->budget, HELD_KEPT, most)) {
    return NULL;
  }
  item *it = calloc(1, sizeof *it);
  if (!it) {
    held_give(c->budget, HELD_KEPT, most);
    return NULL;
  }
  if (bytes) {
    fill(&it->entry, which, bytes, size);
  }
  if (!it->entry.bytes) {
    it->entry.size = 0;
  }
  it->counted = (int64_t)it->entry.size;
  held_give(c->budget, HELD_KEPT, most - it->counted);
  snprintf(it->tag, sizeof it->tag, "%s", tag);
  it->which = which;
  it->of = c;
  it->refs = 1;
  pthread_mutex_lock(&c->lock);
  item *there = find(c, it->tag, which);
  if (there) { /* another thread was faster */
    unref(it);
    found = take(c, there);
  } else {
    item **at = bucket(c, it->tag, which);
    it->next_hash = *at;
    *at = it;
    link_newest(c, it);
    c->bytes += it->entry.size + OVERHEAD;
    it->refs++;
    found = &it->entry;
    while (c->bytes > c->max_bytes && c->oldest) {
      drop(c, c->oldest);
    }
  }
  pthread_mutex_unlock(&c->lock);
  return found;
}

void encoded_release(const encoded *e) {
  item *it = (item *)(uintptr_t)e;
  if (it) {
    encoded_cache *c = it->of;
    pthread_mutex_lock(&c->lock);
    unref(it);
    pthread_mutex_unlock(&c->lock);
  }
}

void encoded_close(encoded_cache *c) {
  while (c && c->oldest) {
    drop(c, c->oldest);
  }
  if (c) {
    pthread_mutex_destroy(&c->lock);
  }
  free(c);
}
