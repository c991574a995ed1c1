/* Short cycles that do not divide the surface.
 *
 * A spanning tree of the vertices and one of the faces that crosses none of its edges leave 2·genus edges over, one for
 * each generator of the homology (tree–cotree decomposition, Eppstein 2003). Each generator gets a random 64-bit word.
 * The label of an edge is the XOR of the words whose dual cycles cross it: a cocycle, so the XOR along a closed walk
 * depends on the walk's homology class only and is 0 where the walk divides the surface or is contractible (annotation,
 * Busaryev, Cabello, Chen, Dey and Wang 2012). A label that is not 0 proves that the cycle does not divide; a class
 * that is not 0 has the label 0 with a chance of 2⁻⁶⁴. Cycles that share no vertex leave the surface connected if and
 * only if their classes are independent, and they are if their labels are.
 *
 * Each cycle that does not divide the surface passes an edge whose label is not 0. The shortest one through a vertex of
 * such an edge consists of two shortest paths from there and an edge (Erickson and Whittlesey 2005).
 */
#include "mesh/cycles.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/grow.h"
#include "base/memory.h"
#include "mesh/dijkstra.h"
#include "mesh/sort.h"

/* Searches without a limit cover the whole surface: this many vertices in all, and WHOLE_LEAST searches at least. */
enum { WHOLE_VERTICES = 4000000, WHOLE_LEAST = 8 };
/* The searches near generators settle this many vertices in all, and at least NEAR_LEAST each: about a second's work at
 * most, which finds loops of some ten edges. */
enum { NEAR_VERTICES = 6000000, NEAR_LEAST = 64 };
enum { GENERATORS_MOST = 16000000 }; /* edges of all generators that are kept beside those searches: 64 MB */
enum { CHECK_EVERY = 256, SETTLED_EVERY = 65536 }; /* cycles and settled vertices between looks at the deadline */

typedef struct work {
  orb_dijkstra p;
  unsigned char *in; /* of each half-edge: TREE, COTREE */
  int32_t *seed, seed_count;
  int32_t *left, left_count; /* half-edges of neither tree */
  orb_cycle *found;
  int32_t found_count, found_room;
  int32_t *pool;
  int32_t pool_count, pool_room;
} work;

enum { TREE = 1, COTREE = 2 };

/* The shortest cycle through the seed that does not divide the surface and is shorter than *length: returns the
 * half-edge that closes it and updates *length; −1: there is none. most: vertices to settle. */
static int32_t search(work *w, int32_t seed, int64_t most, double *length) {
  int32_t closing = -1;
  orb_dijkstra_start(&w->p, seed);
  for (int64_t settled = 1; w->p.heap_count > 0 && settled <= most; settled++) {
    int32_t v = orb_dijkstra_pop(&w->p);
    int late = settled % SETTLED_EVERY == 0 && orb_context_check(w->p.s->ctx) != ORB_OK; /* the caller asks again */
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
      h = w->p.s->twin[orb_prev(h)];
    } while (h != w->p.corner[v]);
  }
  return closing;
}

