/* Repairs triangles that are inverted in space on some shape, though none is flipped on the sphere: the shape bends, or
 * the map to it shears, within the triangle. In order of cost: flip an edge; move a corner, with as many edge flips as
 * necessary; add a vertex where the shape bends most along an edge, or at a vertex of a shape. No step leaves the limit
 * or inverts a triangle that was not inverted. Edges are flipped one after another; corners that share no edge move in
 * parallel; the more expensive ways are searched in parallel and carried out one after another. A triangle that could
 * not be repaired is tried again only after something around it has changed. */
#include "remesh/adaptive/repair.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "base/parallel.h"
#include "numeric/vec3.h"
#include "remesh/adaptive/move.h"
#include "remesh/adaptive/star.h"
#include "remesh/placed/bound.h"
#include "remesh/placed/flip.h"
#include "remesh/placed/form.h"
#include "remesh/placed/marks.h"

enum { STAR_MAX = 24 };          /* corners with more neighbours do not move; the size of an array on the stack */
enum { ITEMS = 12 };             /* items tried as the middle of one star; more find more and take longer */
enum { WAYS = 7, NO_WAY = 255 }; /* three corners, three edges, the middle: see try_way() */
enum { INNER_MOST = 3 };         /* vertices that a star may remove: more repair more and coarsen the net */

typedef struct repairer {
  orb_context *ctx;
  orb_placed_net *placed;
  double limit2;
  orb_star_goal goal;
  int32_t *inverted;  /* the triangles of a pass */
  unsigned char *way; /* for each: the way that was found, or NO_WAY */
  uint64_t *marks;    /* per vertex: of its neighbours (marks.h), while ways are searched */
  int thread;         /* ≥ 0: only test whether a way works, on this thread */
} repairer;

