/* Moves vertices on the sphere to where the triangles around them are better shaped and their edges deviate less.
 *
 * A vertex tries points on the way to its neighbours and to their middle. Of the points for which every matched
 * distance stays within the limit, it takes the one of least cost, if that is clearly below the current cost: the forms
 * of the triangles, plus the squared distances of the edges in units of the limit. */
#include "remesh/adaptive/move.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "base/parallel.h"
#include "numeric/predicates.h"
#include "numeric/vec3.h"
#include "remesh/placed/bound.h"
#include "remesh/placed/form.h"
#include "remesh/placed/marks.h"

/* Vertices with more neighbours, and all vertices of jobs with more shapes, do not move: arrays on the stack have these
 * sizes. */
enum { RING_MAX = 16, SHAPES_MAX = 16 };
enum { COLOURS = 64 };    /* the bits of a word; a vertex that finds no colour free stays */
enum { MOVE_GRAIN = 16 }; /* vertices a thread takes at a time */
/* Of the cost: lower values make many moves that gain little and make no room for collapses. */
static const double LEAST_GAIN = 0.01;
/* A moved triangle is at least 1 / FLATNESS times as high as its longest side on the sphere: flatter ones block later
 * steps. */
static const double FLATNESS = 1e4;

typedef struct star {
  orb_placed_net *placed;
  int32_t v, ring[RING_MAX], slot[RING_MAX];
  int n, far;        /* far: index of the edge last found beyond the limit; −1: none */
  int32_t far_shape; /* on which shape */
  double limit2;
} star;

static int star_of(orb_placed_net *placed, int32_t v, double limit2, star *out) {
  const orb_net *net = &placed->net;
  *out = (star){.placed = placed, .v = v, .far = -1, .limit2 = limit2};
  int32_t first = net->out[v], h = first;
  do {
    if (out->n == RING_MAX) {
      return 0;
    }
    out->slot[out->n] = h / 3;
    out->ring[out->n++] = net->triangles[orb_next(h)];
    h = net->twin[orb_prev(h)];
  } while (h != first);
  return 1;
}

/* The sum of the costs of the triangles' forms, and the forms together in *all. */
static double form_cost(const star *s, orb_form *all) {
  double cost = 0;
  *all = ORB_FORM_BEST;
  for (int i = 0; i < s->n; i++) {
    orb_form form = orb_placed_form(s->placed, s->v, s->ring[i], s->ring[(i + 1) % s->n]);
    cost += orb_form_cost(form);
    *all = orb_form_join(*all, form);
  }
  return cost;
}

/* Places the vertex at p, shape by shape, and returns the cost of the forms there. The forms can only get worse with
 * each shape: once they cost `most`, or may not replace `before`, the other shapes are skipped and the cost is
 * infinite. */
static double place_and_cost(const star *s, const double p[3], double most, orb_form before) {
  orb_form_squares least[RING_MAX];
  double cost = 0;
  memcpy(s->placed->net.points + 3 * (int64_t)s->v, p, 3 * sizeof(double));
  for (int i = 0; i < s->n; i++) {
    least[i] = (orb_form_squares){1, 1};
  }
  for (int32_t k = 0; k < s->placed->shape_count; k++) {
    orb_form all = ORB_FORM_BEST;
    orb_placed_locate_on(s->placed, s->v, k);
    cost = 0;
    for (int i = 0; i < s->n && cost < most; i++) {
      orb_placed_form_on(s->placed, k, s->v, s->ring[i], s->ring[(i + 1) % s->n], &least[i]);
      orb_form form = orb_form_of(least[i]);
      cost += orb_form_cost(form);
      all = orb_form_join(all, form);
    }
    if (!(cost < most) || !orb_form_allows(before, all)) {
      return INFINITY;
    }
  }
  return cost;
}

static double edge_on(const star *s, int i, int32_t shape) {
  return orb_placed_edge_within2(s->placed, shape, s->v, s->ring[i], s->limit2);
}

/* The sum of the edges' squared deviations in units of the limit; infinite if one is beyond the limit. Stops once the
 * sum is above `most`. Tests first the edge that was beyond the limit for another point. */
static double edges_cost(star *s, double most) {
  double cost = 0;
  if (s->far >= 0 && edge_on(s, s->far, s->far_shape) > s->limit2) {
    return INFINITY;
  }
  for (int i = 0; i < s->n && cost <= most; i++) {
    double greatest = 0;
    for (int32_t k = 0; k < s->placed->shape_count; k++) {
      double distance2 = edge_on(s, i, k);
      if (!(distance2 <= s->limit2)) {
        s->far = i;
        s->far_shape = k;
        return INFINITY;
      }
      greatest = distance2 > greatest ? distance2 : greatest;
    }
    cost += greatest / s->limit2;
  }
  return cost;
}

