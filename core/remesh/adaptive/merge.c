/* Two neighbours become one vertex, between them, with as many turned edges around as it takes (see match_star.c):
 * finds room where neither can move onto the other. */
#include <string.h>

#include "base/check.h"
#include "numeric/vec3.h"
#include "remesh/adaptive/match.h"

enum { STAR_MAX = 16 };

/* The triangles around u, then those around v that are not; 0: too many. */
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

/* Merges u and v, or with thread ≥ 0 only tells whether they can be. */
static int try_merge(orb_match *match, int32_t u, int32_t v, double limit2, int thread) {
  static const double way[] = {0.5, 0.25, 0.75, 0, 1};
  enum { POINTS = sizeof way / sizeof *way };
  const orb_star_wish wish = {limit2, 2, 4, ORB_STAR_NOT_WORSE};
  const double *a = orb_net_point(&match->net, u), *b = orb_net_point(&match->net, v);
  int32_t triangles[2 * STAR_MAX];
  double points[POINTS][3];
  for (int i = 0; i < POINTS; i++) {
    for (int k = 0; k < 3; k++) {
      points[i][k] = a[k] + way[i] * (b[k] - a[k]);
    }
    (void)orb_normalize(points[i]);
  }
  int n = stars_of(&match->net, u, v, triangles);
  const double(*all)[3] = (const double(*)[3])points;
  return n > 0 && (thread < 0 ? orb_match_star(match, triangles, n, all, POINTS, &wish)
                              : orb_match_can_star(match, triangles, n, all, POINTS, &wish, thread));
}

static int merge_one(orb_match *match, int32_t u, double limit2, int thread) {
  const orb_net *net = &match->net;
  int32_t first = net->out[u], h = first;
  do {
    int32_t v = net->triangles[orb_next(h)];
    if (u < v && !match->fixed[v] && try_merge(match, u, v, limit2, thread)) {
      return 1;
    }
    h = net->twin[orb_prev(h)];
  } while (h != first);
  return 0;
}

uint64_t orb_match_surroundings(const orb_match *match, int32_t v) {
  const orb_net *net = &match->net;
  uint64_t sum = 0;
  int32_t first = net->out[v], h = first;
  do {
    int32_t w = net->triangles[orb_next(h)], begin = net->out[w], e = begin;
    sum += orb_point_mark(orb_net_point(net, w)) * 3;
    do {
      sum += orb_point_mark(orb_net_point(net, net->triangles[orb_next(e)]));
      e = net->twin[orb_prev(e)];
    } while (e != begin);
    h = net->twin[orb_prev(h)];
  } while (h != first);
  return sum;
}

/* A mark of what the search depends on, but for what is farther than the neighbours' neighbours. */
static uint64_t mark_of(const orb_match *match, int32_t u, double limit2) {
  uint64_t mark = orb_mixed(1, &limit2, sizeof limit2), sum = orb_match_surroundings(match, u);
  mark = orb_mixed(mark, &sum, sizeof sum);
  return mark ? mark : 1;
}

typedef struct merge_loop {
  orb_match *match;
  double limit2;
  unsigned char *can; /* a vertex */
} merge_loop;

static void look_range(void *arg, int64_t begin, int64_t end, int thread) {
  merge_loop *loop = arg;
  orb_match *match = loop->match;
  for (int64_t i = begin; i < end; i++) {
    int32_t u = (int32_t)i;
    loop->can[u] = 0;
    if (match->net.out[u] < 0 || match->fixed[u]) {
      continue;
    }
    uint64_t mark = mark_of(match, u, loop->limit2);
    if (match->alone[u] != mark) {
      loop->can[u] = (unsigned char)merge_one(match, u, loop->limit2, thread);
      match->alone[u] = loop->can[u] ? 0 : mark;
    }
  }
}

orb_status orb_match_merge_all(orb_context *ctx, orb_match *match, double limit2, int64_t target) {
  int32_t n = match->net.vertex_count;
  int64_t live = orb_match_live(match);
  merge_loop loop = {match, limit2, ORB_NEW(ctx, unsigned char, n)};
  orb_status status = loop.can ? orb_match_reserve(ctx, match, orb_threads(ctx)) : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    orb_parallel_for(ctx, n, 64, look_range, &loop);
    status = orb_context_check(ctx);
  }
  for (int32_t u = 0; u < n && status == ORB_OK && live > target && live > 4; u++) {
    if (loop.can[u] && match->net.out[u] >= 0) {
      live -= 2 * merge_one(match, u, limit2, -1);
      status = orb_context_check(ctx);
    }
  }
  orb_free(ctx, loop.can);
  return status;
}
