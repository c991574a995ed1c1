/* Half-edge collapses in order of quadric error, each one proved before it is made.
 *
 * The order: every net vertex has, for each shape, the quadric of the surface around it (Garland & Heckbert 1997,
 * planes weighted by area, lengths relative to the diagonal); the cost of moving u onto v is the sum over the shapes of
 * u's quadric at v. The proof: the new triangles are positive on the sphere, and the new edges' crossings and the items
 * that change triangles lie within the limit on every shape. A heap holds each vertex with its best target; a vertex
 * that finds no allowed target waits until its surroundings change.
 *
 * The proofs take the time, so several are made at once. The cheapest vertices that have no neighbour in common leave
 * the heap together as a batch. Threads first search a way for each while nothing changes, then carry out the ways they
 * found, again in parallel: each changes the triangles around its vertex and the edges and neighbours along their
 * outline, which no other proof of the batch has examined. The size of a batch depends on the heap alone, so the result
 * does not depend on the number of threads. */
#include "remesh/adaptive/collapse.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "base/parallel.h"
#include "numeric/predicates.h"
#include "remesh/adaptive/fill.h"
#include "remesh/adaptive/heap.h"
#include "remesh/adaptive/quadric.h"
#include "remesh/placed/bound.h"
#include "remesh/placed/form.h"
#include "remesh/placed/marks.h"

enum { RING_MAX = 48 };    /* vertices with more neighbours stay; the size of arrays on the stack */
enum { VALENCE_MAX = 14 }; /* a collapse must not give a vertex more neighbours than this, or than it has */
enum { TRIES = 4 };        /* targets tried for a vertex, the cheapest first; more find a few more collapses */
/* A batch holds at most BATCH_MOST vertices, and at most one in BATCH_PART of the heap: larger batches keep more
 * threads busy but depart farther from the order of cost. A thread takes BATCH_GRAIN at a time. */
enum { BATCH_MOST = 256, BATCH_PART = 32, BATCH_GRAIN = 4 };
enum { GRAIN = 512 }; /* vertices a thread takes at a time when all get their quadrics and costs */
/* Weight of the squared distance in the cost, in units of the squared limit: small against any quadric, but enough that
 * flat regions keep even triangles. */
static const double DISTANCE_WEIGHT = 1e-5;

/* What was found for a vertex: a way to remove it, or none. */
typedef struct plan {
  int32_t u, ring[RING_MAX];
  int n, at;    /* at: index in the ring of the neighbour that it moves onto; −1: none */
  int32_t heir; /* the vertex that receives its quadrics if its hole is filled */
  int fills;    /* it is removed and `triangles` fill its hole */
  int triangles[ORB_FILL_MOST][3];
  double cost[RING_MAX]; /* of the neighbours, after its removal */
} plan;

typedef struct collapser {
  orb_context *ctx;
  orb_placed_net *placed;
  double limit2;
  int strict, thorough;
  orb_quadric *quadric; /* per net vertex, one per shape */
  orb_heap heap;        /* vertices by the cost of their best target */
  int32_t *target;      /* per vertex: its best target */
  uint64_t *marks;      /* per vertex: of its neighbours (marks.h) */
  int64_t live;
  plan *batch;
  int32_t *later, waiting;  /* taken from the heap but too near to the batch: for the next one */
  uint32_t *taken, batches; /* per vertex: the last batch that it or a neighbour was in */
} collapser;

/* The neighbours of u in counter-clockwise order; returns how many, −1 if too many. */
static int ring_of(const orb_net *net, int32_t u, int32_t ring[RING_MAX]) {
  int n = 0;
  int32_t first = net->out[u], h = first;
  do {
    if (n == RING_MAX) {
      return -1;
    }
    ring[n++] = net->triangles[orb_next(h)];
    h = net->twin[orb_prev(h)];
  } while (h != first);
  return n;
}

/* Cost of moving u onto v: quadrics, and a little of the distance. */
static double move_cost(const collapser *c, int32_t u, int32_t v) {
  double cost = 0, length2 = 0;
  for (int32_t s = 0; s < c->placed->shape_count; s++) {
    cost += orb_quadric_at(&c->quadric[(int64_t)u * c->placed->shape_count + s], orb_placed_position(c->placed, v, s));
    length2 += orb_distance2(orb_placed_position(c->placed, u, s), orb_placed_position(c->placed, v, s));
  }
  return (cost > 0 ? cost : 0) + DISTANCE_WEIGHT * length2 * c->limit2;
}

