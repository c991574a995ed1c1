/* The labels of a surface's edges.
 *
 * A spanning tree of the vertices and one of the faces that crosses none of its edges leave 2·genus edges over, one for
 * each generator of the homology (tree–cotree decomposition, Eppstein 2003). Each generator gets a random 64-bit word.
 * The label of an edge is the XOR of the words whose dual cycles cross it (annotation, Busaryev, Cabello, Chen, Dey and
 * Wang 2012).
 */
#include "mesh/labels.h"

#include <string.h>

#include "base/check.h"
#include "base/memory.h"

typedef struct work {
  orb_dijkstra *p;
  unsigned char *in; /* of each half-edge: TREE, COTREE */
  int32_t *left, left_count;
} work;

enum { TREE = 1, COTREE = 2 };

/* The spanning tree of the vertices: shortest paths over usable edges, then any edge to the vertices that are left. */
static orb_status grow_tree(work *w) {
  const orb_mesh *mesh = w->p->s->mesh;
  int32_t root = mesh->triangles[0];
  memset(w->p->label, 0, 3 * (size_t)mesh->triangle_count * sizeof *w->p->label);
  orb_dijkstra_start(w->p, root);
  for (int64_t n = 0; w->p->heap_count > 0; n++) {
    int32_t v = orb_dijkstra_pop(w->p), h = w->p->corner[v];
    w->p->state[v] = ORB_DIJKSTRA_SETTLED;
    do {
      if (orb_dijkstra_is_usable(w->p, h)) {
        orb_dijkstra_reach(w->p, h, w->p->distance[v] + orb_dijkstra_length(w->p, h));
      }
      h = w->p->s->twin[orb_prev(h)];
    } while (h != w->p->corner[v]);
    if (n % 65536 == 0) {
      ORB_TRY(orb_context_check(w->p->s->ctx));
    }
  }
  for (int32_t i = 0; i < w->p->touched_count; i++) { /* grows while it runs */
    int32_t v = w->p->touched[i], h = w->p->corner[v];
    do {
      int32_t to = orb_dijkstra_target(w->p, h);
      if (w->p->state[to] == ORB_DIJKSTRA_UNSEEN) {
        w->p->state[to] = ORB_DIJKSTRA_WAITING; /* stays: its path has an edge that is not the file's */
        w->p->distance[to] = w->p->distance[v] + orb_dijkstra_length(w->p, h);
        w->p->parent[to] = h;
        w->p->walked[to] = 0;
        w->p->touched[w->p->touched_count++] = to;
      }
      h = w->p->s->twin[orb_prev(h)];
    } while (h != w->p->corner[v]);
  }
  for (int32_t i = 0; i < w->p->touched_count; i++) {
    int32_t h = w->p->parent[w->p->touched[i]];
    if (h >= 0) {
      w->in[h] = w->in[w->p->s->twin[h]] = TREE;
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
  int32_t g = w->p->s->twin[h];
  if ((w->in[h] & TREE) || c->arrival[g / 3] != -2) {
    return;
  }
  c->arrival[g / 3] = g;
  w->in[h] = w->in[g] = COTREE;
  c->queue[c->tail++] = g / 3;
  if (w->p->s->mesh->source_triangle[g / 3] < 0) {
    c->stack[c->depth++] = g / 3;
  }
}

/* The spanning tree of the faces. Faces that a repair made are crossed first, so that usable edges are left over. */
static void grow_cotree(work *w, cotree *c) {
  for (int32_t t = 0; t < w->p->s->mesh->triangle_count; t++) {
    c->arrival[t] = -2;
  }
  c->arrival[0] = -1;
  c->queue[c->tail++] = 0;
  if (w->p->s->mesh->source_triangle[0] < 0) {
    c->stack[c->depth++] = 0;
  }
  for (int32_t head = 0; head < c->tail || c->depth > 0;) {
    if (c->depth > 0) {
      int32_t t = c->stack[--c->depth];
      for (int32_t h = 3 * t; h < 3 * t + 3; h++) {
        if (!orb_dijkstra_is_usable(w->p, h)) {
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
  int32_t half_edges = 3 * w->p->s->mesh->triangle_count;
  for (int32_t h = 0; h < half_edges; h++) {
    int32_t g = w->p->s->twin[h];
    if (g < h || w->in[h]) {
      continue;
    }
    uint64_t word = word_of(w->left_count);
    w->left[w->left_count++] = h;
    w->p->label[h] = w->p->label[g] = word;
    c->sum[h / 3] ^= word;
    c->sum[g / 3] ^= word;
  }
  for (int32_t i = c->tail; i-- > 1;) {
    int32_t t = c->queue[i], h = c->arrival[t], g = w->p->s->twin[h];
    w->p->label[h] = w->p->label[g] = c->sum[t];
    c->sum[g / 3] ^= c->sum[t];
  }
}

static orb_status find(work *w) {
  orb_context *ctx = w->p->s->ctx;
  int32_t faces = w->p->s->mesh->triangle_count;
  ORB_TRY(grow_tree(w));
  cotree c = {.queue = ORB_NEW(ctx, int32_t, faces),
              .stack = ORB_NEW(ctx, int32_t, faces),
              .arrival = ORB_NEW(ctx, int32_t, faces),
              .sum = ORB_NEW0(ctx, uint64_t, faces)};
  orb_status status = c.queue && c.stack && c.arrival && c.sum ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    grow_cotree(w, &c);
    int64_t left = w->p->s->edges.edges - (w->p->touched_count - 1) - (faces - 1);
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

orb_status orb_labels_find(orb_dijkstra *p, int32_t **left, int32_t *left_count) {
  orb_context *ctx = p->s->ctx;
  work w = {.p = p, .in = ORB_NEW0(ctx, unsigned char, 3 * (size_t)p->s->mesh->triangle_count)};
  orb_status status = w.in ? find(&w) : ORB_E_NO_MEMORY;
  orb_free(ctx, w.in);
  *left = w.left;
  *left_count = w.left_count;
  return status;
}
