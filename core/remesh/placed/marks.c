#include "remesh/placed/marks.h"

#include "base/parallel.h"

enum { GRAIN = 512 }; /* vertices a thread takes at a time */

static uint64_t mark_of(const orb_net *net, int32_t v) {
  return orb_mark_of_point(orb_net_point(net, v));
}

static uint64_t mark_of_ring(const orb_net *net, int32_t v) {
  uint64_t sum = 0;
  int32_t first = net->out[v], h = first;
  do {
    sum += mark_of(net, net->triangles[orb_next(h)]);
    h = net->twin[orb_prev(h)];
  } while (h != first);
  return sum;
}

uint64_t orb_mark_of_surroundings(const orb_net *net, const uint64_t *ring, int32_t v) {
  uint64_t sum = 0;
  int32_t first = net->out[v], h = first;
  do {
    const int32_t w = net->triangles[orb_next(h)];
    sum += mark_of(net, w) * 3 + ring[w];
    h = net->twin[orb_prev(h)];
  } while (h != first);
  return sum;
}

typedef struct filling {
  const orb_net *net;
  uint64_t *ring;
} filling;

static void fill_range(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  const filling *all = arg;
  for (int64_t v = begin; v < end; v++) {
    if (all->net->out[v] >= 0) {
      all->ring[v] = mark_of_ring(all->net, (int32_t)v);
    }
  }
}

void orb_marks_of_rings(orb_context *ctx, const orb_net *net, uint64_t *ring) {
  filling all = {net, ring};
  orb_parallel_for(ctx, net->vertex_count, GRAIN, fill_range, &all);
}

/* All neighbours of u lose it. */
static void leave(const orb_net *net, uint64_t *ring, int32_t u, const int32_t *neighbour, int n) {
  const uint64_t own = mark_of(net, u);
  for (int i = 0; i < n; i++) {
    ring[neighbour[i]] -= own;
  }
}

/* The two beside number `at` are its neighbours already, and no others. */
void orb_marks_collapse(const orb_net *net, uint64_t *ring, int32_t u, const int32_t *neighbour, int n, int at) {
  const int32_t heir = neighbour[at];
  leave(net, ring, u, neighbour, n);
  for (int i = 2; i + 1 < n; i++) {
    const int32_t w = neighbour[(at + i) % n];
    ring[w] += mark_of(net, heir);
    ring[heir] += mark_of(net, w);
  }
}

/* The edges inside the hole are new, each in both directions. */
void orb_marks_fill(const orb_net *net, uint64_t *ring, int32_t u, const int32_t *neighbour, int n,
                    int (*triangles)[3]) {
  leave(net, ring, u, neighbour, n);
  for (int t = 0; t < n - 2; t++) {
    for (int k = 0; k < 3; k++) {
      const int a = triangles[t][k], b = triangles[t][(k + 1) % 3];
      if (b != (a + 1) % n) {
        ring[neighbour[a]] += mark_of(net, neighbour[b]);
      }
    }
  }
}