/* The least cost of moving u, and the target. */
static double least_cost(const collapser *c, int32_t u, int32_t *target) {
  int32_t ring[RING_MAX];
  int n = c->placed->fixed[u] ? -1 : ring_of(&c->placed->net, u, ring);
  double best = INFINITY;
  *target = -1;
  for (int i = 0; i < n; i++) {
    double cost = move_cost(c, u, ring[i]);
    if (cost < best) {
      best = cost;
      *target = ring[i];
    }
  }
  return best;
}

/* The same if nothing has changed around u except that `gone` has moved onto its neighbour v. */
static double least_cost_after(collapser *c, int32_t u, int32_t gone, int32_t v) {
  if (c->placed->fixed[u] || c->target[u] < 0 || c->target[u] == gone) {
    return least_cost(c, u, &c->target[u]);
  }
  double cost = move_cost(c, u, v);
  if (cost < c->heap.cost[u]) {
    c->target[u] = v;
    return cost;
  }
  return c->heap.cost[u];
}

/* Whether the forms of the fan around ring[0] may replace those of u's star: see orb_form_allows(). */
static int shape_allows(const orb_placed_net *placed, int32_t u, const int32_t *ring, int n) {
  orb_form before = ORB_FORM_BEST, after = ORB_FORM_BEST;
  for (int i = 1; i + 1 < n; i++) {
    after = orb_form_join(after, orb_placed_form(placed, ring[0], ring[i], ring[i + 1]));
  }
  if (orb_form_is_fine(after)) {
    return 1;
  }
  for (int i = 0; i < n; i++) {
    before = orb_form_join(before, orb_placed_form(placed, u, ring[i], ring[(i + 1) % n]));
  }
  return orb_form_allows(before, after);
}

/* The greatest squared distance of a listed item to its triangle in the fan of ring[0] that replaces u's star. */
static double items_in_fan2(const orb_placed_net *placed, int32_t list, const int32_t *ring, int n, double limit2) {
  double greatest = 0;
  const double *v = orb_net_point(&placed->net, ring[0]);
  for (int32_t item = list; item >= 0 && greatest <= limit2; item = placed->item_next[item]) {
    const double *x = orb_placed_item_point(placed, item);
    int i = 1;
    while (i + 2 < n && orb_orient(v, orb_net_point(&placed->net, ring[i + 1]), x) > 0) {
      i++;
    }
    greatest = fmax(greatest, orb_placed_item2(placed, item, ring[0], ring[i], ring[i + 1]));
  }
  return greatest;
}

/* Whether the new edges are within the limit, the one that a guess finds worst first: most collapses fail at it. */
static int edges_allow(const collapser *c, const int32_t *ring, int n) {
  const orb_placed_net *placed = c->placed;
  int worst = -1;
  int32_t shape = 0;
  double most = -1;
  for (int i = 2; i + 1 < n; i++) {
    for (int32_t s = 0; s < placed->shape_count; s++) {
      double guess2 = orb_placed_edge_guess2(placed, s, ring[0], ring[i]);
      if (guess2 > most) {
        most = guess2;
        worst = i;
        shape = s;
      }
    }
  }
  if (worst >= 0 && !(orb_placed_edge_within2(placed, shape, ring[0], ring[worst], c->limit2) <= c->limit2)) {
    return 0;
  }
  for (int i = 2; i + 1 < n; i++) {
    if (!orb_placed_edge_is_within(placed, ring[0], ring[i], c->limit2)) {
      return 0;
    }
  }
  return 1;
}

