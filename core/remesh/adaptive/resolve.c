/* Around triangles that no single step repairs, this makes the overlay of the shapes, there only: vertices of the
 * shapes become vertices, and edges that deviate from a shape by more than a little are split where they cross its
 * edges. A triangle that lies in one triangle of every shape cannot be inverted. Collapses then reduce the region
 * again, and leave no more inverted triangles than there are. Edges outside stay as they are, so that the region does
 * not spread. */
#include "remesh/adaptive/resolve.h"

#include <math.h>

#include "base/check.h"
#include "base/grow.h"
#include "remesh/placed/bound.h"
#include "remesh/placed/edge_queue.h"
#include "remesh/placed/form.h"

/* Queue entries per triangle of the region: a bound where splits creep; more resolve longer triangles. */
enum { SPLITS_EACH = 64 };
enum { CHECK_EVERY = 1024 };     /* edges between two checks for cancellation */
static const double CLOSE = 0.1; /* of the limit: edges that deviate less are not split */

typedef struct region {
  orb_context *ctx;
  orb_placed_net *placed;
  unsigned char *in; /* per triangle: 0 outside, 1 inverted, 2 around an inverted one */
  int64_t capacity;
  orb_edge_queue queue;
} region;

static orb_status make_room(region *r) {
  int64_t need = r->placed->net.triangle_count, to = need + need / 2 + 256;
  if (need > r->capacity) {
    if (!orb_regrow(r->ctx, &r->in, (size_t)to, 1)) {
      return ORB_E_NO_MEMORY;
    }
    r->capacity = to;
  }
  return ORB_OK;
}

/* After a new vertex v: its new triangles are in the region if the ones they were cut from are; its edges are queued.
 */
static orb_status take_in(region *r, int32_t v, int32_t triangles_before) {
  const orb_net *net = &r->placed->net;
  ORB_TRY(make_room(r));
  for (int32_t t = triangles_before; t < net->triangle_count; t++) {
    r->in[t] = r->in[net->twin[3 * t + 2] / 3];
  }
  return orb_edge_queue_push_star(r->ctx, &r->queue, net, v);
}

/* The edge v w if it belongs to a triangle of the region; else −1. */
static int32_t edge_of(const region *r, int32_t v, int32_t w) {
  const orb_net *net = &r->placed->net;
  int32_t h = orb_net_edge(net, v, w);
  return h >= 0 && (r->in[h / 3] || r->in[net->twin[h] / 3]) ? h : -1;
}

static orb_status split_edge(region *r, int32_t v, int32_t w, double limit2) {
  orb_placed_net *placed = r->placed;
  int32_t h = edge_of(r, v, w), before = placed->net.triangle_count;
  orb_deviation worst = ORB_NO_DEVIATION;
  double p[3];
  if (h < 0 || orb_placed_edge2(placed, v, w, INFINITY, &worst) <= limit2) {
    return ORB_OK;
  }
  ORB_TRY(orb_placed_reserve(r->ctx, placed, 1));
  orb_placed_crossing_point(placed, v, w, &worst, p);
  int32_t n = orb_placed_split(placed, h, p);
  return n >= 0 ? take_in(r, n, before) : ORB_OK;
}

/* Inserts the items of triangle t. */
static orb_status take_items(region *r, int32_t t) {
  orb_placed_net *placed = r->placed;
  while (placed->triangle_items[t] >= 0) {
    int32_t item = placed->triangle_items[t], before = placed->net.triangle_count;
    ORB_TRY(orb_placed_reserve(r->ctx, placed, 1));
    int32_t v = orb_placed_insert(placed, t, orb_placed_item_point(placed, item));
    if (placed->net.triangle_count > before) {
      ORB_TRY(take_in(r, v, before));
    }
    if (placed->triangle_items[t] == item) { /* it lies at a corner */
      placed->triangle_items[t] = placed->item_next[item];
      placed->item_next[item] = placed->vertex_items[v];
      placed->vertex_items[v] = item;
    }
  }
  return ORB_OK;
}

/* Marks the inverted triangles and those around them. */
static void mark(region *r) {
  const orb_net *net = &r->placed->net;
  orb_placed_mark_inverted(r->ctx, r->placed, r->in);
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
  const orb_net *net = &r->placed->net;
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
    if (i % CHECK_EVERY == 0) {
      ORB_TRY(orb_context_check(r->ctx));
    }
  }
  return ORB_OK;
}

orb_status orb_adaptive_resolve(orb_context *ctx, orb_placed_net *placed, double limit2) {
  region r = {.ctx = ctx, .placed = placed};
  orb_status status = make_room(&r);
  if (status == ORB_OK) {
    mark(&r);
    status = resolve(&r, CLOSE * CLOSE * limit2);
  }
  orb_free(ctx, r.in);
  orb_edge_queue_free(ctx, &r.queue);
  return status;
}
