/* Around triangles that no single step mends, the overlay of the shapes is made, there only: vertices of the shapes
 * become vertices, and edges that leave a shape by more than a little are split where they cross its edges. What lies
 * in one triangle of every shape cannot be turned. Collapses then reduce it again, and leave no more turned than there
 * are. Edges outside stay as they are, so that the region does not spread. */
#include <math.h>

#include "base/check.h"
#include "base/grow.h"
#include "remesh/adaptive/edge_queue.h"
#include "remesh/adaptive/match.h"

enum { SPLITS_EACH = 64 };
static const double CLOSE = 0.1; /* of the limit: what is split no more */

typedef struct region {
  orb_context *ctx;
  orb_match *match;
  unsigned char *in; /* a triangle */
  int64_t capacity;
  orb_edge_queue queue;
} region;

static orb_status make_room(region *r) {
  int64_t need = r->match->net.triangle_count, to = need + need / 2 + 256;
  if (need > r->capacity) {
    if (!orb_regrow(r->ctx, &r->in, (size_t)to, 1)) {
      return ORB_E_NO_MEMORY;
    }
    r->capacity = to;
  }
  return ORB_OK;
}

/* A new vertex: its triangles are in the region where those were that they are parts of; its edges are to be seen. */
static orb_status take_in(region *r, int32_t v, int32_t triangles_before) {
  const orb_net *net = &r->match->net;
  ORB_TRY(make_room(r));
  for (int32_t t = triangles_before; t < net->triangle_count; t++) {
    r->in[t] = r->in[net->twin[3 * t + 2] / 3];
  }
  return orb_edge_queue_push_star(r->ctx, &r->queue, net, v);
}

/* The edge, where it is one of the region or around it; else −1. */
static int32_t edge_of(const region *r, int32_t v, int32_t w) {
  const orb_net *net = &r->match->net;
  int32_t h = orb_net_edge(net, v, w);
  return h >= 0 && (r->in[h / 3] || r->in[net->twin[h] / 3]) ? h : -1;
}

static orb_status split_edge(region *r, int32_t v, int32_t w, double limit2) {
  orb_match *match = r->match;
  int32_t h = edge_of(r, v, w), before = match->net.triangle_count;
  orb_stray worst = {0, -1, -1, 0};
  double p[3];
  if (h < 0 || orb_match_edge2(match, v, w, INFINITY, &worst) <= limit2) {
    return ORB_OK;
  }
  ORB_TRY(orb_match_reserve(r->ctx, match, 1));
  orb_match_crossing_point(match, v, w, &worst, p);
  int32_t n = orb_match_split(match, h, p);
  return n >= 0 ? take_in(r, n, before) : ORB_OK;
}

/* Makes the vertices of shapes that lie in triangle t vertices. */
static orb_status take_items(region *r, int32_t t) {
  orb_match *match = r->match;
  while (match->triangle_items[t] >= 0) {
    int32_t item = match->triangle_items[t], before = match->net.triangle_count;
    ORB_TRY(orb_match_reserve(r->ctx, match, 1));
    int32_t v = orb_match_insert(match, t, orb_match_item_point(match, item));
    if (match->net.triangle_count > before) {
      ORB_TRY(take_in(r, v, before));
    }
    if (match->triangle_items[t] == item) { /* it lies at a corner */
      match->triangle_items[t] = match->item_next[item];
      match->item_next[item] = match->vertex_items[v];
      match->vertex_items[v] = item;
    }
  }
  return ORB_OK;
}

/* The turned triangles and those around them. */
static void mark(region *r) {
  const orb_net *net = &r->match->net;
  orb_match_mark_turned(r->ctx, r->match, r->in);
  for (int32_t h = 0; h < 3 * net->triangle_count; h++) {
    if (net->triangles[h - h % 3] >= 0 && r->in[h / 3] == 1) {
      int32_t e = h;
      do {
        r->in[e / 3] = r->in[e / 3] == 1 ? 1 : 2;
        e = net->twin[orb_prev(e)];
      } while (e != h);
    }
  }
}

static orb_status resolve(region *r, double limit2) {
  const orb_net *net = &r->match->net;
  int32_t before = net->triangle_count;
  int64_t marked = 0;
  for (int32_t t = 0; t < before; t++) {
    marked += r->in[t] > 0;
  }
  for (int32_t t = 0; t < net->triangle_count; t++) {
    if (net->triangles[3 * (int64_t)t] >= 0 && r->in[t]) {
      ORB_TRY(take_items(r, t));
    }
  }
  for (int32_t h = 0; h < 3 * net->triangle_count; h++) {
    if (net->triangles[h - h % 3] >= 0 && (r->in[h / 3] || r->in[net->twin[h] / 3]) && h < net->twin[h]) {
      ORB_TRY(orb_edge_queue_push(r->ctx, &r->queue, net->triangles[h], net->triangles[net->twin[h]]));
    }
  }
  int64_t most = r->queue.count + SPLITS_EACH * marked;
  for (int64_t i = 0; i < r->queue.count && i < most; i++) {
    ORB_TRY(split_edge(r, r->queue.ends[i][0], r->queue.ends[i][1], limit2));
    if ((i & 1023) == 0) {
      ORB_TRY(orb_context_check(r->ctx));
    }
  }
  return ORB_OK;
}

orb_status orb_match_resolve(orb_context *ctx, orb_match *match, double limit2) {
  region r = {.ctx = ctx, .match = match};
  orb_status status = make_room(&r);
  if (status == ORB_OK) {
    mark(&r);
    status = resolve(&r, CLOSE * CLOSE * limit2);
  }
  orb_free(ctx, r.in);
  orb_edge_queue_free(ctx, &r.queue);
  return status;
}