static int is_allowed(const collapser *c, int32_t u, const int32_t *ring, int n) {
  const orb_placed_net *placed = c->placed;
  const orb_net *net = &placed->net;
  int32_t other[RING_MAX];
  int valence = ring_of(net, ring[0], other), shared = 0;
  if (valence < 0 || valence + n - 4 > (valence > VALENCE_MAX ? valence : VALENCE_MAX)) {
    return 0;
  }
  for (int i = 0; i < valence; i++) { /* the link condition */
    for (int k = 1; k < n; k++) {
      shared += other[i] == ring[k];
    }
  }
  if (shared != 2) {
    return 0;
  }
  for (int i = 1; i + 1 < n; i++) {
    if (!orb_net_clearly_positive(net, ring[0], ring[i], ring[i + 1])) {
      return 0;
    }
  }
  if (!edges_allow(c, ring, n) || (c->strict && !shape_allows(placed, u, ring, n)) ||
      items_in_fan2(placed, placed->vertex_items[u], ring, n, c->limit2) > c->limit2) {
    return 0;
  }
  int32_t first = net->out[u], h = first;
  do {
    if (items_in_fan2(placed, placed->triangle_items[h / 3], ring, n, c->limit2) > c->limit2) {
      return 0;
    }
    h = net->twin[orb_prev(h)];
  } while (h != first);
  if (!c->strict) {
    return 1;
  }
  orb_tally after = orb_placed_tally_fan(placed, ring[0], ring + 1, n - 1, 0);
  return after.inverted == 0 || !orb_tally_is_worse(after, orb_placed_tally_fan(placed, u, ring, n, 1));
}

static void hand_over_quadrics(collapser *c, int32_t from, int32_t to) {
  int64_t shapes = c->placed->shape_count;
  for (int32_t s = 0; s < shapes; s++) {
    orb_quadric_add(&c->quadric[to * shapes + s], &c->quadric[from * shapes + s]);
  }
}

/* Removes u by moving it onto v, h = u→v. */
static void collapse(collapser *c, int32_t h) {
  orb_placed_net *placed = c->placed;
  orb_net *net = &placed->net;
  int32_t u = net->triangles[h], v = net->triangles[orb_next(h)];
  int32_t lists[RING_MAX + 1], slots[RING_MAX];
  int n = 0, left = 0;
  int32_t e = h;
  do {
    lists[n] = placed->triangle_items[e / 3];
    placed->triangle_items[e / 3] = -1;
    if (e / 3 != h / 3 && e / 3 != net->twin[h] / 3) {
      slots[left++] = e / 3;
    }
    n++;
    e = net->twin[orb_prev(e)];
  } while (e != h);
  lists[n++] = placed->vertex_items[u];
  placed->vertex_items[u] = -1;
  orb_net_collapse(net, h);
  for (int i = 0; i < n; i++) {
    orb_placed_assign_among(placed, lists[i], slots, left);
  }
  hand_over_quadrics(c, u, v);
}

/* The index of the cheapest target; tried ones have an infinite cost; −1: none is left. */
static int next_target(const double *cost, int n) {
  int best = -1;
  for (int i = 0; i < n; i++) {
    if (cost[i] < INFINITY && (best < 0 || cost[i] < cost[best])) {
      best = i;
    }
  }
  return best;
}

/* A mark of what decides whether u can be removed; the last bit says that the search was thorough. */
static uint64_t mark_of(const collapser *c, int32_t u) {
  uint64_t mark = orb_mark_mix(4 + (uint64_t)c->strict, &c->limit2, sizeof c->limit2);
  uint64_t sum = orb_mark_of_surroundings(&c->placed->net, c->marks, u);
  return (orb_mark_mix(mark, &sum, sizeof sum) & ~UINT64_C(1)) | (uint64_t)c->thorough;
}

/* Tries u's best target, then the next ones. */
static void find_target(const collapser *c, plan *p) {
  int32_t rotated[RING_MAX];
  double cost[RING_MAX];
  int n = p->n, at = 0;
  while (at < n && p->ring[at] != c->target[p->u]) {
    at++;
  }
  for (int attempt = 0; attempt < TRIES && at >= 0 && at < n; attempt++) {
    p->heir = attempt == 0 ? p->ring[at] : p->heir;
    for (int i = 0; i < n; i++) {
      rotated[i] = p->ring[(at + i) % n];
    }
    if (is_allowed(c, p->u, rotated, n)) {
      p->at = at;
      return;
    }
    for (int i = 0; i < n && attempt == 0; i++) {
      cost[i] = move_cost(c, p->u, p->ring[i]);
    }
    cost[at] = INFINITY;
    at = next_target(cost, n);
  }
}

