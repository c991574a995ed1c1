/* Triangles that are turned in space against a shape, though none is turned on the sphere: the shape bends, or the map
 * to it shears, within the triangle. In order of price: an edge is turned; a corner is moved, with as many turned edges
 * as it takes; a vertex is added, where the shape bends most along an edge or at a vertex of a shape. Nothing leaves
 * the limit, and no triangle that was fine comes out turned. Edges are turned one after another; corners without an
 * edge between them move side by side; and which of the dear ways works for a triangle is looked for side by side, to
 * be gone one after another. What could not be mended is tried again only when something around it has changed. */
#include <math.h>
#include <string.h>

#include "base/check.h"
#include "numeric/vec3.h"
#include "remesh/adaptive/match.h"

enum { STAR_MAX = 24, ITEMS = 12, WAYS = 7, NO_WAY = 255 };

typedef struct mender {
  orb_context *ctx;
  orb_match *match;
  double limit2;
  orb_star_goal goal;
  int32_t *turned;    /* the triangles of a pass */
  unsigned char *way; /* for each: the way that was found */
  int thread;         /* ≥ 0: only to tell whether it can be done */
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
  const double(*points)[3] = (const double(*)[3])list->point;
  return m->thread < 0 ? orb_match_star(m->match, triangles, count, points, list->count, &wish)
                       : orb_match_can_star(m->match, triangles, count, points, list->count, &wish, m->thread);
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

/* By a star: of a corner, of a point on an edge, or of the middle. */
static int try_way(const mender *m, int32_t t, int way) {
  const int32_t *c = m->match->net.triangles + 3 * (int64_t)t;
  if (way < 3) {
    return try_corner(m, c[way]);
  }
  if (way < 6) {
    return try_split(m, 3 * t + way - 3);
  }
  trials list = {.count = 0};
  add_middle(&list, m->match, c[0], c[1], c[2]);
  return try_star(m, &t, 1, &list, 0);
}

/* A mark of what the ways of a triangle depend on, but for what is far. */
static uint64_t mark_of(const mender *m, int32_t t) {
  uint64_t mark = orb_mixed(1, &m->limit2, sizeof m->limit2), sum = (uint64_t)m->goal;
  for (int k = 0; k < 3; k++) {
    sum += orb_match_surroundings(m->match, m->match->net.triangles[3 * (int64_t)t + k]);
  }
  mark = orb_mixed(mark, &sum, sizeof sum);
  return mark ? mark : 1;
}

static void find_range(void *arg, int64_t begin, int64_t end, int thread) {
  mender m = *(const mender *)arg;
  m.thread = thread;
  for (int64_t i = begin; i < end; i++) {
    int32_t t = m.turned[i];
    uint64_t mark = mark_of(&m, t), *hopeless = m.match->hopeless + 2 * (int64_t)t + (m.goal == ORB_STAR_SMALLER);
    m.way[i] = NO_WAY;
    for (int way = 0; way < WAYS && m.way[i] == NO_WAY && *hopeless != mark; way++) {
      m.way[i] = try_way(&m, t, way) ? (unsigned char)way : NO_WAY;
    }
    *hopeless = m.way[i] == NO_WAY ? mark : 0;
  }
}

/* Turns edges and moves corners of the turned triangles; sets how many are left, in m->turned. */
static orb_status turn_and_move(mender *m, unsigned char *marked, int64_t *seen, int64_t *left) {
  orb_match *match = m->match;
  const orb_net *net = &match->net;
  *seen = *left = 0;
  orb_match_mark_turned(m->ctx, match, marked);
  for (int32_t t = 0; t < net->triangle_count; t++) {
    for (int k = 0; k < 3 && marked[t] && is_turned(match, t); k++) {
      *seen += k == 0;
      (void)orb_match_try_turn(match, 3 * t + k, m->limit2);
    }
  }
  ORB_TRY(orb_context_check(m->ctx));
  unsigned char *which = ORB_NEW0(m->ctx, unsigned char, net->vertex_count);
  if (!which) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t t = 0; t < net->triangle_count; t++) {
    for (int k = 0; k < 3 && marked[t] && net->triangles[3 * (int64_t)t] >= 0; k++) {
      which[net->triangles[3 * (int64_t)t + k]] = 1;
    }
  }
  orb_status status = orb_match_move_all(m->ctx, match, m->limit2, which);
  orb_free(m->ctx, which);
  for (int32_t t = 0; t < net->triangle_count && status == ORB_OK; t++) {
    if (marked[t] && is_turned(match, t)) {
      m->turned[(*left)++] = t;
    }
  }
  return status;
}

/* Tries to mend every turned triangle; those made on the way wait for the next pass. */
static orb_status pass(mender *m, unsigned char *marked, int64_t *seen, int64_t *left) {
  ORB_TRY(turn_and_move(m, marked, seen, left));
  ORB_TRY(orb_match_reserve(m->ctx, m->match, orb_threads(m->ctx)));
  int64_t count = *left;
  orb_parallel_for(m->ctx, count, 1, find_range, m);
  for (int64_t i = 0; i < count; i++) {
    int32_t t = m->turned[i];
    if (m->way[i] == NO_WAY || !is_turned(m->match, t)) {
      *left -= m->way[i] != NO_WAY;
      continue;
    }
    ORB_TRY(orb_match_reserve(m->ctx, m->match, 1));
    int mended = try_way(m, t, m->way[i]);
    for (int way = 0; way < WAYS && !mended; way++) { /* something beside it was mended before */
      mended = try_way(m, t, way);
    }
    *left -= mended;
    ORB_TRY(orb_context_check(m->ctx));
  }
  return ORB_OK;
}

orb_status orb_match_mend(orb_context *ctx, orb_match *match, double limit2) {
  static const orb_star_goal goal[] = {ORB_STAR_FEWER, ORB_STAR_FEWER, ORB_STAR_SMALLER, ORB_STAR_FEWER};
  int64_t seen = 1, left = 0, before = -1;
  orb_status status = ORB_OK;
  for (size_t i = 0; i < sizeof goal / sizeof *goal && seen > 0 && status == ORB_OK; i++) {
    if (i > 0 && goal[i] == goal[i - 1] && before == left) {
      continue; /* nothing has changed */
    }
    mender m = {.ctx = ctx, .match = match, .limit2 = limit2, .goal = goal[i], .thread = -1};
    unsigned char *marked = ORB_NEW(ctx, unsigned char, match->net.triangle_count);
    m.turned = ORB_NEW(ctx, int32_t, match->net.triangle_count);
    m.way = ORB_NEW(ctx, unsigned char, match->net.triangle_count);
    status = marked && m.turned && m.way ? pass(&m, marked, &seen, &left) : ORB_E_NO_MEMORY;
    orb_free(ctx, marked);
    orb_free(ctx, m.turned);
    orb_free(ctx, m.way);
    before = seen;
  }
  return status;
}
