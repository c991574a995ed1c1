#include "cache.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hash.h"

enum { BUCKETS = 4096 };

typedef struct item {
  cached entry; /* first: pointers to it are pointers to the item */
  struct item *next_hash, *newer, *older;
  int refs, linked;
  int64_t used; /* last use recorded in the catalogue */
} item;

struct cache {
  pthread_mutex_t lock;
  size_t max_bytes, bytes;
  unsigned long long drops;
  item *buckets[BUCKETS], *newest, *oldest;
};

cache *cache_create(size_t max_bytes) {
  cache *c = calloc(1, sizeof *c);
  if (c) {
    pthread_mutex_init(&c->lock, NULL);
    c->max_bytes = max_bytes;
  }
  return c;
}

static item **bucket(cache *c, resource_kind kind, const char *id) {
  return &c->buckets[(keyed_hash(id, strlen(id)) + (uint64_t)kind) % BUCKETS];
}

static void unref(item *it) {
  if (--it->refs == 0) {
    free(it->entry.row.json);
    free(it->entry.header);
    free(it);
  }
}

static void unlink_order(cache *c, item *it) {
  *(it->newer ? &it->newer->older : &c->newest) = it->older;
  *(it->older ? &it->older->newer : &c->oldest) = it->newer;
}

static void link_newest(cache *c, item *it) {
  it->newer = NULL;
  it->older = c->newest;
  *(c->newest ? &c->newest->newer : &c->oldest) = it;
  c->newest = it;
}

static void drop(cache *c, item *it) {
  for (item **at = bucket(c, it->entry.row.kind, it->entry.row.id); *at; at = &(*at)->next_hash) {
    if (*at == it) {
      *at = it->next_hash;
      break;
    }
  }
  unlink_order(c, it);
  c->bytes -= it->entry.json_size;
  it->linked = 0;
  unref(it);
}

/* tenant NULL: any tenant. */
static item *find(cache *c, resource_kind kind, const char *id, const char *tenant) {
  item *it = *bucket(c, kind, id);
  while (it && (it->entry.row.kind != kind || strcmp(it->entry.row.id, id) != 0 ||
                (tenant && strcmp(it->entry.tenant, tenant) != 0))) {
    it = it->next_hash;
  }
  return it;
}

const cached *cache_find(cache *c, resource_kind kind, const char *id, const char *tenant) {
  pthread_mutex_lock(&c->lock);
  item *it = find(c, kind, id, tenant);
  if (it) {
    it->refs++;
    unlink_order(c, it);
    link_newest(c, it);
  }
  pthread_mutex_unlock(&c->lock);
  return it ? &it->entry : NULL;
}

unsigned long long cache_drops(cache *c) {
  pthread_mutex_lock(&c->lock);
  unsigned long long drops = c->drops;
  pthread_mutex_unlock(&c->lock);
  return drops;
}

const cached *cache_add(cache *c, resource *row, const char *tenant, unsigned long long since) {
  item *it = calloc(1, sizeof *it);
  if (!it) {
    resource_free(row);
    return NULL;
  }
  char hash[API_ID_SIZE];
  it->entry.row = *row;
  snprintf(it->entry.tenant, sizeof it->entry.tenant, "%s", tenant);
  row->json = NULL;
  it->entry.json_size = strlen(it->entry.row.json);
  api_id_of_text(it->entry.row.json, it->entry.json_size, hash);
  snprintf(it->entry.etag, sizeof it->entry.etag, "\"%.32s\"", hash);
  it->refs = 1;
  pthread_mutex_lock(&c->lock);
  if (c->drops != since) {
    pthread_mutex_unlock(&c->lock);
    return &it->entry;
  }
  it->refs = 2;
  it->linked = 1;
  item *there = find(c, row->kind, row->id, tenant);
  if (there) {
    drop(c, there);
  }
  item **at = bucket(c, row->kind, row->id);
  it->next_hash = *at;
  *at = it;
  link_newest(c, it);
  c->bytes += it->entry.json_size;
  while (c->bytes > c->max_bytes && c->oldest != it) {
    drop(c, c->oldest);
  }
  pthread_mutex_unlock(&c->lock);
  return &it->entry;
}

int cache_note_use(cache *c, const cached *entry, int64_t now) {
  item *it = (item *)(uintptr_t)entry;
  pthread_mutex_lock(&c->lock);
  int due = it->used == 0 || now - it->used >= 1000;
  if (due) {
    it->used = now;
  }
  pthread_mutex_unlock(&c->lock);
  return due;
}

const char *cache_header(const cached *entry) {
  return __atomic_load_n(&entry->header, __ATOMIC_ACQUIRE);
}

const char *cache_keep_header(const cached *entry, const char *text) {
  item *it = (item *)(uintptr_t)entry;
  char *copy = strdup(text), *there = NULL;
  if (copy && !__atomic_compare_exchange_n(&it->entry.header, &there, copy, 0, __ATOMIC_ACQ_REL, __ATOMIC_ACQUIRE)) {
    free(copy);
    copy = there;
  }
  return copy;
}

void cache_release(cache *c, const cached *entry) {
  if (entry) {
    pthread_mutex_lock(&c->lock);
    unref((item *)(uintptr_t)entry);
    pthread_mutex_unlock(&c->lock);
  }
}

void cache_drop(cache *c, resource_kind kind, const char *id) {
  pthread_mutex_lock(&c->lock);
  item *it;
  c->drops++;
  while ((it = find(c, kind, id, NULL))) {
    drop(c, it);
  }
  pthread_mutex_unlock(&c->lock);
}

void cache_drop_all(cache *c) {
  pthread_mutex_lock(&c->lock);
  c->drops++;
  while (c->oldest) {
    drop(c, c->oldest);
  }
  pthread_mutex_unlock(&c->lock);
}

void cache_destroy(cache *c) {
  while (c && c->oldest) {
    drop(c, c->oldest);
  }
  free(c);
}
