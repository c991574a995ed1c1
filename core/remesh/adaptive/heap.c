#include "remesh/adaptive/heap.h"

#include <math.h>

#include "base/memory.h"

enum { WAYS = 4 }; /* children of an entry: a flatter heap than a binary one, faster in the cache */

int orb_heap_open(orb_context *ctx, orb_heap *h, int32_t vertices) {
  *h = (orb_heap){.entry = ORB_NEW(ctx, orb_heap_entry, vertices),
                  .cost = ORB_NEW(ctx, double, vertices),
                  .slot = ORB_NEW(ctx, int32_t, vertices)};
  for (int32_t v = 0; h->slot && v < vertices; v++) {
    h->slot[v] = -1;
  }
  return h->entry && h->cost && h->slot;
}

void orb_heap_close(orb_context *ctx, orb_heap *h) {
  orb_free(ctx, h->entry);
  orb_free(ctx, h->cost);
  orb_free(ctx, h->slot);
}

static int is_less(orb_heap_entry a, orb_heap_entry b) {
  return a.cost < b.cost || (a.cost == b.cost && a.v < b.v);
}

static void set(orb_heap *h, int32_t i, orb_heap_entry entry) {
  h->entry[i] = entry;
  h->slot[entry.v] = i;
}

/* Puts an entry at index i, which is free, or higher or lower. */
static void sift(orb_heap *h, int32_t i, orb_heap_entry entry) {
  int32_t begin = i;
  for (int32_t above; i > 0 && is_less(entry, h->entry[above = (i - 1) / WAYS]); i = above) {
    set(h, i, h->entry[above]);
  }
  while (i >= begin) {
    int32_t first = WAYS * i + 1, least = first;
    if (first >= h->count) {
      break;
    }
    int32_t last = first + WAYS < h->count ? first + WAYS : h->count;
    for (int32_t k = first + 1; k < last; k++) {
      least = is_less(h->entry[k], h->entry[least]) ? k : least;
    }
    if (!is_less(h->entry[least], entry)) {
      break;
    }
    set(h, i, h->entry[least]);
    i = least;
  }
  set(h, i, entry);
}

void orb_heap_remove(orb_heap *h, int32_t v) {
  int32_t i = h->slot[v];
  if (i < 0) {
    return;
  }
  h->slot[v] = -1;
  orb_heap_entry last = h->entry[--h->count];
  if (i < h->count) {
    sift(h, i, last);
  }
}

void orb_heap_put(orb_heap *h, int32_t v, double cost) {
  if (h->slot[v] >= 0 && h->cost[v] == cost) {
    return;
  }
  h->cost[v] = cost;
  if (!(cost < INFINITY)) {
    orb_heap_remove(h, v);
    return;
  }
  sift(h, h->slot[v] < 0 ? h->count++ : h->slot[v], (orb_heap_entry){cost, v});
}
