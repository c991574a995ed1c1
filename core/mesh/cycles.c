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
#include "mesh/sort.h"
#include "numeric/vec3.h"

enum { UNSEEN, WAITING, SETTLED, ON_PATH };

/* Searches without a limit cover the whole surface: this many vertices in all, and WHOLE_LEAST searches at least. */
enum { WHOLE_VERTICES = 4000000, WHOLE_LEAST = 8 };
enum { CHECK_EVERY = 256, SETTLED_EVERY = 65536 }; /* cycles and settled vertices between looks at the deadline */

typedef struct work {
  orb_surface *s;
  int32_t *corner;   /* of each vertex: a half-edge that leaves it, −1: no face uses it */
  uint64_t *label;   /* of each half-edge */
  unsigned char *in; /* of each half-edge: TREE, COTREE */
  double *distance;  /* of each vertex from the seed */
  int32_t *parent;   /* of each vertex: the half-edge by which its path arrives, −1: the seed */
  uint64_t *walked;  /* of each vertex: the label of its path */
  unsigned char *state;
  int32_t *heap, *slot, heap_count; /* vertices by distance, and their places in the heap */
  int32_t *touched, touched_count;
  int32_t *seed, seed_count;
  int32_t *left, left_count; /* half-edges of neither tree */
  orb_cycle *found;
  int32_t found_count, found_room;
  int32_t *pool;
  int32_t pool_count, pool_room;
} work;

enum { TREE = 1, COTREE = 2 };

static int32_t origin(const work *w, int32_t h) {
  return w->s->mesh->triangles[h];
}
static int32_t target(const work *w, int32_t h) {
  return w->s->mesh->triangles[orb_next(h)];
}

/* Whether the file has this edge. */
static int is_usable(const work *w, int32_t h) {
  const int32_t *source = w->s->mesh->source_triangle;
  return source[h / 3] >= 0 || source[w->s->twin[h] / 3] >= 0;
}

static double length_of(const work *w, int32_t h) {
  const double *p = w->s->mesh->positions;
  return sqrt(orb_distance2(p + 3 * (size_t)origin(w, h), p + 3 * (size_t)target(w, h)));
}

static void place(work *w, int32_t at, int32_t v) {
  w->heap[at] = v;
  w->slot[v] = at;
}

static void rise(work *w, int32_t at, int32_t v) {
  while (at > 0 && w->distance[w->heap[(at - 1) / 2]] > w->distance[v]) {
    place(w, at, w->heap[(at - 1) / 2]);
    at = (at - 1) / 2;
  }
  place(w, at, v);
}

static int32_t pop(work *w) {
  int32_t top = w->heap[0], last = w->heap[--w->heap_count], at = 0;
  for (int32_t child; (child = 2 * at + 1) < w->heap_count; at = child) {
    child += child + 1 < w->heap_count && w->distance[w->heap[child + 1]] < w->distance[w->heap[child]];
    if (w->distance[w->heap[child]] >= w->distance[last]) {
      break;
    }
    place(w, at, w->heap[child]);
  }
  if (w->heap_count > 0) {
    place(w, at, last);
  }
  return top;
}

static void start_search(work *w, int32_t seed) {
  for (int32_t i = 0; i < w->touched_count; i++) {
    w->state[w->touched[i]] = UNSEEN;
  }
  w->touched_count = 0;
  w->touched[w->touched_count++] = seed;
  w->state[seed] = WAITING;
  w->distance[seed] = 0;
  w->parent[seed] = -1;
  w->walked[seed] = 0;
  w->heap_count = 1;
  place(w, 0, seed);
}

/* Offers the end of half-edge h a path over h. */
static void reach(work *w, int32_t h, double distance) {
  int32_t v = target(w, h);
  if (w->state[v] == UNSEEN) {
    w->touched[w->touched_count++] = v;
    w->state[v] = WAITING;
    w->slot[v] = w->heap_count++;
  } else if (w->state[v] != WAITING || w->distance[v] <= distance) {
    return;
  }
  w->distance[v] = distance;
  w->parent[v] = h;
  w->walked[v] = w->walked[origin(w, h)] ^ w->label[h];
  rise(w, w->slot[v], v);
}

/* The shortest cycle through the seed that does not divide the surface and is shorter than *length: returns the
 * half-edge that closes it and updates *length; −1: there is none. */