static int is_inverted(const orb_placed_net *placed, int32_t t) {
  const int32_t *c = placed->net.triangles + 3 * (int64_t)t;
  return c[0] >= 0 && orb_placed_is_inverted(placed, c[0], c[1], c[2]);
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

/* Adds the middle of two vertices, or of three; c: −1 for two. */
static void add_middle(trials *list, const orb_placed_net *placed, int32_t a, int32_t b, int32_t c) {
  double *out = list->point[list->count++];
  for (int k = 0; k < 3; k++) {
    out[k] = orb_net_point(&placed->net, a)[k] + orb_net_point(&placed->net, b)[k];
    out[k] += c >= 0 ? orb_net_point(&placed->net, c)[k] : 0;
  }
  (void)orb_normalize(out);
}

/* Adds the points of items that lie in the triangles. */
static void add_items(trials *list, const orb_placed_net *placed, const int32_t *triangles, int count) {
  int most = list->count + ITEMS;
  for (int i = 0; i < count; i++) {
    int32_t item = placed->triangle_items[triangles[i]];
    for (; item >= 0 && list->count < most; item = placed->item_next[item]) {
      add(list, orb_placed_item_point(placed, item));
    }
  }
}

static int try_star(const repairer *m, const int32_t *triangles, int count, const trials *list, int least_inner) {
  const orb_star_wish wish = {m->limit2, least_inner, INNER_MOST, m->goal};
  const double(*points)[3] = (const double(*)[3])list->point;
  return m->thread < 0 ? orb_adaptive_star(m->placed, triangles, count, points, list->count, &wish)
                       : orb_adaptive_can_star(m->placed, triangles, count, points, list->count, &wish, m->thread);
}

static int try_corner(const repairer *m, int32_t v) {
  orb_placed_net *placed = m->placed;
  int32_t star[STAR_MAX];
  int n = star_of(&placed->net, v, star);
  trials list = {.count = 0};
  if (n == 0 || placed->fixed[v]) {
    return 0;
  }
  add(&list, orb_net_point(&placed->net, v));
  for (int i = 0; i < n; i++) {
    const int32_t *c = placed->net.triangles + 3 * (int64_t)star[i];
    int k = c[0] == v ? 0 : c[1] == v ? 1 : 2;
    add_middle(&list, placed, v, c[(k + 1) % 3], -1);
    add_middle(&list, placed, v, c[(k + 1) % 3], c[(k + 2) % 3]);
  }
  add_items(&list, placed, star, n);
  return try_star(m, star, n, &list, 1);
}

static int try_split(const repairer *m, int32_t h) {
  orb_placed_net *placed = m->placed;
  int32_t pair[2] = {h / 3, placed->net.twin[h] / 3};
  int32_t a = placed->net.triangles[h], b = placed->net.triangles[orb_next(h)];
  orb_deviation worst = ORB_NO_DEVIATION;
  trials list = {.count = 0};
  if (orb_placed_edge2(placed, a, b, INFINITY, &worst) > 0 && worst.shape >= 0) {
    orb_placed_crossing_point(placed, a, b, &worst, list.point[list.count++]);
  }
  add_middle(&list, placed, a, b, -1);
  add_items(&list, placed, pair, 2);
  return try_star(m, pair, 2, &list, 0);
}

/* By the star of a corner (way 0 to 2), of a point on an edge (3 to 5) or of the middle (6). */
static int try_way(const repairer *m, int32_t t, int way) {
  const int32_t *c = m->placed->net.triangles + 3 * (int64_t)t;
  if (way < 3) {
    return try_corner(m, c[way]);
  }
  if (way < 6) {
    return try_split(m, 3 * t + way - 3);
  }
  trials list = {.count = 0};
  add_middle(&list, m->placed, c[0], c[1], c[2]);
  return try_star(m, &t, 1, &list, 0);
}

/* A mark of what the ways of a triangle depend on, except what lies beyond its corners' neighbours' neighbours. */
static uint64_t mark_of(const repairer *m, int32_t t) {
  uint64_t mark = orb_mark_mix(1, &m->limit2, sizeof m->limit2), sum = (uint64_t)m->goal;
  for (int k = 0; k < 3; k++) {
    sum += orb_mark_of_surroundings(&m->placed->net, m->marks, m->placed->net.triangles[3 * (int64_t)t + k]);
  }
  mark = orb_mark_mix(mark, &sum, sizeof sum);
  return mark ? mark : 1;
}

static void find_range(void *arg, int64_t begin, int64_t end, int thread) {
  repairer m = *(const repairer *)arg;
  m.thread = thread;
  for (int64_t i = begin; i < end; i++) {
    int32_t t = m.inverted[i];
    uint64_t mark = mark_of(&m, t), *no_repair = m.placed->no_repair + 2 * (int64_t)t + (m.goal == ORB_STAR_SMALLER);
    m.way[i] = NO_WAY;
    for (int way = 0; way < WAYS && m.way[i] == NO_WAY && *no_repair != mark; way++) {
      m.way[i] = try_way(&m, t, way) ? (unsigned char)way : NO_WAY;
    }
    *no_repair = m.way[i] == NO_WAY ? mark : 0;
  }
}

/* Flips edges and moves corners of the inverted triangles. *seen: how many there were; *left: how many remain, listed
 * in m->inverted. */
static orb_status flip_and_move(repairer *m, unsigned char *marked, int64_t *seen, int64_t *left) {
  orb_placed_net *placed = m->placed;
  const orb_net *net = &placed->net;
  *seen = *left = 0;
  orb_placed_mark_inverted(m->ctx, placed, marked);
  for (int32_t t = 0; t < net->triangle_count; t++) {
    for (int k = 0; k < 3 && marked[t] && is_inverted(placed, t); k++) {
      *seen += k == 0;
      (void)orb_placed_try_flip(placed, 3 * t + k, m->limit2);
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
  orb_status status = orb_adaptive_move_all(m->ctx, placed, m->limit2, which);
  orb_free(m->ctx, which);
  for (int32_t t = 0; t < net->triangle_count && status == ORB_OK; t++) {
    if (marked[t] && is_inverted(placed, t)) {
      m->inverted[(*left)++] = t;
    }
  }
  return status;
}

/* Searches a way for every inverted triangle, side by side. */
static orb_status find_all(repairer *m, int64_t count) {
  if (count == 0) {
    return ORB_OK;
  }
  m->marks = ORB_NEW(m->ctx, uint64_t, m->placed->net.vertex_count);
  if (!m->marks) {
    return ORB_E_NO_MEMORY;
  }
  orb_marks_of_rings(m->ctx, &m->placed->net, m->marks);
  orb_parallel_for(m->ctx, count, 1, find_range, m);
  orb_free(m->ctx, m->marks);
  m->marks = NULL;
  return ORB_OK;
}

/* Tries to repair every inverted triangle; new ones wait for the next pass. */
static orb_status pass(repairer *m, unsigned char *marked, int64_t *seen, int64_t *left) {
  ORB_TRY(flip_and_move(m, marked, seen, left));
  ORB_TRY(orb_placed_reserve(m->ctx, m->placed, orb_threads(m->ctx)));
  int64_t count = *left;
  ORB_TRY(find_all(m, count));
  for (int64_t i = 0; i < count; i++) {
    int32_t t = m->inverted[i];
    if (m->way[i] == NO_WAY || !is_inverted(m->placed, t)) {
      *left -= m->way[i] != NO_WAY;
      continue;
    }
    ORB_TRY(orb_placed_reserve(m->ctx, m->placed, 1));
    int repaired = try_way(m, t, m->way[i]);
    for (int way = 0; way < WAYS && !repaired; way++) { /* an earlier repair beside it has changed what it found */
      repaired = try_way(m, t, way);
    }
    *left -= repaired;
    ORB_TRY(orb_context_check(m->ctx));
  }
  return ORB_OK;
}

orb_status orb_adaptive_repair(orb_context *ctx, orb_placed_net *placed, double limit2) {
  static const orb_star_goal goal[] = {ORB_STAR_FEWER, ORB_STAR_FEWER, ORB_STAR_SMALLER, ORB_STAR_FEWER};
  int64_t seen = 1, left = 0, before = -1;
  orb_status status = ORB_OK;
  for (size_t i = 0; i < sizeof goal / sizeof *goal && seen > 0 && status == ORB_OK; i++) {
    if (i > 0 && goal[i] == goal[i - 1] && before == left) {
      continue; /* the last pass has changed nothing */
    }
    repairer m = {.ctx = ctx, .placed = placed, .limit2 = limit2, .goal = goal[i], .thread = -1};
    unsigned char *marked = ORB_NEW(ctx, unsigned char, placed->net.triangle_count);
    m.inverted = ORB_NEW(ctx, int32_t, placed->net.triangle_count);
    m.way = ORB_NEW(ctx, unsigned char, placed->net.triangle_count);
    status = marked && m.inverted && m.way ? pass(&m, marked, &seen, &left) : ORB_E_NO_MEMORY;
    orb_free(ctx, marked);
    orb_free(ctx, m.inverted);
    orb_free(ctx, m.way);
    before = seen;
  }
  return status;
}
