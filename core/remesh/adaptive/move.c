/* Vertices that move on the sphere, to where the triangles around them are better shaped and their edges stray less.
 *
 * A vertex tries points on the way to its neighbours and to their middle. Of those for which every matched distance
 * stays within the limit the one of least cost is taken, if that is below the cost where it stands: the forms of the
 * triangles, and the squared distances of the edges in units of the limit. */
#include <math.h>
#include <string.h>

#include "base/check.h"
#include "numeric/predicates.h"
#include "numeric/vec3.h"
#include "remesh/adaptive/match.h"

enum { RING_MAX = 16, SHAPES_KEPT = 16, COLOURS = 64, MOVE_GRAIN = 16 };

static const double LEAST_GAIN = 0.01; /* of the cost: many moves that gain less do not make room for collapses */

typedef struct star {
  orb_match *match;
  int32_t v, ring[RING_MAX], slot[RING_MAX];
  int n, far; /* far: the number of the edge that was last found to stray beyond the limit, on this shape; −1: none */
  int32_t far_shape;
  double limit2;
} star;

static int star_of(orb_match *match, int32_t v, double limit2, star *out) {
  const orb_net *net = &match->net;
  *out = (star){.match = match, .v = v, .far = -1, .limit2 = limit2};
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

/* Adds up what the forms of the triangles cost. */
static double form_cost(const star *s, orb_form *all) {
  double cost = 0;
  *all = ORB_FORM_BEST;
  for (int i = 0; i < s->n; i++) {
    orb_form form = orb_match_form(s->match, s->v, s->ring[i], s->ring[(i + 1) % s->n]);
    cost += orb_form_cost(form);
    *all = orb_form_join(*all, form);
  }
  return cost;
}

/* Places the vertex at p, shape by shape, and adds up the same there: with each shape the forms can only get worse, and
 * once they cost `most`, or are not allowed in place of `before`, the rest need not be known: infinity. */
static double place_and_cost(const star *s, const double p[3], double most, orb_form before) {
  orb_form_squares least[RING_MAX];
  double cost = 0;
  memcpy(s->match->net.points + 3 * (int64_t)s->v, p, 3 * sizeof(double));
  for (int i = 0; i < s->n; i++) {
    least[i] = (orb_form_squares){1, 1};
  }
  for (int32_t k = 0; k < s->match->shape_count; k++) {
    orb_form all = ORB_FORM_BEST;
    orb_match_place_on(s->match, s->v, k);
    cost = 0;
    for (int i = 0; i < s->n && cost < most; i++) {
      orb_match_form_on(s->match, k, s->v, s->ring[i], s->ring[(i + 1) % s->n], &least[i]);
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
  return orb_match_edge_of_shape2(s->match, shape, s->v, s->ring[i], s->limit2, NULL);
}

/* Adds up how far the edges stray; infinity beyond the limit, or once the sum is above `most`. The edge that went
 * beyond it for another point is asked first. */
static double edges_cost(star *s, double most) {
  double cost = 0;
  if (s->far >= 0 && edge_on(s, s->far, s->far_shape) > s->limit2) {
    return INFINITY;
  }
  for (int i = 0; i < s->n && cost <= most; i++) {
    double greatest = 0;
    for (int32_t k = 0; k < s->match->shape_count; k++) {
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
  const orb_match *match = s->match;
  const double *p = orb_net_point(&match->net, s->v);
  for (int32_t item = list; item >= 0; item = match->item_next[item]) {
    const double *x = orb_match_item_point(match, item);
    for (int i = 0; i < s->n; i++) {
      int32_t a = s->ring[i], b = s->ring[(i + 1) % s->n];
      const double *q = orb_net_point(&match->net, a), *r = orb_net_point(&match->net, b);
      if (orb_orient(p, q, x) >= 0 && orb_orient(q, r, x) >= 0 && orb_orient(r, p, x) >= 0 &&
          orb_match_item2(match, item, s->v, a, b) > s->limit2) {
        return 0;
      }
    }
  }
  return 1;
}

static int items_allow(const star *s) {
  int fine = list_allows(s, s->match->vertex_items[s->v]);
  for (int i = 0; i < s->n && fine; i++) {
    fine = list_allows(s, s->match->triangle_items[s->slot[i]]);
  }
  return fine;
}

static int positive_at(const star *s, const double p[3]) {
  for (int i = 0; i < s->n; i++) {
    const double *q = orb_net_point(&s->match->net, s->ring[i]);
    const double *r = orb_net_point(&s->match->net, s->ring[(i + 1) % s->n]);
    double height = 1e4 * orb_det(p, q, r);
    if (orb_orient(p, q, r) <= 0 ||
        !(height > orb_distance2(p, q) && height > orb_distance2(q, r) && height > orb_distance2(r, p))) {
      return 0;
    }
  }
  return 1;
}

/* What a vertex has where it stands. */
typedef struct stand {
  double point[3], at[3 * SHAPES_KEPT], normal[3 * SHAPES_KEPT];
  orb_spot spot[SHAPES_KEPT];
} stand;

static void stand_copy(orb_match *match, int32_t v, stand *s, int back) {
  size_t shapes = (size_t)match->shape_count;
  int64_t cell = (int64_t)v * match->shape_count;
  struct {
    void *net, *kept;
    size_t size;
  } parts[] = {{match->net.points + 3 * (int64_t)v, s->point, sizeof s->point},
               {match->at + 3 * cell, s->at, 3 * shapes * sizeof(double)},
               {match->normal + 3 * cell, s->normal, 3 * shapes * sizeof(double)},
               {match->spot + cell, s->spot, shapes * sizeof(orb_spot)}};
  for (size_t i = 0; i < sizeof parts / sizeof parts[0]; i++) {
    memcpy(back ? parts[i].net : parts[i].kept, back ? parts[i].kept : parts[i].net, parts[i].size);
  }
}

/* The turned triangles of the star with its vertex where it was; it is left where it is. */
static orb_tally tally_at(const star *s, stand *old) {
  stand now;
  stand_copy(s->match, s->v, &now, 0);
  stand_copy(s->match, s->v, old, 1);
  orb_tally tally = orb_match_tally_fan(s->match, s->v, s->ring, s->n, 1);
  stand_copy(s->match, s->v, &now, 1);
  return tally;
}

/* Moves v to p if that costs clearly less than *cost, and sets that; whether it did. The items stay in their lists. */
static int try_point(star *s, const double p[3], orb_form before, double *cost) {
  stand old;
  if (!positive_at(s, p)) {
    return 0;
  }
  stand_copy(s->match, s->v, &old, 0);
  double now = place_and_cost(s, p, *cost, before);
  if (now < *cost) {
    now += edges_cost(s, *cost - now);
    if (now < *cost * (1 - LEAST_GAIN) && items_allow(s)) {
      orb_tally tally = orb_match_tally_fan(s->match, s->v, s->ring, s->n, 1);
      if (tally.turned == 0 || !orb_tally_is_worse(tally, tally_at(s, &old))) {
        *cost = now;
        return 1;
      }
    }
  }
  stand_copy(s->match, s->v, &old, 1);
  return 0;
}

static void deal_anew(const star *s) {
  orb_match *match = s->match;
  int32_t lists[RING_MAX + 1];
  lists[s->n] = match->vertex_items[s->v];
  match->vertex_items[s->v] = -1;
  for (int i = 0; i < s->n; i++) {
    lists[i] = match->triangle_items[s->slot[i]];
    match->triangle_items[s->slot[i]] = -1;
  }
  for (int i = 0; i <= s->n; i++) {
    orb_match_deal_among(match, lists[i], s->slot, s->n);
  }
}

/* A mark of all that a search for a move depends on: where the vertex and its neighbours are, and the limit. The same
 * search again finds the same: nothing, where it found nothing before. */
static uint64_t mark_of(const star *s) {
  const orb_net *net = &s->match->net;
  uint64_t mark = orb_mixed(1, &s->limit2, sizeof s->limit2);
  mark = orb_mixed(mark, orb_net_point(net, s->v), 3 * sizeof(double));
  int first = 0; /* the ring may be listed from any neighbour on */
  for (int i = 1; i < s->n; i++) {
    first = s->ring[i] < s->ring[first] ? i : first;
  }
  for (int i = 0; i < s->n; i++) {
    mark = orb_mixed(mark, orb_net_point(net, s->ring[(first + i) % s->n]), 3 * sizeof(double));
  }
  return mark ? mark : 1;
}

int orb_match_try_move(orb_match *match, int32_t v, double limit2) {
  static const double way[] = {0.5, 0.25, 0.1};
  star s;
  if (match->shape_count > SHAPES_KEPT || match->fixed[v] || !star_of(match, v, limit2, &s)) {
    return 0;
  }
  uint64_t mark = mark_of(&s);
  if (match->stayed[v] == mark) {
    return 0;
  }
  double from[3], middle[3] = {0, 0, 0};
  memcpy(from, orb_net_point(&match->net, v), sizeof from);
  for (int i = 0; i < s.n; i++) {
    for (int k = 0; k < 3; k++) {
      middle[k] += orb_net_point(&match->net, s.ring[i])[k] / s.n;
    }
  }
  orb_form before;
  double cost = form_cost(&s, &before);
  cost += edges_cost(&s, INFINITY);
  int moved = 0;
  for (int i = 0; i <= s.n; i++) {
    const double *to = i < s.n ? orb_net_point(&match->net, s.ring[i]) : middle;
    for (size_t j = 0; j < sizeof way / sizeof way[0]; j++) {
      double p[3];
      for (int k = 0; k < 3; k++) {
        p[k] = from[k] + way[j] * (to[k] - from[k]);
      }
      (void)orb_normalize(p);
      moved |= try_point(&s, p, before, &cost);
    }
  }
  match->stayed[v] = moved ? 0 : mark;
  if (moved) {
    deal_anew(&s);
  }
  return moved;
}

/* A colour for each of the vertices that `which` (may be NULL: all live ones) says, so that neighbours differ: vertices
 * of one colour have no triangle in common, and can move at the same time. 64: none is left, it stays. */
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
  orb_match *match;
  double limit2;
  const int32_t *vertices;
} move_loop;

static void move_range(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  move_loop *loop = arg;
  for (int64_t i = begin; i < end; i++) {
    (void)orb_match_try_move(loop->match, loop->vertices[i], loop->limit2);
  }
}

orb_status orb_match_move_all(orb_context *ctx, orb_match *match, double limit2, const unsigned char *which) {
  int32_t n = match->net.vertex_count;
  unsigned char *colours = ORB_NEW(ctx, unsigned char, n);
  int32_t *vertices = ORB_NEW(ctx, int32_t, n);
  orb_status status = colours && vertices ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    colour(&match->net, which, colours);
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
    move_loop loop = {match, limit2, vertices};
    orb_parallel_for(ctx, count, MOVE_GRAIN, move_range, &loop);
    status = orb_context_check(ctx);
  }
  orb_free(ctx, colours);
  orb_free(ctx, vertices);
  return status;
}
