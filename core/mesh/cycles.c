/* Short cycles that do not divide the surface.
 *
 * Each edge has a label (labels.h). One that is not 0 proves that the cycle does not divide. Cycles that share no
 * vertex leave the surface connected if and only if their classes are independent, and they are if their labels are.
 *
 * Each cycle that does not divide the surface passes an edge whose label is not 0. The shortest one through a vertex of
 * such an edge consists of two shortest paths from there and an edge (Erickson and Whittlesey 2005).
 */
#include "mesh/cycles.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/error.h"
#include "base/grow.h"
#include "base/memory.h"
#include "mesh/dijkstra.h"
#include "mesh/labels.h"
#include "mesh/sort.h"

/* Searches without a limit cover the whole surface: this many vertices in all, and WHOLE_LEAST searches at least. */
enum { WHOLE_VERTICES = 4000000, WHOLE_LEAST = 8 };
/* The searches near generators settle this many vertices in all, and at least NEAR_LEAST each: about a second's work at
 * most, which finds loops of some ten edges. */
enum { NEAR_VERTICES = 6000000, NEAR_LEAST = 64 };
/* Searches that settle more vertices than this (loops of some 20 edges or more) are shared with the seeds around;
 * others cost little, so each seed has its own. SLACK: how much longer than need be a long loop may become, relative.
 * The larger, the fewer searches: their number along a line of seeds is the line's length over half of it. */
enum { LONG_SEARCH = 256 };
static const double SLACK = 0.125;
/* A vertex of more edges than this counts as several settled ones: of a file of few vertices and many faces, each
 * vertex has thousands. Twice the mean of a closed surface, so that others count as one. */
enum { EDGES_A_VERTEX = 12 };
enum { ROUND = 2 };                  /* what labels and a cut cost, in settled vertices for each triangle */
enum { GENERATORS_MOST = 16000000 }; /* edges of all generators that are kept beside those searches: 64 MB */
enum { CHECK_EVERY = 256, SETTLED_EVERY = 65536 }; /* cycles and settled vertices between looks at the deadline */

typedef struct work {
  orb_dijkstra p;
  int32_t *seed, seed_count;
  int32_t *left, left_count; /* half-edges, one for each generator */
  unsigned char *passed;     /* of each vertex: its shortest cycle is not wanted */
  int64_t settled, in_all;   /* by the last search, and by all */
  int64_t *allowed;          /* vertices that searches may still settle; NULL: any number */
  orb_cycle *found;
  int32_t found_count, found_room;
  int32_t *pool;
  int32_t pool_count, pool_room;
} work;

static int64_t larger(int64_t a, int64_t b) {
  return a > b ? a : b;
}

/* The shortest cycle through the seed that does not divide the surface and is shorter than *length: returns the
 * half-edge that closes it and updates *length; −1: there is none. most: vertices to settle. */
static int32_t search(work *w, int32_t seed, int64_t most, double *length) {
  int32_t closing = -1;
  int64_t vertices = 0, edges = 0, check = SETTLED_EVERY;
  orb_dijkstra_start(&w->p, seed);
  for (w->settled = 0; w->p.heap_count > 0 && w->settled < most;) {
    int32_t v = orb_dijkstra_pop(&w->p);
    w->settled = larger(++vertices, edges / EDGES_A_VERTEX);
    int late = 0;
    if (w->settled >= check) {
      late = orb_context_check(w->p.s->ctx) != ORB_OK; /* the caller asks again */
      check += SETTLED_EVERY;
    }
    if (late || 2 * w->p.distance[v] >= *length) {
      break;
    }
    w->p.state[v] = ORB_DIJKSTRA_SETTLED;
    int32_t h = w->p.corner[v];
    do {
      int32_t to = orb_dijkstra_target(&w->p, h);
      double distance = w->p.distance[v] + orb_dijkstra_length(&w->p, h);
      if (orb_dijkstra_is_usable(&w->p, h) && w->p.state[to] != ORB_DIJKSTRA_SETTLED) {
        orb_dijkstra_reach(&w->p, h, distance);
      } else if (orb_dijkstra_is_usable(&w->p, h) && (w->p.walked[v] ^ w->p.walked[to] ^ w->p.label[h]) != 0 &&
                 distance + w->p.distance[to] < *length) {
        *length = distance + w->p.distance[to];
        closing = h;
      }
      edges += vertices > 1; /* each search may begin at a pole */
      h = w->p.s->twin[orb_prev(h)];
    } while (h != w->p.corner[v]);
    w->settled = larger(vertices, edges / EDGES_A_VERTEX);
  }
  w->in_all += w->settled;
  return closing;
}