/* Finds a way to remove p->u. Changes nothing that other threads see. */
static void find_way(const collapser *c, plan *p) {
  orb_placed_net *placed = c->placed;
  uint64_t known = placed->no_collapse[p->u], mark = known ? mark_of(c, p->u) : 0;
  p->at = p->heir = -1;
  p->fills = 0;
  if (p->n < 0 || (known && (known | 1) == (mark | 1) && known >= mark)) {
    return;
  }
  find_target(c, p);
  if (p->at < 0) {
    p->fills = c->thorough && p->n > 2 && p->n <= ORB_FILL_MOST &&
               orb_adaptive_plan_fill(placed, p->u, p->ring, p->n, c->limit2, c->strict, p->triangles);
  }
  if (p->at < 0 && !p->fills) {
    placed->no_collapse[p->u] = known ? mark : mark_of(c, p->u);
  }
}

static void find_range(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  collapser *c = arg;
  for (int64_t i = begin; i < end; i++) {
    find_way(c, &c->batch[i]);
  }
}

/* Removes the vertex as planned, and finds the neighbours' costs after that. */
static void carry_out(collapser *c, plan *p) {
  if (p->at >= 0) {
    int32_t v = p->ring[p->at];
    orb_marks_collapse(&c->placed->net, c->marks, p->u, p->ring, p->n, p->at);
    collapse(c, orb_net_edge(&c->placed->net, p->u, v));
    for (int i = 0; i < p->n; i++) {
      int32_t w = p->ring[i];
      p->cost[i] = w == v ? least_cost(c, v, &c->target[v]) : least_cost_after(c, w, p->u, v);
    }
  } else if (p->fills) {
    orb_marks_fill(&c->placed->net, c->marks, p->u, p->ring, p->n, p->triangles);
    orb_adaptive_fill(c->placed, p->u, p->ring, p->n, p->triangles);
    hand_over_quadrics(c, p->u, p->heir);
    for (int i = 0; i < p->n; i++) {
      p->cost[i] = least_cost(c, p->ring[i], &c->target[p->ring[i]]);
    }
  }
}

static void carry_out_range(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  collapser *c = arg;
  for (int64_t i = begin; i < end; i++) {
    carry_out(c, &c->batch[i]);
  }
}

/* Adds u to the batch, unless it or a neighbour belongs to it already. Returns whether it did. */
static int take(collapser *c, int32_t u, plan *p) {
  p->u = u;
  p->n = ring_of(&c->placed->net, u, p->ring);
  for (int i = 0; i < p->n; i++) {
    if (c->taken[p->ring[i]] == c->batches) {
      return 0;
    }
  }
  if (c->taken[u] == c->batches) {
    return 0;
  }
  c->taken[u] = c->batches;
  for (int i = 0; i < p->n; i++) {
    c->taken[p->ring[i]] = c->batches;
  }
  return 1;
}

/* Fills the next batch: first the vertices that had to wait, then from the heap. Returns how many there are. */
static int take_batch(collapser *c) {
  int32_t all = c->heap.count + c->waiting;
  int most = all / BATCH_PART < BATCH_MOST ? all / BATCH_PART + 1 : BATCH_MOST, count = 0, waited = c->waiting;
  c->batches++;
  c->waiting = 0;
  for (int i = 0; i < waited; i++) {
    int32_t u = c->later[i];
    if (c->heap.slot[u] >= 0) {
      continue; /* it is back in the heap with another cost */
    }
    if (count < most && take(c, u, &c->batch[count])) {
      count++;
    } else {
      c->later[c->waiting++] = u;
    }
  }
  while (c->heap.count > 0 && count < most && c->waiting < BATCH_MOST) {
    int32_t u = c->heap.entry[0].v;
    orb_heap_remove(&c->heap, u);
    if (take(c, u, &c->batch[count])) {
      count++;
    } else {
      c->later[c->waiting++] = u;
    }
  }
  return count;
}