static int32_t search(work *w, int32_t seed, double *length) {
  int32_t closing = -1;
  start_search(w, seed);
  for (int64_t settled = 1; w->heap_count > 0; settled++) {
    int32_t v = pop(w);
    int late = settled % SETTLED_EVERY == 0 && orb_context_check(w->s->ctx) != ORB_OK; /* the caller asks again */
    if (late || 2 * w->distance[v] >= *length) {
      break;
    }
    w->state[v] = SETTLED;
    int32_t h = w->corner[v];
    do {
      int32_t to = target(w, h);
      double distance = w->distance[v] + length_of(w, h);
      if (is_usable(w, h) && w->state[to] != SETTLED) {
        reach(w, h, distance);
      } else if (is_usable(w, h) && (w->walked[v] ^ w->walked[to] ^ w->label[h]) != 0 &&
                 distance + w->distance[to] < *length) {
        *length = distance + w->distance[to];
        closing = h;
      }
      h = w->s->twin[orb_prev(h)];
    } while (h != w->corner[v]);
  }
  return closing;
}

/* The spanning tree of the vertices: shortest paths over usable edges, then any edge to the vertices that are left. */
static orb_status grow_tree(work *w) {
  const orb_mesh *mesh = w->s->mesh;
  int32_t root = mesh->triangles[0];
  memset(w->label, 0, 3 * (size_t)mesh->triangle_count * sizeof *w->label);
  start_search(w, root);
  for (int64_t n = 0; w->heap_count > 0; n++) {
    int32_t v = pop(w), h = w->corner[v];
    w->state[v] = SETTLED;
    do {
      if (is_usable(w, h)) {
        reach(w, h, w->distance[v] + length_of(w, h));
      }
      h = w->s->twin[orb_prev(h)];
    } while (h != w->corner[v]);
    if (n % 65536 == 0) {
      ORB_TRY(orb_context_check(w->s->ctx));
    }
  }
  for (int32_t i = 0; i < w->touched_count; i++) { /* grows while it runs */
    int32_t v = w->touched[i], h = w->corner[v];
    do {
      int32_t to = target(w, h);
      if (w->state[to] == UNSEEN) {
        w->state[to] = SETTLED;
        w->distance[to] = w->distance[v] + length_of(w, h);
        w->parent[to] = h;
        w->walked[to] = 0;
        w->touched[w->touched_count++] = to;
      }
      h = w->s->twin[orb_prev(h)];
    } while (h != w->corner[v]);
  }
  for (int32_t i = 0; i < w->touched_count; i++) {
    int32_t h = w->parent[w->touched[i]];
    if (h >= 0) {
      w->in[h] = w->in[w->s->twin[h]] = TREE;
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
  int32_t g = w->s->twin[h];
  if ((w->in[h] & TREE) || c->arrival[g / 3] != -2) {
    return;
  }
  c->arrival[g / 3] = g;
  w->in[h] = w->in[g] = COTREE;
  c->queue[c->tail++] = g / 3;
  if (w->s->mesh->source_triangle[g / 3] < 0) {
    c->stack[c->depth++] = g / 3;
  }
}

/* The spanning tree of the faces. Faces that a repair made are crossed first, so that usable edges are left over. */
static void grow_cotree(work *w, cotree *c) {
  for (int32_t t = 0; t < w->s->mesh->triangle_count; t++) {
    c->arrival[t] = -2;
  }
  c->arrival[0] = -1;
  c->queue[c->tail++] = 0;
  if (w->s->mesh->source_triangle[0] < 0) {
    c->stack[c->depth++] = 0;
  }
  for (int32_t head = 0; head < c->tail || c->depth > 0;) {
    if (c->depth > 0) {
      int32_t t = c->stack[--c->depth];
      for (int32_t h = 3 * t; h < 3 * t + 3; h++) {
        if (!is_usable(w, h)) {
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
  int32_t half_edges = 3 * w->s->mesh->triangle_count;
  for (int32_t h = 0; h < half_edges; h++) {
    int32_t g = w->s->twin[h];
    if (g < h || w->in[h]) {
      continue;
    }
    uint64_t word = word_of(w->left_count);
    w->left[w->left_count++] = h;
    w->label[h] = w->label[g] = word;
    c->sum[h / 3] ^= word;
    c->sum[g / 3] ^= word;
  }
  for (int32_t i = c->tail; i-- > 1;) {
    int32_t t = c->queue[i], h = c->arrival[t], g = w->s->twin[h];
    w->label[h] = w->label[g] = c->sum[t];
    c->sum[g / 3] ^= c->sum[t];
  }
}

static orb_status find_labels(work *w) {
  orb_context *ctx = w->s->ctx;
  int32_t faces = w->s->mesh->triangle_count;
  ORB_TRY(grow_tree(w));
  cotree c = {.queue = ORB_NEW(ctx, int32_t, faces),
              .stack = ORB_NEW(ctx, int32_t, faces),
              .arrival = ORB_NEW(ctx, int32_t, faces),
              .sum = ORB_NEW0(ctx, uint64_t, faces)};
  orb_status status = c.queue && c.stack && c.arrival && c.sum ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    grow_cotree(w, &c);
    int64_t left = w->s->edges.edges - (w->touched_count - 1) - (faces - 1);
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
    if (!orb_regrow(w->s->ctx, &w->found, (size_t)w->found_room, sizeof *w->found)) {
      return ORB_E_NO_MEMORY;
    }
  }
  if (more > w->pool_room - w->pool_count) {
    if (more > INT32_MAX / 4 - w->pool_count) {
      return ORB_E_NO_MEMORY;
    }
    w->pool_room = 2 * (w->pool_count + more);
    if (!orb_regrow(w->s->ctx, &w->pool, (size_t)w->pool_room, sizeof *w->pool)) {
      return ORB_E_NO_MEMORY;
    }
  }
  return ORB_OK;
}

/* Keeps the cycle that a half-edge closes with the paths to its ends, without what both paths share. */
static orb_status keep(work *w, int32_t closing) {
  int32_t a = origin(w, closing), b = target(w, closing), meet = b, down = 0, up = 0;
  for (int32_t v = a;; v = origin(w, w->parent[v])) {
    w->state[v] = ON_PATH;
    if (w->parent[v] < 0) {
      break;
    }
  }
  for (; w->state[meet] != ON_PATH; up++) {
    meet = origin(w, w->parent[meet]);
  }
  for (int32_t v = a; v != meet; v = origin(w, w->parent[v])) {
    down++;
  }
  ORB_TRY(make_room(w, down + 1 + up));
  orb_cycle *cycle = &w->found[w->found_count++];
  *cycle = (orb_cycle){.start = w->pool_count, .count = down + 1 + up};
  int32_t *out = w->pool + w->pool_count, at = down;
  for (int32_t v = a; v != meet; v = origin(w, w->parent[v])) {
    out[--at] = w->parent[v];
  }
  out[down] = closing;
  at = down + 1;
  for (int32_t v = b; v != meet; v = origin(w, w->parent[v])) {
    out[at++] = w->s->twin[w->parent[v]];
  }
  for (int32_t i = 0; i < cycle->count; i++) {
    cycle->length += length_of(w, out[i]);
    cycle->label ^= w->label[out[i]];
  }
  w->pool_count += cycle->count;
  for (int32_t v = a;; v = origin(w, w->parent[v])) {
    w->state[v] = SETTLED;
    if (w->parent[v] < 0) {
      return ORB_OK;
    }
  }
}

/* The cycles of the edges that are left, while the labels of the tree's paths are 0. */
static orb_status keep_generators(work *w) {
  for (int32_t i = 0; i < w->left_count; i++) {
    int usable = is_usable(w, w->left[i]);
    for (int end = 0; end < 2; end++) {
      for (int32_t v = end ? origin(w, w->left[i]) : target(w, w->left[i]); usable && w->parent[v] >= 0;
           v = origin(w, w->parent[v])) {
        usable = is_usable(w, w->parent[v]);
      }
    }
    if (usable) {
      ORB_TRY(keep(w, w->left[i]));
    }
    if (i % CHECK_EVERY == 0) {
      ORB_TRY(orb_context_check(w->s->ctx));
    }
  }
  return ORB_OK;
}

static orb_status list_seeds(work *w) {
  orb_mesh *mesh = w->s->mesh;
  unsigned char *listed = ORB_NEW0(w->s->ctx, unsigned char, mesh->vertex_count);
  w->seed = ORB_NEW(w->s->ctx, int32_t, mesh->vertex_count);
  orb_status status = listed && w->seed ? ORB_OK : ORB_E_NO_MEMORY;
  for (int32_t h = 0; h < 3 * mesh->triangle_count && status == ORB_OK; h++) {
    if (w->label[h] != 0 && h < w->s->twin[h] && is_usable(w, h) && !listed[origin(w, h)]) {
      listed[origin(w, h)] = 1;
      w->seed[w->seed_count++] = origin(w, h);
    }
  }
  orb_free(w->s->ctx, listed);
  return status;
}

static orb_status search_seeds(work *w, double limit) {
  int64_t searches = w->seed_count;
  if (!isfinite(limit)) {
    int64_t most = WHOLE_VERTICES / w->s->mesh->vertex_count;
    most = most < WHOLE_LEAST ? WHOLE_LEAST : most;
    searches = searches < most ? searches : most;
  }
  for (int64_t i = 0; i < searches; i++) {
    double length = limit;
    int32_t closing = search(w, w->seed[i * w->seed_count / searches], &length);
    if (closing >= 0) {
      ORB_TRY(keep(w, closing));
    }
    ORB_TRY(orb_context_check(w->s->ctx));
  }
  return ORB_OK;
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
    if (taken[origin(w, w->pool[cycle->start + i])]) {
      return 0;
    }
  }
  return 1;
}

/* Chooses, shortest first, and moves the result to `out`. Labels have 64 bits, so 64 cycles are chosen at most. */
static orb_status choose(work *w, int32_t most, orb_cycles *out) {
  orb_context *ctx = w->s->ctx;
  uint64_t basis[64] = {0};
  unsigned char *taken = ORB_NEW0(ctx, unsigned char, w->s->mesh->vertex_count);
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
    if (is_free(w, cycle, taken) && is_independent(basis, cycle->label)) {
      out->cycle[out->count++] = *cycle;
      for (int32_t k = 0; k < cycle->count; k++) {
        taken[origin(w, w->pool[cycle->start + k])] = 1;
      }
    }
  }
  out->half_edges = w->pool;
  w->pool = NULL;
  orb_free(ctx, taken);
  orb_free(ctx, order);
  return ORB_OK;
}

static orb_status open_work(work *w) {
  const orb_mesh *mesh = w->s->mesh;
  orb_context *ctx = w->s->ctx;
  size_t vertices = (size_t)mesh->vertex_count, half_edges = 3 * (size_t)mesh->triangle_count;
  w->corner = ORB_NEW(ctx, int32_t, vertices);
  w->label = ORB_NEW(ctx, uint64_t, half_edges);
  w->in = ORB_NEW0(ctx, unsigned char, half_edges);
  w->distance = ORB_NEW(ctx, double, vertices);
  w->parent = ORB_NEW(ctx, int32_t, vertices);
  w->walked = ORB_NEW(ctx, uint64_t, vertices);
  w->state = ORB_NEW0(ctx, unsigned char, vertices);
  w->heap = ORB_NEW(ctx, int32_t, vertices);
  w->slot = ORB_NEW(ctx, int32_t, vertices);
  w->touched = ORB_NEW(ctx, int32_t, vertices);
  if (!w->corner || !w->label || !w->in || !w->distance || !w->parent || !w->walked || !w->state || !w->heap ||
      !w->slot || !w->touched) {
    return ORB_E_NO_MEMORY;
  }
  memset(w->corner, 0xff, vertices * sizeof *w->corner);
  for (size_t h = half_edges; h-- > 0;) {
    w->corner[mesh->triangles[h]] = (int32_t)h;
  }
  return ORB_OK;
}

orb_status orb_cycles_find(orb_surface *s, double limit, int32_t most, orb_cycles *out) {
  work w = {.s = s};
  *out = (orb_cycles){0};
  orb_status status;
  ORB_GO(status, open_work(&w), done);
  ORB_GO(status, find_labels(&w), done);
  if (!isfinite(limit)) {
    ORB_GO(status, keep_generators(&w), done);
  }
  ORB_GO(status, list_seeds(&w), done);
  ORB_GO(status, search_seeds(&w, limit), done);
  status = choose(&w, most, out);
done:;
  void *blocks[] = {w.corner, w.label, w.in,      w.distance, w.parent, w.walked, w.state,
                    w.heap,   w.slot,  w.touched, w.seed,     w.left,   w.found,  w.pool};
  for (size_t i = 0; i < sizeof blocks / sizeof *blocks; i++) {
    orb_free(s->ctx, blocks[i]);
  }
  return status;
}

void orb_cycles_free(orb_context *ctx, orb_cycles *cycles) {
  orb_free(ctx, cycles->cycle);
  orb_free(ctx, cycles->half_edges);
  *cycles = (orb_cycles){0};
}