static orb_status make_room(work *w, int32_t more) {
  if (w->found_count == w->found_room) {
    w->found_room = 2 * w->found_room + 64;
    if (!orb_regrow(w->p.s->ctx, &w->found, (size_t)w->found_room, sizeof *w->found)) {
      return ORB_E_NO_MEMORY;
    }
  }
  if (more > w->pool_room - w->pool_count) {
    if (more > INT32_MAX / 4 - w->pool_count) {
      return ORB_E_NO_MEMORY;
    }
    w->pool_room = 2 * (w->pool_count + more);
    if (!orb_regrow(w->p.s->ctx, &w->pool, (size_t)w->pool_room, sizeof *w->pool)) {
      return ORB_E_NO_MEMORY;
    }
  }
  return ORB_OK;
}

/* The vertex before v on its path; −1: v is the seed. */
static int32_t before(const work *w, int32_t v) {
  return w->p.parent[v] < 0 ? -1 : orb_dijkstra_origin(&w->p, w->p.parent[v]);
}

/* The vertex where the paths to two settled vertices meet. Steps along both in turn, O(the longer way to there). */
static int32_t meeting_of(work *w, int32_t a, int32_t b) {
  int32_t at = a, other = b;
  while (at < 0 || w->p.state[at] != ORB_DIJKSTRA_MARKED) {
    int32_t next = at;
    if (at >= 0) {
      w->p.state[at] = ORB_DIJKSTRA_MARKED;
      next = before(w, at);
    }
    at = other;
    other = next;
  }
  for (int end = 0; end < 2; end++) {
    for (int32_t v = end ? a : b; v >= 0 && w->p.state[v] == ORB_DIJKSTRA_MARKED; v = before(w, v)) {
      w->p.state[v] = ORB_DIJKSTRA_SETTLED;
    }
  }
  return at;
}

/* Keeps the cycle that a half-edge closes with the paths to its ends, without what both paths share. */
static orb_status keep(work *w, int32_t closing) {
  int32_t a = orb_dijkstra_origin(&w->p, closing), b = orb_dijkstra_target(&w->p, closing), down = 0, up = 0;
  int32_t meet = meeting_of(w, a, b);
  for (int32_t v = a; v != meet; v = before(w, v)) {
    down++;
  }
  for (int32_t v = b; v != meet; v = before(w, v)) {
    up++;
  }
  ORB_TRY(make_room(w, down + 1 + up));
  orb_cycle *cycle = &w->found[w->found_count++];
  *cycle = (orb_cycle){.start = w->pool_count, .count = down + 1 + up};
  int32_t *out = w->pool + w->pool_count, at = down;
  for (int32_t v = a; v != meet; v = orb_dijkstra_origin(&w->p, w->p.parent[v])) {
    out[--at] = w->p.parent[v];
  }
  out[down] = closing;
  at = down + 1;
  for (int32_t v = b; v != meet; v = orb_dijkstra_origin(&w->p, w->p.parent[v])) {
    out[at++] = w->p.s->twin[w->p.parent[v]];
  }
  for (int32_t i = 0; i < cycle->count; i++) {
    cycle->length += orb_dijkstra_length(&w->p, out[i]);
    cycle->label ^= w->p.label[out[i]];
  }
  w->pool_count += cycle->count;
  return ORB_OK;
}

/* The cycles of the edges that are left, while the labels of the tree's paths are 0, until they have `most` edges. */
static orb_status keep_generators(work *w, int32_t most) {
  for (int32_t i = 0; i < w->left_count && w->pool_count < most; i++) {
    int32_t a = orb_dijkstra_origin(&w->p, w->left[i]), b = orb_dijkstra_target(&w->p, w->left[i]);
    if (orb_dijkstra_is_usable(&w->p, w->left[i]) && w->p.state[a] == ORB_DIJKSTRA_SETTLED &&
        w->p.state[b] == ORB_DIJKSTRA_SETTLED) {
      ORB_TRY(keep(w, w->left[i]));
    }
    if (i % CHECK_EVERY == 0) {
      ORB_TRY(orb_context_check(w->p.s->ctx));
    }
  }
  return ORB_OK;
}