/* The spanning tree of the vertices: shortest paths over usable edges, then any edge to the vertices that are left. */
static orb_status grow_tree(work *w) {
  const orb_mesh *mesh = w->p.s->mesh;
  int32_t root = mesh->triangles[0];
  memset(w->p.label, 0, 3 * (size_t)mesh->triangle_count * sizeof *w->p.label);
  orb_dijkstra_start(&w->p, root);
  for (int64_t n = 0; w->p.heap_count > 0; n++) {
    int32_t v = orb_dijkstra_pop(&w->p), h = w->p.corner[v];
    w->p.state[v] = ORB_DIJKSTRA_SETTLED;
    do {
      if (orb_dijkstra_is_usable(&w->p, h)) {
        orb_dijkstra_reach(&w->p, h, w->p.distance[v] + orb_dijkstra_length(&w->p, h));
      }
      h = w->p.s->twin[orb_prev(h)];
    } while (h != w->p.corner[v]);
    if (n % 65536 == 0) {
      ORB_TRY(orb_context_check(w->p.s->ctx));
    }
  }
  for (int32_t i = 0; i < w->p.touched_count; i++) { /* grows while it runs */
    int32_t v = w->p.touched[i], h = w->p.corner[v];
    do {
      int32_t to = orb_dijkstra_target(&w->p, h);
      if (w->p.state[to] == ORB_DIJKSTRA_UNSEEN) {
        w->p.state[to] = ORB_DIJKSTRA_WAITING; /* stays: its path has an edge that is not the file's */
        w->p.distance[to] = w->p.distance[v] + orb_dijkstra_length(&w->p, h);
        w->p.parent[to] = h;
        w->p.walked[to] = 0;
        w->p.touched[w->p.touched_count++] = to;
      }
      h = w->p.s->twin[orb_prev(h)];
    } while (h != w->p.corner[v]);
  }
  for (int32_t i = 0; i < w->p.touched_count; i++) {
    int32_t h = w->p.parent[w->p.touched[i]];
    if (h >= 0) {
      w->in[h] = w->in[w->p.s->twin[h]] = TREE;
    }
  }
  return ORB_OK;
}

typedef struct cotree {
  int32_t *queue, *stack, *arrival; /* faces as reached; those to spread first; the half-edge into each face */
  int32_t tail, depth;
  uint64_t *sum;
} cotree;

static void claim(work *w, cotree *c, int32_t h) {
  int32_t g = w->p.s->twin[h];
  if ((w->in[h] & TREE) || c->arrival[g / 3] != -2) {
    return;
  }
  c->arrival[g / 3] = g;
  w->in[h] = w->in[g] = COTREE;
  c->queue[c->tail++] = g / 3;
  if (w->p.s->mesh->source_triangle[g / 3] < 0) {
    c->stack[c->depth++] = g / 3;
  }
}

/* The spanning tree of the faces. Faces that a repair made are crossed first, so that usable edges are left over. */
static void grow_cotree(work *w, cotree *c) {
  for (int32_t t = 0; t < w->p.s->mesh->triangle_count; t++) {
    c->arrival[t] = -2;
  }
  c->arrival[0] = -1;
  c->queue[c->tail++] = 0;
  if (w->p.s->mesh->source_triangle[0] < 0) {
    c->stack[c->depth++] = 0;
  }
  for (int32_t head = 0; head < c->tail || c->depth > 0;) {
    if (c->depth > 0) {
      int32_t t = c->stack[--c->depth];
      for (int32_t h = 3 * t; h < 3 * t + 3; h++) {
        if (!orb_dijkstra_is_usable(&w->p, h)) {
          claim(w, c, h);
        }
      }
      continue;
    }
    int32_t t = c->queue[head++];
    for (int32_t h = 3 * t; h < 3 * t + 3; h++) {
      claim(w, c, h);
    }
  }
}

/* A word for each generator: splitmix64 (Steele, Lea and Flood 2014). */
static uint64_t word_of(int32_t i) {
  uint64_t x = ((uint64_t)i + 1) * 0x9e3779b97f4a7c15u;
  x = (x ^ x >> 30) * 0xbf58476d1ce4e5b9u;
  x = (x ^ x >> 27) * 0x94d049bb133111ebu;
  return x ^ x >> 31;
}

static void label_edges(work *w, cotree *c) {
  int32_t half_edges = 3 * w->p.s->mesh->triangle_count;
  for (int32_t h = 0; h < half_edges; h++) {
    int32_t g = w->p.s->twin[h];
    if (g < h || w->in[h]) {
      continue;
    }
    uint64_t word = word_of(w->left_count);
    w->left[w->left_count++] = h;
    w->p.label[h] = w->p.label[g] = word;
    c->sum[h / 3] ^= word;
    c->sum[g / 3] ^= word;
  }
  for (int32_t i = c->tail; i-- > 1;) {
    int32_t t = c->queue[i], h = c->arrival[t], g = w->p.s->twin[h];
    w->p.label[h] = w->p.label[g] = c->sum[t];
    c->sum[g / 3] ^= c->sum[t];
  }
}

