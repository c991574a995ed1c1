/* A vertex goes and its hole is triangulated anew, in the best of all ways: dynamic programming over the diagonals of
 * the hole (Klincsek 1980), where an edge or a triangle counts only if it is proved to stay within the limit. Finds
 * room where no single neighbour sees the whole hole, and lays the new edges along the creases of the shapes. */
#include <math.h>

#include "base/check.h"
#include "numeric/predicates.h"
#include "remesh/adaptive/match.h"

enum { MOST = ORB_FILL_MOST, VALENCE_MAX = 14, ITEMS_MAX = 1024 };

typedef struct hole {
  const orb_match *match;
  const int32_t *ring;
  int n;
  double limit2;
  int32_t items[ITEMS_MAX];
  int item_count;
  double best[MOST][MOST]; /* least cost of the polygon i…j, its edge i j included */
  int apex[MOST][MOST];
} hole;

static int gather_list(hole *h, int32_t list) {
  for (int32_t i = list; i >= 0; i = h->match->item_next[i]) {
    if (h->item_count == ITEMS_MAX) {
      return 0;
    }
    h->items[h->item_count++] = i;
  }
  return 1;
}

/* All items that lose their triangle, or vertex, with u; 0: too many. */
static int gather(hole *h, int32_t u) {
  const orb_net *net = &h->match->net;
  int fine = gather_list(h, h->match->vertex_items[u]);
  int32_t first = net->out[u], e = first;
  do {
    fine = fine && gather_list(h, h->match->triangle_items[e / 3]);
    e = net->twin[orb_prev(e)];
  } while (e != first);
  return fine;
}

static const double *point(const hole *h, int i) {
  return orb_net_point(&h->match->net, h->ring[i]);
}

/* Whether all items in the triangle (also those on its edges) are near enough. */
static int items_allow(const hole *h, int i, int k, int j) {
  const double *a = point(h, i), *b = point(h, k), *c = point(h, j);
  for (int x = 0; x < h->item_count; x++) {
    const double *p = orb_match_item_point(h->match, h->items[x]);
    if (orb_orient(a, b, p) >= 0 && orb_orient(b, c, p) >= 0 && orb_orient(c, a, p) >= 0 &&
        orb_match_item2(h->match, h->items[x], h->ring[i], h->ring[k], h->ring[j]) > h->limit2) {
      return 0;
    }
  }
  return 1;
}

static double triangle_cost(const hole *h, int i, int k, int j) {
  if (orb_orient(point(h, i), point(h, k), point(h, j)) <= 0 ||
      !orb_net_sound(&h->match->net, h->ring[i], h->ring[k], h->ring[j]) || !items_allow(h, i, k, j)) {
    return INFINITY;
  }
  orb_form form = orb_match_form(h->match, h->ring[i], h->ring[k], h->ring[j]);
  return orb_form_cost(form);
}

static double edge_cost(const hole *h, int i, int j) {
  if (orb_net_adjacent(&h->match->net, h->ring[i], h->ring[j])) {
    return INFINITY;
  }
  double distance2 = orb_match_edge2(h->match, h->ring[i], h->ring[j], h->limit2, NULL);
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

/* Reads the triangles off, without recursion: n − 2 of them. */
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

int orb_match_plan_fill(const orb_match *match, int32_t u, const int32_t *ring, int n, double limit2, int strict,
                        int (*triangles)[3]) {
  hole h = {.match = match, .ring = ring, .n = n, .limit2 = limit2};
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
    before = orb_form_join(before, orb_match_form(match, u, ring[i], ring[(i + 1) % n]));
  }
  for (int t = 0; t < n - 2; t++) {
    const int *c = triangles[t];
    after = orb_form_join(after, orb_match_form(match, ring[c[0]], ring[c[1]], ring[c[2]]));
    corners[c[0]]++;
    corners[c[1]]++;
    corners[c[2]]++;
  }
  for (int i = 0; i < n; i++) {
    if (corners[i] > 2 && valence(&match->net, ring[i]) + corners[i] - 2 > VALENCE_MAX) {
      return 0;
    }
  }
  if (strict && !orb_form_allows(before, after)) {
    return 0;
  }
  orb_tally tally = {0, 0};
  for (int t = 0; strict && t < n - 2; t++) {
    const int *c = triangles[t];
    orb_tally_add(&tally, orb_match_turned_extent(match, ring[c[0]], ring[c[1]], ring[c[2]]));
  }
  return tally.turned == 0 || !orb_tally_is_worse(tally, orb_match_tally_fan(match, u, ring, n, 1));
}

void orb_match_fill(orb_match *match, int32_t u, const int32_t *ring, int n, int (*triangles)[3]) {
  orb_net *net = &match->net;
  int32_t lists[MOST + 1], slots[MOST], e = net->out[u];
  lists[n] = match->vertex_items[u];
  match->vertex_items[u] = -1;
  while (net->triangles[orb_next(e)] != ring[0]) {
    e = net->twin[orb_prev(e)];
  }
  for (int i = 0; i < n; i++) {
    slots[i] = e / 3;
    lists[i] = match->triangle_items[e / 3];
    match->triangle_items[e / 3] = -1;
    e = net->twin[orb_prev(e)];
  }
  orb_net_fill(net, e, n, triangles);
  for (int i = 0; i <= n; i++) {
    orb_match_deal_among(match, lists[i], slots, n - 2);
  }
}