static orb_status list_seeds(work *w) {
  orb_mesh *mesh = w->p.s->mesh;
  unsigned char *listed = ORB_NEW0(w->p.s->ctx, unsigned char, mesh->vertex_count);
  w->seed = ORB_NEW(w->p.s->ctx, int32_t, mesh->vertex_count);
  orb_status status = listed && w->seed ? ORB_OK : ORB_E_NO_MEMORY;
  for (int32_t h = 0; h < 3 * mesh->triangle_count && status == ORB_OK; h++) {
    if (w->p.label[h] != 0 && h < w->p.s->twin[h] && orb_dijkstra_is_usable(&w->p, h) &&
        !listed[orb_dijkstra_origin(&w->p, h)]) {
      listed[orb_dijkstra_origin(&w->p, h)] = 1;
      w->seed[w->seed_count++] = orb_dijkstra_origin(&w->p, h);
    }
  }
  orb_free(w->p.s->ctx, listed);
  return status;
}

/* Keeps the cycle that each of `count` seeds finds, which are spread over all. most: vertices of each search. */
static orb_status search_seeds(work *w, int64_t count, int64_t most, double limit) {
  for (int64_t i = 0; i < count; i++) {
    double length = limit;
    int32_t closing = search(w, w->seed[i * w->seed_count / count], most, &length);
    if (closing >= 0) {
      ORB_TRY(keep(w, closing));
    }
    ORB_TRY(orb_context_check(w->p.s->ctx));
  }
  return ORB_OK;
}

static orb_status search_whole(work *w) {
  const orb_mesh *mesh = w->p.s->mesh;
  int64_t most = WHOLE_VERTICES / larger(mesh->vertex_count, 3 * (int64_t)mesh->triangle_count / EDGES_A_VERTEX);
  most = most < WHOLE_LEAST ? WHOLE_LEAST : most;
  return search_seeds(w, w->seed_count < most ? w->seed_count : most, INT64_MAX, INFINITY);
}

/* Takes so many settled vertices from what is allowed. */
static orb_status pay(work *w, int64_t settled) {
  if (w->allowed && (*w->allowed -= settled) < 0) {
    return orb_fail(w->p.s->ctx, ORB_E_TOO_LARGE,
                    "The search for the loops around the handles takes more work than a mesh of this size may cause. "
                    "Close only smaller handles, with a lower handle_size, or decimate the mesh.");
  }
  return orb_context_check(w->p.s->ctx);
}

/* The shortest cycle through a vertex is at most twice their distance longer than that through another one. So a long
 * search tells about all seeds near it, which need no search. */
static void pass_near(work *w, double distance) {
  for (int32_t i = 0; i < w->p.touched_count; i++) {
    int32_t v = w->p.touched[i];
    w->passed[v] |= w->p.state[v] == ORB_DIJKSTRA_SETTLED && w->p.distance[v] <= distance;
  }
}

/* Searches all seeds but those that others pass. After a long search the next one goes SLACK beyond the limit: if it
 * finds nothing, the seeds around have no cycle within the limit. If it finds a cycle within the limit, theirs are at
 * most SLACK shorter. */
static orb_status search_within(work *w, double limit) {
  double slack = 0;
  ORB_TRY(pay(w, ROUND * (int64_t)w->p.s->mesh->triangle_count));
  w->passed = ORB_NEW0(w->p.s->ctx, unsigned char, w->p.s->mesh->vertex_count);
  if (!w->passed) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t i = 0; i < w->seed_count; i++) {
    if (w->passed[w->seed[i]]) {
      continue;
    }
    double length = limit * (1 + slack);
    int32_t closing = search(w, w->seed[i], INT64_MAX, &length);
    const int is_within = closing >= 0 && length < limit;
    const int is_long = w->settled > LONG_SEARCH;
    if (is_within) {
      ORB_TRY(keep(w, closing));
    }
    if (is_long) {
      pass_near(w, (is_within ? SLACK * length : length - limit) / 2);
    }
    slack = is_long ? SLACK : 0;
    ORB_TRY(pay(w, w->settled));
  }
  return ORB_OK;
}

/* Searches the surroundings of each edge that is left, and of as many other seeds, so that cycles share no vertex. */
static orb_status search_near(work *w, int64_t settled) {
  int64_t searches = w->left_count < w->seed_count ? w->left_count : w->seed_count;
  int64_t most = settled / 2 < NEAR_VERTICES ? settled / 2 : NEAR_VERTICES;
  most = searches > 0 ? most / searches : most;
  most = most < NEAR_LEAST ? NEAR_LEAST : most;
  ORB_TRY(search_seeds(w, searches, most, INFINITY));
  w->seed_count = 0;
  for (int32_t i = 0; i < w->left_count && w->seed_count < searches; i++) {
    if (orb_dijkstra_is_usable(&w->p, w->left[i])) {
      w->seed[w->seed_count++] = orb_dijkstra_origin(&w->p, w->left[i]);
    }
  }
  return search_seeds(w, w->seed_count, most, INFINITY);
}