/* Searches and carries out one batch. */
static void try_batch(collapser *c, int64_t target) {
  int count = take_batch(c);
  orb_parallel_for(c->ctx, count, BATCH_GRAIN, find_range, c);
  for (int i = 0; i < count; i++) {
    plan *p = &c->batch[i];
    if (c->live <= target || c->live <= 4) {
      count = i;
    } else {
      c->live -= p->at >= 0 || p->fills ? 2 : 0;
    }
  }
  orb_parallel_for(c->ctx, count, BATCH_GRAIN, carry_out_range, c);
  for (int i = 0; i < count; i++) {
    const plan *p = &c->batch[i];
    for (int k = 0; k < p->n && (p->at >= 0 || p->fills); k++) {
      orb_heap_put(&c->heap, p->ring[k], p->cost[k]);
    }
  }
}

/* The quadric of shape s around net vertex v: of all triangles at a vertex of the shape, else of the one or two
 * triangles that v lies in, each with a third of its area. */
static void surface_quadric(const orb_placed_net *placed, int32_t v, int32_t s, orb_quadric *out) {
  const orb_sphere_view *view = &placed->view[s];
  orb_spot spot = placed->spot[(int64_t)v * placed->shape_count + s];
  int32_t h = spot.h;
  memset(out, 0, sizeof *out);
  do {
    const double *corner[3];
    for (int k = 0; k < 3; k++) {
      corner[k] = placed->position[s] + 3 * (int64_t)view->triangles[h - h % 3 + k];
    }
    orb_quadric_add_plane(out, corner[0], corner[1], corner[2]);
    h = spot.kind == ORB_SPOT_VERTEX ? view->twin[orb_prev(h)] : spot.kind == ORB_SPOT_EDGE ? view->twin[h] : h;
  } while (h != spot.h);
}

static void quadric_range(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  collapser *c = arg;
  for (int64_t v = begin; v < end; v++) {
    for (int32_t s = 0; s < c->placed->shape_count && c->placed->net.out[v] >= 0; s++) {
      surface_quadric(c->placed, (int32_t)v, s, &c->quadric[v * c->placed->shape_count + s]);
    }
  }
}

static void cost_range(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  collapser *c = arg;
  for (int64_t v = begin; v < end; v++) {
    if (c->placed->net.out[v] >= 0) {
      c->heap.cost[v] = least_cost(c, (int32_t)v, &c->target[v]);
    }
  }
}

orb_status orb_adaptive_collapse(orb_context *ctx, orb_placed_net *placed, double limit2, int64_t target, int strict,
                                 int thorough) {
  int32_t vertices = placed->net.vertex_count;
  collapser c = {.ctx = ctx,
                 .placed = placed,
                 .limit2 = limit2,
                 .strict = strict,
                 .thorough = thorough,
                 .live = orb_placed_live(placed)};
  c.quadric = ORB_NEW(ctx, orb_quadric, (int64_t)vertices * placed->shape_count);
  c.target = ORB_NEW(ctx, int32_t, vertices);
  c.marks = ORB_NEW(ctx, uint64_t, vertices);
  c.batch = ORB_NEW(ctx, plan, BATCH_MOST);
  c.later = ORB_NEW(ctx, int32_t, BATCH_MOST);
  c.taken = ORB_NEW0(ctx, uint32_t, vertices);
  int fine = orb_heap_open(ctx, &c.heap, vertices) && c.quadric && c.target && c.marks && c.batch && c.later && c.taken;
  orb_status status = fine ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    orb_marks_of_rings(ctx, &placed->net, c.marks);
    orb_parallel_for(ctx, vertices, GRAIN, quadric_range, &c);
    orb_parallel_for(ctx, vertices, GRAIN, cost_range, &c);
    for (int32_t v = 0; v < vertices; v++) {
      if (placed->net.out[v] >= 0) {
        orb_heap_put(&c.heap, v, c.heap.cost[v]);
      }
    }
  }
  while (status == ORB_OK && c.heap.count + c.waiting > 0 && c.live > target && c.live > 4) {
    try_batch(&c, target);
    status = orb_context_check(ctx);
  }
  orb_heap_close(ctx, &c.heap);
  orb_free(ctx, c.quadric);
  orb_free(ctx, c.target);
  orb_free(ctx, c.marks);
  orb_free(ctx, c.batch);
  orb_free(ctx, c.later);
  orb_free(ctx, c.taken);
  return status;
}
