/* Vertices by the cost of their collapse, the cheapest at entry[0]; of equal costs the lower vertex. */
#ifndef ORB_REMESH_ADAPTIVE_HEAP_H
#define ORB_REMESH_ADAPTIVE_HEAP_H

#include "base/context.h"

typedef struct orb_heap_entry {
  double cost;
  int32_t v;
} orb_heap_entry;

typedef struct orb_heap {
  orb_heap_entry *entry;
  double *cost;  /* per vertex: the last cost that it was put with */
  int32_t *slot; /* per vertex: its index in the heap, −1: not in it */
  int32_t count;
} orb_heap;

/* Allocates an empty heap; the costs are the caller's to fill. 0: no memory. Call orb_heap_close() in any case. */
int orb_heap_open(orb_context *ctx, orb_heap *h, int32_t vertices);
void orb_heap_close(orb_context *ctx, orb_heap *h);

/* Puts a vertex in, or moves it to its new cost; takes it out if the cost is infinite. O(log V). */
void orb_heap_put(orb_heap *h, int32_t v, double cost);
/* Takes a vertex out; one that is not in the heap stays out. O(log V). */
void orb_heap_remove(orb_heap *h, int32_t v);

#endif
