/* Two neighbours become one vertex between them, with as many edge flips around as necessary (star.h). Succeeds where
 * neither can move onto the other. */
#include "remesh/adaptive/merge.h"

#include "base/check.h"
#include "base/memory.h"
#include "base/parallel.h"
#include "numeric/vec3.h"
#include "remesh/adaptive/star.h"
#include "remesh/placed/marks.h"

enum { STAR_MAX = 16 }; /* vertices with more neighbours do not merge; the size of an array on the stack */
enum { GRAIN = 64 };    /* vertices a thread takes at a time */

/* The triangles around u, then the others around v; returns how many, 0 if too many. */
static int stars_of(const orb_net *net, int32_t u, int32_t v, int32_t triangles[2 * STAR_MAX]) {
  int n = 0;
  int32_t ends[2] = {u, v};
  for (int i = 0; i < 2; i++) {
    int32_t first = net->out[ends[i]], h = first;
    int count = 0;
    do {
      if (++count > STAR_MAX) {
        return 0;
      }
      const int32_t *c = net->triangles + (h - h % 3);
      if (i == 0 || (c[0] != u && c[1] != u && c[2] != u)) {
        triangles[n++] = h / 3;
      }
      h = net->twin[orb_prev(h)];
    } while (h != first);
  }
  return n;
}

/* Merges u and v if that is possible; thread ≥ 0: only tests it. */
static int try_merge(orb_placed_net *placed, int32_t u, int32_t v, double limit2, int thread) {
  static const double way[] = {0.5, 0.25, 0.75, 0, 1}; /* from u to v, tried in this order */
  enum { POINTS = sizeof way / sizeof *way };
  const orb_star_wish wish = {limit2, 2, 4, ORB_STAR_NOT_WORSE}; /* inside: u, v and at most two more */
  const double *a = orb_net_point(&placed->net, u), *b = orb_net_point(&placed->net, v);
  int32_t triangles[2 * STAR_MAX];
  double points[POINTS][3];
  for (int i = 0; i < POINTS; i++) {
    for (int k = 0; k < 3; k++) {
      points[i][k] = a[k] + way[i] * (b[k] - a[k]);
    }
    (void)orb_normalize(points[i]);
  }
  int n = stars_of(&placed->net, u, v, triangles);
  const double(*all)[3] = (const double(*)[3])points;
  return n > 0 && (thread < 0 ? orb_adaptive_star(placed, triangles, n, all, POINTS, &wish)
                              : orb_adaptive_can_star(placed, triangles, n, all, POINTS, &wish, thread));
}

static int merge_one(orb_placed_net *placed, int32_t u, double limit2, int thread) {
  const orb_net *net = &placed->net;
  int32_t first = net->out[u], h = first;
  do {
    int32_t v = net->triangles[orb_next(h)];
    if (u < v && !placed->fixed[v] && try_merge(placed, u, v, limit2, thread)) {
      return 1;
    }
    h = net->twin[orb_prev(h)];
  } while (h != first);
  return 0;
}

/* Covers what the search depends on, except what lies beyond the neighbours' neighbours. */
static uint64_t mark_of(const orb_placed_net *placed, int32_t u, double limit2) {
  uint64_t mark = orb_mark_mix(1, &limit2, sizeof limit2), sum = orb_mark_of_surroundings(&placed->net, u);
  mark = orb_mark_mix(mark, &sum, sizeof sum);
  return mark ? mark : 1;
}

typedef struct merge_loop {
  orb_placed_net *placed;
  double limit2;
  unsigned char *can; /* per vertex: it can merge with a neighbour */
} merge_loop;

static void find_range(void *arg, int64_t begin, int64_t end, int thread) {
  merge_loop *loop = arg;
  orb_placed_net *placed = loop->placed;
  for (int64_t i = begin; i < end; i++) {
    int32_t u = (int32_t)i;
    loop->can[u] = 0;
    if (placed->net.out[u] < 0 || placed->fixed[u]) {
      continue;
    }
    uint64_t mark = mark_of(placed, u, loop->limit2);
    if (placed->no_merge[u] != mark) {
      loop->can[u] = (unsigned char)merge_one(placed, u, loop->limit2, thread);
      placed->no_merge[u] = loop->can[u] ? 0 : mark;
    }
  }
}

orb_status orb_adaptive_merge_all(orb_context *ctx, orb_placed_net *placed, double limit2, int64_t target) {
  int32_t n = placed->net.vertex_count;
  int64_t live = orb_placed_live(placed);
  merge_loop loop = {placed, limit2, ORB_NEW(ctx, unsigned char, n)};
  orb_status status = loop.can ? orb_placed_reserve(ctx, placed, orb_threads(ctx)) : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    orb_parallel_for(ctx, n, GRAIN, find_range, &loop);
    status = orb_context_check(ctx);
  }
  for (int32_t u = 0; u < n && status == ORB_OK && live > target && live > 4; u++) {
    if (loop.can[u] && placed->net.out[u] >= 0) {
      live -= 2 * merge_one(placed, u, limit2, -1);
      status = orb_context_check(ctx);
    }
  }
  orb_free(ctx, loop.can);
  return status;
}