/* Adds a label to a basis of labels unless it depends on them. */
static int is_independent(uint64_t basis[64], uint64_t label) {
  for (int bit = 63; bit >= 0; bit--) {
    if (!(label >> bit & 1)) {
      continue;
    }
    if (!basis[bit]) {
      basis[bit] = label;
      return 1;
    }
    label ^= basis[bit];
  }
  return 0;
}

static int is_free(const work *w, const orb_cycle *cycle, const unsigned char *taken) {
  for (int32_t i = 0; i < cycle->count; i++) {
    if (taken[orb_dijkstra_origin(&w->p, w->pool[cycle->start + i])]) {
      return 0;
    }
  }
  return 1;
}

/* Chooses cycles that share no vertex, shortest first, and moves the result to `out`. independent: only cycles whose
 * labels are independent; labels have 64 bits, so 64 cycles at most. */
static orb_status choose(work *w, int32_t most, int independent, orb_cycles *out) {
  orb_context *ctx = w->p.s->ctx;
  uint64_t basis[64] = {0};
  unsigned char *taken = ORB_NEW0(ctx, unsigned char, w->p.s->mesh->vertex_count);
  uint64_t *order = ORB_NEW(ctx, uint64_t, w->found_count);
  out->cycle = ORB_NEW(ctx, orb_cycle, w->found_count);
  if (!taken || !order || !out->cycle) {
    orb_free(ctx, taken);
    orb_free(ctx, order);
    return ORB_E_NO_MEMORY;
  }
  for (int32_t i = 0; i < w->found_count; i++) {
    float length = (float)w->found[i].length; /* the bits of a positive float are in its order */
    uint32_t bits;
    memcpy(&bits, &length, sizeof bits);
    order[i] = (uint64_t)bits << 32 | (uint32_t)i;
  }
  orb_sort_u64(order, w->found_count);
  for (int32_t i = 0; i < w->found_count && out->count < most; i++) {
    const orb_cycle *cycle = &w->found[(uint32_t)order[i]];
    if (is_free(w, cycle, taken) && (!independent || is_independent(basis, cycle->label))) {
      out->cycle[out->count++] = *cycle;
      for (int32_t k = 0; k < cycle->count; k++) {
        taken[orb_dijkstra_origin(&w->p, w->pool[cycle->start + k])] = 1;
      }
    }
  }
  out->half_edges = w->pool;
  out->settled = w->in_all;
  w->pool = NULL;
  orb_free(ctx, taken);
  orb_free(ctx, order);
  return ORB_OK;
}

static orb_status open_work(work *w, orb_surface *s, orb_cycles *out) {
  *out = (orb_cycles){0};
  ORB_TRY(orb_dijkstra_open(&w->p, s));
  return orb_labels_find(&w->p, &w->left, &w->left_count);
}

static void close_work(work *w) {
  orb_context *ctx = w->p.s->ctx;
  orb_dijkstra_close(&w->p);
  orb_free(ctx, w->passed);
  orb_free(ctx, w->seed);
  orb_free(ctx, w->left);
  orb_free(ctx, w->found);
  orb_free(ctx, w->pool);
}

orb_status orb_cycles_find(orb_surface *s, double limit, int32_t most, int64_t *allowed, orb_cycles *out) {
  work w = {.allowed = allowed};
  orb_status status = open_work(&w, s, out);
  if (status == ORB_OK && !isfinite(limit)) {
    status = keep_generators(&w, INT32_MAX);
  }
  if (status == ORB_OK) {
    status = list_seeds(&w);
  }
  if (status == ORB_OK) {
    status = isfinite(limit) ? search_within(&w, limit) : search_whole(&w);
  }
  if (status == ORB_OK) {
    status = choose(&w, most, most <= ORB_CYCLES_LABELLED, out);
  }
  close_work(&w);
  return status;
}

orb_status orb_cycles_generate(orb_surface *s, int64_t settled, orb_cycles *out) {
  work w = {0};
  orb_status status = open_work(&w, s, out);
  if (status == ORB_OK) {
    status = keep_generators(&w, GENERATORS_MOST);
  }
  if (status == ORB_OK) {
    status = list_seeds(&w);
  }
  if (status == ORB_OK) {
    status = search_near(&w, settled);
  }
  if (status == ORB_OK) {
    status = choose(&w, INT32_MAX, 0, out);
  }
  close_work(&w);
  return status;
}

void orb_cycles_free(orb_context *ctx, orb_cycles *cycles) {
  orb_free(ctx, cycles->cycle);
  orb_free(ctx, cycles->half_edges);
  *cycles = (orb_cycles){0};
}