static int list_allows(const star *s, int32_t list) {
  const orb_placed_net *placed = s->placed;
  const double *p = orb_net_point(&placed->net, s->v);
  for (int32_t item = list; item >= 0; item = placed->item_next[item]) {
    const double *x = orb_placed_item_point(placed, item);
    for (int i = 0; i < s->n; i++) {
      int32_t a = s->ring[i], b = s->ring[(i + 1) % s->n];
      const double *q = orb_net_point(&placed->net, a), *r = orb_net_point(&placed->net, b);
      if (orb_orient(p, q, x) >= 0 && orb_orient(q, r, x) >= 0 && orb_orient(r, p, x) >= 0 &&
          orb_placed_item2(placed, item, s->v, a, b) > s->limit2) {
        return 0;
      }
    }
  }
  return 1;
}

static int items_allow(const star *s) {
  int fine = list_allows(s, s->placed->vertex_items[s->v]);
  for (int i = 0; i < s->n && fine; i++) {
    fine = list_allows(s, s->placed->triangle_items[s->slot[i]]);
  }
  return fine;
}

static int positive_at(const star *s, const double p[3]) {
  for (int i = 0; i < s->n; i++) {
    const double *q = orb_net_point(&s->placed->net, s->ring[i]);
    const double *r = orb_net_point(&s->placed->net, s->ring[(i + 1) % s->n]);
    double height = FLATNESS * orb_det(p, q, r);
    if (orb_orient(p, q, r) <= 0 ||
        !(height > orb_distance2(p, q) && height > orb_distance2(q, r) && height > orb_distance2(r, p))) {
      return 0;
    }
  }
  return 1;
}

/* All that a placed net stores of a vertex's position. */
typedef struct stand {
  double point[3], at[3 * SHAPES_MAX], normal[3 * SHAPES_MAX];
  orb_spot spot[SHAPES_MAX];
} stand;

static void stand_copy(orb_placed_net *placed, int32_t v, stand *s, int back) {
  size_t shapes = (size_t)placed->shape_count;
  int64_t cell = (int64_t)v * placed->shape_count;
  struct {
    void *net, *kept;
    size_t size;
  } parts[] = {{placed->net.points + 3 * (int64_t)v, s->point, sizeof s->point},
               {placed->at + 3 * cell, s->at, 3 * shapes * sizeof(double)},
               {placed->normal + 3 * cell, s->normal, 3 * shapes * sizeof(double)},
               {placed->spot + cell, s->spot, shapes * sizeof(orb_spot)}};
  for (size_t i = 0; i < sizeof parts / sizeof parts[0]; i++) {
    memcpy(back ? parts[i].net : parts[i].kept, back ? parts[i].kept : parts[i].net, parts[i].size);
  }
}

/* The inverted triangles of the star with its vertex at `old`. Leaves the vertex where it is. */
static orb_tally tally_at(const star *s, stand *old) {
  stand now;
  stand_copy(s->placed, s->v, &now, 0);
  stand_copy(s->placed, s->v, old, 1);
  orb_tally tally = orb_placed_tally_fan(s->placed, s->v, s->ring, s->n, 1);
  stand_copy(s->placed, s->v, &now, 1);
  return tally;
}

/* Moves v to p if that costs clearly less than *cost, and updates that. Returns whether it did. The items stay in their
 * lists. */
static int try_point(star *s, const double p[3], orb_form before, double *cost) {
  stand old;
  if (!positive_at(s, p)) {
    return 0;
  }
  stand_copy(s->placed, s->v, &old, 0);
  double now = place_and_cost(s, p, *cost, before);
  if (now < *cost) {
    now += edges_cost(s, *cost - now);
    if (now < *cost * (1 - LEAST_GAIN) && items_allow(s)) {
      orb_tally tally = orb_placed_tally_fan(s->placed, s->v, s->ring, s->n, 1);
      if (tally.inverted == 0 || !orb_tally_is_worse(tally, tally_at(s, &old))) {
        *cost = now;
        return 1;
      }
    }
  }
  stand_copy(s->placed, s->v, &old, 1);
  return 0;
}

static void reassign_items(const star *s) {
  orb_placed_net *placed = s->placed;
  int32_t lists[RING_MAX + 1];
  lists[s->n] = placed->vertex_items[s->v];
  placed->vertex_items[s->v] = -1;
  for (int i = 0; i < s->n; i++) {
    lists[i] = placed->triangle_items[s->slot[i]];
    placed->triangle_items[s->slot[i]] = -1;
  }
  for (int i = 0; i <= s->n; i++) {
    orb_placed_assign_among(placed, lists[i], s->slot, s->n);
  }
}