static orb_status find_labels(work *w) {
  orb_context *ctx = w->p.s->ctx;
  int32_t faces = w->p.s->mesh->triangle_count;
  ORB_TRY(grow_tree(w));
  cotree c = {.queue = ORB_NEW(ctx, int32_t, faces),
              .stack = ORB_NEW(ctx, int32_t, faces),
              .arrival = ORB_NEW(ctx, int32_t, faces),
              .sum = ORB_NEW0(ctx, uint64_t, faces)};
  orb_status status = c.queue && c.stack && c.arrival && c.sum ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    grow_cotree(w, &c);
    int64_t left = w->p.s->edges.edges - (w->p.touched_count - 1) - (faces - 1);
    w->left = ORB_NEW(ctx, int32_t, left > 0 ? left : 0);
    status = w->left ? ORB_OK : ORB_E_NO_MEMORY;
  }
  if (status == ORB_OK) {
    label_edges(w, &c);
  }
  orb_free(ctx, c.queue);
  orb_free(ctx, c.stack);
  orb_free(ctx, c.arrival);
  orb_free(ctx, c.sum);
  return status;
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

static orb_status search_within(work *w, double limit) {
  int64_t searches = w->seed_count;
  if (!isfinite(limit)) {
    int64_t most = WHOLE_VERTICES / w->p.s->mesh->vertex_count;
    most = most < WHOLE_LEAST ? WHOLE_LEAST : most;
    searches = searches < most ? searches : most;
  }
  return search_seeds(w, searches, INT64_MAX, limit);
}

/* Searches the surroundings of each edge that is left, and of as many other seeds, so that cycles share no vertex. */
static orb_status search_near(work *w) {
  int64_t searches = w->left_count < w->seed_count ? w->left_count : w->seed_count, most = NEAR_VERTICES;
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
  w->pool = NULL;
  orb_free(ctx, taken);
  orb_free(ctx, order);
  return ORB_OK;
}

static orb_status open_work(work *w, orb_surface *s, orb_cycles *out) {
  *out = (orb_cycles){0};
  ORB_TRY(orb_dijkstra_open(&w->p, s));
  w->in = ORB_NEW0(s->ctx, unsigned char, 3 * (size_t)s->mesh->triangle_count);
  return w->in ? find_labels(w) : ORB_E_NO_MEMORY;
}

static void close_work(work *w) {
  orb_context *ctx = w->p.s->ctx;
  orb_dijkstra_close(&w->p);
  orb_free(ctx, w->in);
  orb_free(ctx, w->seed);
  orb_free(ctx, w->left);
  orb_free(ctx, w->found);
  orb_free(ctx, w->pool);
}

orb_status orb_cycles_find(orb_surface *s, double limit, int32_t most, orb_cycles *out) {
  work w = {0};
  orb_status status = open_work(&w, s, out);
  if (status == ORB_OK && !isfinite(limit)) {
    status = keep_generators(&w, INT32_MAX);
  }
  if (status == ORB_OK) {
    status = list_seeds(&w);
  }
  if (status == ORB_OK) {
    status = search_within(&w, limit);
  }
  if (status == ORB_OK) {
    status = choose(&w, most, most <= ORB_CYCLES_LABELLED, out);
  }
  close_work(&w);
  return status;
}

orb_status orb_cycles_generate(orb_surface *s, orb_cycles *out) {
  work w = {0};
  orb_status status = open_work(&w, s, out);
  if (status == ORB_OK) {
    status = keep_generators(&w, GENERATORS_MOST);
  }
  if (status == ORB_OK) {
    status = list_seeds(&w);
  }
  if (status == ORB_OK) {
    status = search_near(&w);
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
