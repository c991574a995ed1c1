/* Removes a vertex and triangulates its hole in the best of all ways: dynamic programming over the diagonals of the
 * hole (Klincsek 1980), which admits only edges and triangles that are proved to stay within the limit. Finds a way
 * where no single neighbour sees the whole hole, and lays the new edges along the creases of the shapes. */
#include "remesh/adaptive/fill.h"

#include <math.h>

#include "base/check.h"
#include "numeric/predicates.h"
#include "remesh/placed/bound.h"
#include "remesh/placed/form.h"

enum { MOST = ORB_FILL_MOST };
enum { VALENCE_MAX = 14 }; /* a filled hole must not give a neighbour more neighbours than this, unless it loses some */
enum { ITEMS_MAX = 1024 }; /* holes with more items stay; the size of an array on the stack */

typedef struct hole {
  const orb_placed_net *placed;
  const int32_t *ring;
  int n;
  double limit2;
  int32_t items[ITEMS_MAX];
  int item_count;
  double best[MOST][MOST]; /* least cost of the polygon i…j, including its edge i j */
  int apex[MOST][MOST];
} hole;

static int gather_list(hole *h, int32_t list) {
  for (int32_t i = list; i >= 0; i = h->placed->item_next[i]) {
    if (h->item_count == ITEMS_MAX) {
      return 0;
    }
    h->items[h->item_count++] = i;
  }
  return 1;
}

/* Collects the items of u and of its triangles; 0: too many. */
static int gather(hole *h, int32_t u) {
  const orb_net *net = &h->placed->net;
  int fine = gather_list(h, h->placed->vertex_items[u]);
  int32_t first = net->out[u], e = first;
  do {
    fine = fine && gather_list(h, h->placed->triangle_items[e / 3]);
    e = net->twin[orb_prev(e)];
  } while (e != first);
  return fine;
}

static const double *point(const hole *h, int i) {
  return orb_net_point(&h->placed->net, h->ring[i]);
}

/* Whether all items in the closed triangle are within the limit. */
static int items_allow(const hole *h, int i, int k, int j) {
  const double *a = point(h, i), *b = point(h, k), *c = point(h, j);
  for (int x = 0; x < h->item_count; x++) {
    const double *p = orb_placed_item_point(h->placed, h->items[x]);
    if (orb_orient(a, b, p) >= 0 && orb_orient(b, c, p) >= 0 && orb_orient(c, a, p) >= 0 &&
        orb_placed_item2(h->placed, h->items[x], h->ring[i], h->ring[k], h->ring[j]) > h->limit2) {
      return 0;
    }
  }
  return 1;
}

static double triangle_cost(const hole *h, int i, int k, int j) {
  if (!orb_net_clearly_positive(&h->placed->net, h->ring[i], h->ring[k], h->ring[j]) || !items_allow(h, i, k, j)) {
    return INFINITY;
  }
  orb_form form = orb_placed_form(h->placed, h->ring[i], h->ring[k], h->ring[j]);
  return orb_form_cost(form);
}

static double edge_cost(const hole *h, int i, int j) {
  if (orb_net_adjacent(&h->placed->net, h->ring[i], h->ring[j])) {
    return INFINITY;
  }
  double distance2 = orb_placed_edge2(h->placed, h->ring[i], h->ring[j], h->limit2, NULL);
  return distance2 <= h->limit2 ? distance2 / h->limit2 : INFINITY;
}

static void solve(hole *h) {
  for (int length = 1; length < h->n; length++) {
    for (int i = 0; i + length < h->n; i++) {
      int j = i + length;
      h->best[i][j] = length == 1 ? 0 : INFINITY;
      h->apex[i][j] = -1;
      for (int k = i + 1; k < j; k++) {
        double cost = h->best[i][k] + h->best[k][j];
        if (cost < h->best[i][j]) {
          cost += triangle_cost(h, i, k, j);
        }
        if (cost < h->best[i][j]) {
          h->best[i][j] = cost;
          h->apex[i][j] = k;
        }
      }
      if (length > 1 && length + 1 < h->n && h->best[i][j] < INFINITY) {
        h->best[i][j] += edge_cost(h, i, j);
      }
    }
  }
}

/* Lists the n − 2 triangles of the best way, without recursion. */
static void list_triangles(const hole *h, int (*out)[3]) {
  int stack[MOST][2], top = 0, count = 0;
  stack[top][0] = 0;
  stack[top++][1] = h->n - 1;
  while (top > 0) {
    int i = stack[--top][0], j = stack[top][1];
    if (j - i < 2) {
      continue;
    }
    int k = h->apex[i][j];
    out[count][0] = i;
    out[count][1] = k;
    out[count++][2] = j;
    stack[top][0] = i;
    stack[top++][1] = k;
    stack[top][0] = k;
    stack[top++][1] = j;
  }
}

static int valence(const orb_net *net, int32_t v) {
  int32_t first = net->out[v], h = first;
  int count = 0;
  do {
    count++;
    h = net->twin[orb_prev(h)];
  } while (h != first);
  return count;
}

int orb_adaptive_plan_fill(const orb_placed_net *placed, int32_t u, const int32_t *ring, int n, double limit2,
                           int strict, int (*triangles)[3]) {
  hole h = {.placed = placed, .ring = ring, .n = n, .limit2 = limit2};
  if (n > MOST || !gather(&h, u)) {
    return 0;
  }
  solve(&h);
  if (!(h.best[0][n - 1] < INFINITY)) {
    return 0;
  }
  list_triangles(&h, triangles);
  int corners[MOST] = {0};
  orb_form before = ORB_FORM_BEST, after = ORB_FORM_BEST;
  for (int i = 0; i < n; i++) {
    before = orb_form_join(before, orb_placed_form(placed, u, ring[i], ring[(i + 1) % n]));
  }
  for (int t = 0; t < n - 2; t++) {
    const int *c = triangles[t];
    after = orb_form_join(after, orb_placed_form(placed, ring[c[0]], ring[c[1]], ring[c[2]]));
    corners[c[0]]++;
    corners[c[1]]++;
    corners[c[2]]++;
  }
  for (int i = 0; i < n; i++) {
    if (corners[i] > 2 && valence(&placed->net, ring[i]) + corners[i] - 2 > VALENCE_MAX) {
      return 0;
    }
  }
  if (strict && !orb_form_allows(before, after)) {
    return 0;
  }
  orb_tally tally = {0, 0};
  for (int t = 0; strict && t < n - 2; t++) {
    const int *c = triangles[t];
    orb_tally_add(&tally, orb_placed_inverted_extent(placed, ring[c[0]], ring[c[1]], ring[c[2]]));
  }
  return tally.inverted == 0 || !orb_tally_is_worse(tally, orb_placed_tally_fan(placed, u, ring, n, 1));
}

void orb_adaptive_fill(orb_placed_net *placed, int32_t u, const int32_t *ring, int n, int (*triangles)[3]) {
  orb_net *net = &placed->net;
  int32_t lists[MOST + 1], slots[MOST], e = net->out[u];
  lists[n] = placed->vertex_items[u];
  placed->vertex_items[u] = -1;
  while (net->triangles[orb_next(e)] != ring[0]) {
    e = net->twin[orb_prev(e)];
  }
  for (int i = 0; i < n; i++) {
    slots[i] = e / 3;
    lists[i] = placed->triangle_items[e / 3];
    placed->triangle_items[e / 3] = -1;
    e = net->twin[orb_prev(e)];
  }
  orb_net_fill(net, e, n, triangles);
  for (int i = 0; i <= n; i++) {
    orb_placed_assign_among(placed, lists[i], slots, n - 2);
  }
}
