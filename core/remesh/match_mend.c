/* Triangles that are turned in space against a shape, though none is turned on the sphere: the shape bends, or the map
 * to it shears, within the triangle. In order of price: an edge is turned; a corner is moved, with as many turned edges
 * as it takes; a vertex is added, where the shape bends most along an edge or at a vertex of a shape. Nothing leaves
 * the limit, and no triangle that was fine comes out turned. */
#include <math.h>
#include <string.h>

#include "base/check.h"
#include "numeric/vec3.h"
#include "remesh/match.h"

enum { STAR_MAX = 24, ITEMS = 12 };

typedef struct mender {
  orb_context *ctx;
  orb_match *match;
  double limit2;
  orb_star_goal goal;
} mender;

static int is_turned(const orb_match *match, int32_t t) {
  const int32_t *c = match->net.triangles + 3 * (int64_t)t;
  return c[0] >= 0 && orb_match_is_turned(match, c[0], c[1], c[2]);
}

static int star_of(const orb_net *net, int32_t v, int32_t triangles[STAR_MAX]) {
  int n = 0;
  int32_t first = net->out[v], h = first;
  do {
    if (n == STAR_MAX) {
      return 0;
    }
    triangles[n++] = h / 3;
    h = net->twin[orb_prev(h)];
  } while (h != first);
  return n;
}

/* Points to try as the middle of a star. */
typedef struct trials {
  double point[2 * STAR_MAX + ITEMS + 3][3];
  int count;
} trials;

static void add(trials *list, const double p[3]) {
  memcpy(list->point[list->count++], p, 3 * sizeof(double));
}

/* Adds the middle of two vertices, or of three. */
static void add_middle(trials *list, const orb_match *match, int32_t a, int32_t b, int32_t c) {
  double *out = list->point[list->count++];
  for (int k = 0; k < 3; k++) {
    out[k] = orb_net_point(&match->net, a)[k] + orb_net_point(&match->net, b)[k];
    out[k] += c >= 0 ? orb_net_point(&match->net, c)[k] : 0;
  }
  (void)orb_normalize(out);
}

/* Adds vertices of shapes that lie in the triangles. */
static void add_items(trials *list, const orb_match *match, const int32_t *triangles, int count) {
  int most = list->count + ITEMS;
  for (int i = 0; i < count; i++) {
    int32_t item = match->triangle_items[triangles[i]];
    for (; item >= 0 && list->count < most; item = match->item_next[item]) {
      add(list, orb_match_item_point(match, item));
    }
  }
}

static int try_star(const mender *m, const int32_t *triangles, int count, const trials *list, int least_inner) {
  const orb_star_wish wish = {m->limit2, least_inner, 3, m->goal};
  return orb_match_star(m->match, triangles, count, (const double(*)[3])list->point, list->count, &wish);
}

static int try_corner(const mender *m, int32_t v) {
  orb_match *match = m->match;
  int32_t star[STAR_MAX];
  int n = star_of(&match->net, v, star);
  trials list = {.count = 0};
  if (n == 0 || match->fixed[v]) {
    return 0;
  }
  add(&list, orb_net_point(&match->net, v));
  for (int i = 0; i < n; i++) {
    const int32_t *c = match->net.triangles + 3 * (int64_t)star[i];
    int k = c[0] == v ? 0 : c[1] == v ? 1 : 2;
    add_middle(&list, match, v, c[(k + 1) % 3], -1);
    add_middle(&list, match, v, c[(k + 1) % 3], c[(k + 2) % 3]);
  }
  add_items(&list, match, star, n);
  return try_star(m, star, n, &list, 1);
}

static int try_split(const mender *m, int32_t h) {
  orb_match *match = m->match;
  int32_t pair[2] = {h / 3, match->net.twin[h] / 3};
  int32_t a = match->net.triangles[h], b = match->net.triangles[orb_next(h)];
  orb_stray worst = {0, -1, -1, 0};
  trials list = {.count = 0};
  if (orb_match_edge2(match, a, b, INFINITY, &worst) > 0 && worst.shape >= 0) {
    orb_match_crossing_point(match, a, b, &worst, list.point[list.count++]);
  }
  add_middle(&list, match, a, b, -1);
  add_items(&list, match, pair, 2);
  return try_star(m, pair, 2, &list, 0);
}

static int turn_or_move(const mender *m, int32_t t) {
  orb_match *match = m->match;
  for (int k = 0; k < 3; k++) {
    if (orb_match_try_turn(match, 3 * t + k, m->limit2) && !is_turned(match, t)) {
      return 1;
    }
  }
  for (int k = 0; k < 3; k++) {
    if (orb_match_try_move(match, match->net.triangles[3 * (int64_t)t + k], m->limit2) && !is_turned(match, t)) {
      return 1;
    }
  }
  return 0;
}

static orb_status mend(const mender *m, int32_t t, int *mended) {
  orb_match *match = m->match;
  ORB_TRY(orb_match_reserve(m->ctx, match, 1));
  *mended = turn_or_move(m, t);
  const int32_t *c = match->net.triangles + 3 * (int64_t)t;
  for (int k = 0; k < 3 && !*mended; k++) {
    *mended = try_corner(m, c[k]);
  }
  for (int k = 0; k < 3 && !*mended; k++) {
    *mended = try_split(m, 3 * t + k);
  }
  if (!*mended) {
    trials list = {.count = 0};
    add_middle(&list, match, c[0], c[1], c[2]);
    *mended = try_star(m, &t, 1, &list, 0);
  }
  return ORB_OK;
}

/* Tries to mend every turned triangle; those made on the way wait for the next pass. */
static orb_status pass(const mender *m, unsigned char *turned, int64_t *seen, int64_t *left) {
  orb_match *match = m->match;
  int32_t count = match->net.triangle_count;
  *seen = *left = 0;
  orb_match_mark_turned(m->ctx, match, turned);
  ORB_TRY(orb_context_check(m->ctx));
  for (int32_t t = 0; t < count; t++) {
    int mended = 0;
    if (turned[t] && is_turned(match, t)) {
      ++*seen;
      ORB_TRY(mend(m, t, &mended));
      *left += !mended;
      ORB_TRY(orb_context_check(m->ctx));
    }
  }
  return ORB_OK;
}

orb_status orb_match_mend(orb_context *ctx, orb_match *match, double limit2) {
  static const orb_star_goal goal[] = {ORB_STAR_FEWER, ORB_STAR_FEWER, ORB_STAR_SMALLER, ORB_STAR_FEWER};
  int64_t seen = 1, left = 0, before = -1;
  orb_status status = ORB_OK;
  for (size_t i = 0; i < sizeof goal / sizeof *goal && seen > 0 && status == ORB_OK; i++) {
    mender m = {ctx, match, limit2, goal[i]};
    if (i > 0 && goal[i] == goal[i - 1] && before == left) {
      continue; /* nothing has changed */
    }
    unsigned char *turned = ORB_NEW(ctx, unsigned char, match->net.triangle_count);
    status = turned ? pass(&m, turned, &seen, &left) : ORB_E_NO_MEMORY;
    orb_free(ctx, turned);
    before = seen;
  }
  return status;
}