/* A mark of all that a search for a move depends on: the points of the vertex and its neighbours, and the limit. */
static uint64_t mark_of(const star *s) {
  const orb_net *net = &s->placed->net;
  uint64_t mark = orb_mark_mix(1, &s->limit2, sizeof s->limit2);
  mark = orb_mark_mix(mark, orb_net_point(net, s->v), 3 * sizeof(double));
  int first = 0; /* the ring may start at any neighbour */
  for (int i = 1; i < s->n; i++) {
    first = s->ring[i] < s->ring[first] ? i : first;
  }
  for (int i = 0; i < s->n; i++) {
    mark = orb_mark_mix(mark, orb_net_point(net, s->ring[(first + i) % s->n]), 3 * sizeof(double));
  }
  return mark ? mark : 1;
}

/* Moves v if that pays. Returns whether it did. */
static int try_move(orb_placed_net *placed, int32_t v, double limit2) {
  static const double way[] = {0.5, 0.25, 0.1}; /* of the way to a neighbour; more points cost time in proportion */
  star s;
  if (placed->shape_count > SHAPES_MAX || placed->fixed[v] || !star_of(placed, v, limit2, &s)) {
    return 0;
  }
  uint64_t mark = mark_of(&s);
  if (placed->no_move[v] == mark) {
    return 0;
  }
  double from[3], middle[3] = {0, 0, 0};
  memcpy(from, orb_net_point(&placed->net, v), sizeof from);
  for (int i = 0; i < s.n; i++) {
    for (int k = 0; k < 3; k++) {
      middle[k] += orb_net_point(&placed->net, s.ring[i])[k] / s.n;
    }
  }
  orb_form before;
  double cost = form_cost(&s, &before);
  cost += edges_cost(&s, INFINITY);
  int moved = 0;
  for (int i = 0; i <= s.n; i++) {
    const double *to = i < s.n ? orb_net_point(&placed->net, s.ring[i]) : middle;
    for (size_t j = 0; j < sizeof way / sizeof way[0]; j++) {
      double p[3];
      for (int k = 0; k < 3; k++) {
        p[k] = from[k] + way[j] * (to[k] - from[k]);
      }
      (void)orb_normalize(p);
      moved |= try_point(&s, p, before, &cost);
    }
  }
  placed->no_move[v] = moved ? 0 : mark;
  if (moved) {
    reassign_items(&s);
  }
  return moved;
}

/* Gives each vertex of `which` (NULL: all live ones) a colour that no neighbour has: vertices of one colour share no
 * triangle and can move at the same time. COLOURS: none is free. */
static void colour(const orb_net *net, const unsigned char *which, unsigned char *colours) {
  memset(colours, 255, (size_t)net->vertex_count);
  for (int32_t v = 0; v < net->vertex_count; v++) {
    uint64_t taken = 0;
    int32_t first = net->out[v], h = first;
    if (first < 0 || (which && !which[v])) {
      continue;
    }
    do {
      unsigned char theirs = colours[net->triangles[orb_next(h)]];
      taken |= theirs < COLOURS ? UINT64_C(1) << theirs : 0;
      h = net->twin[orb_prev(h)];
    } while (h != first);
    int free = 0;
    while (free < COLOURS && taken >> free & 1) {
      free++;
    }
    colours[v] = (unsigned char)free;
  }
}

typedef struct move_loop {
  orb_placed_net *placed;
  double limit2;
  const int32_t *vertices;
} move_loop;

static void move_range(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  move_loop *loop = arg;
  for (int64_t i = begin; i < end; i++) {
    (void)try_move(loop->placed, loop->vertices[i], loop->limit2);
  }
}

orb_status orb_adaptive_move_all(orb_context *ctx, orb_placed_net *placed, double limit2, const unsigned char *which) {
  int32_t n = placed->net.vertex_count;
  unsigned char *colours = ORB_NEW(ctx, unsigned char, n);
  int32_t *vertices = ORB_NEW(ctx, int32_t, n);
  orb_status status = colours && vertices ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    colour(&placed->net, which, colours);
  }
  for (int k = 0; status == ORB_OK && k < COLOURS; k++) {
    int64_t count = 0;
    for (int32_t v = 0; v < n; v++) {
      if (colours[v] == k) {
        vertices[count++] = v;
      }
    }
    if (count == 0) {
      break;
    }
    move_loop loop = {placed, limit2, vertices};
    orb_parallel_for(ctx, count, MOVE_GRAIN, move_range, &loop);
    status = orb_context_check(ctx);
  }
  orb_free(ctx, colours);
  orb_free(ctx, vertices);
  return status;
}
