/* All leaves are in one array; a split replaces a leaf by its middle child and appends the other three. Midpoints of
 * edges are shared through a hash table of vertex pairs, which also shows which edges of a leaf have a hanging vertex:
 * the tree is balanced when no leaf has an edge whose half has a midpoint of its own. Closure then splits a leaf with
 * one, two or three hanging vertices in two, three or four. */
#include "remesh/quadtree.h"

#include <string.h>

#include "base/check.h"
#include "base/error.h"
#include "base/hash.h"
#include "base/memory.h"
#include "numeric/predicates.h"
#include "numeric/vec3.h"

enum { MAX_DEPTH = 28 };     /* edges of 6e-9: deeper splits would only separate points that practically coincide */
enum { CHECK_EVERY = 4096 }; /* leaves between two checks for cancellation */

typedef struct leaf {
  int32_t v[3];
  int32_t begin, end; /* its items */
  int32_t depth;
} leaf;

typedef struct midpoint {
  uint64_t edge; /* 0: free */
  int32_t vertex;
} midpoint;

typedef struct tree {
  orb_context *ctx;
  const orb_remesh_job *job;
  leaf *leaves;
  double *points;
  midpoint *table;
  orb_quadtree_item *items, *spare;
  int32_t leaf_count, leaf_capacity, vertex_count, vertex_capacity;
  int64_t table_size, table_used; /* the size is a power of two */
} tree;

static uint64_t edge_key(int32_t a, int32_t b) {
  uint64_t low = (uint64_t)(a < b ? a : b), high = (uint64_t)(a < b ? b : a);
  return (low << 32 | high) + 1;
}

static midpoint *find_slot(const tree *t, uint64_t edge) {
  uint64_t mask = (uint64_t)t->table_size - 1, i = orb_hash(t->ctx, &edge, sizeof edge);
  for (;; i++) {
    midpoint *slot = &t->table[i & mask];
    if (slot->edge == edge || slot->edge == 0) {
      return slot;
    }
  }
}

static int32_t midpoint_of(const tree *t, int32_t a, int32_t b) {
  const midpoint *slot = find_slot(t, edge_key(a, b));
  return slot->edge ? slot->vertex : -1;
}

static orb_status grow_table(tree *t) {
  midpoint *old = t->table;
  int64_t old_size = t->table_size;
  midpoint *table = ORB_NEW0(t->ctx, midpoint, 2 * old_size);
  if (!table) {
    return ORB_E_NO_MEMORY;
  }
  t->table = table;
  t->table_size = 2 * old_size;
  for (int64_t i = 0; i < old_size; i++) {
    if (old[i].edge) {
      *find_slot(t, old[i].edge) = old[i];
    }
  }
  orb_free(t->ctx, old);
  return ORB_OK;
}

static orb_status make_midpoint(tree *t, int32_t a, int32_t b, int32_t *out) {
  *out = midpoint_of(t, a, b);
  if (*out >= 0) {
    return ORB_OK;
  }
  if (2 * t->table_used >= t->table_size) {
    ORB_TRY(grow_table(t));
  }
  if (t->vertex_count == t->vertex_capacity) {
    if (t->vertex_capacity > INT32_MAX / 12) {
      return orb_fail(t->ctx, ORB_E_TOO_LARGE, "The subdivision needs too many vertices; send smaller meshes.");
    }
    double *points = orb_realloc(t->ctx, t->points, 6 * (size_t)t->vertex_capacity, sizeof(double));
    if (!points) {
      return ORB_E_NO_MEMORY;
    }
    t->points = points;
    t->vertex_capacity *= 2;
  }
  const double *p = t->points + 3 * (int64_t)a, *q = t->points + 3 * (int64_t)b;
  double *m = t->points + 3 * (int64_t)t->vertex_count;
  for (int k = 0; k < 3; k++) {
    m[k] = p[k] + q[k];
  }
  (void)orb_normalize(m);
  *find_slot(t, edge_key(a, b)) = (midpoint){edge_key(a, b), t->vertex_count};
  t->table_used++;
  *out = t->vertex_count++;
  return ORB_OK;
}

/* The child that holds p: 0 to 2 at the corners, 3 the middle. */
static int child_of(const tree *t, const int32_t m[3], const double p[3]) {
  for (int k = 0; k < 3; k++) { /* beyond the edge between the midpoints of the two edges at corner k */
    const double *from = t->points + 3 * (int64_t)m[k], *to = t->points + 3 * (int64_t)m[(k + 2) % 3];
    if (orb_orient(from, to, p) > 0) {
      return k;
    }
  }
  return 3;
}

static void part_items(tree *t, const leaf *parent, const int32_t m[3], int32_t bound[5]) {
  int32_t count[5] = {0};
  for (int32_t i = parent->begin; i < parent->end; i++) {
    orb_quadtree_item *item = &t->items[i];
    item->triangle = child_of(t, m, t->job->shapes[item->shape].points + 3 * (int64_t)item->vertex);
    count[item->triangle + 1]++;
  }
  bound[0] = parent->begin;
  for (int c = 0; c < 4; c++) {
    bound[c + 1] = bound[c] + count[c + 1];
  }
  int32_t fill[4] = {bound[0], bound[1], bound[2], bound[3]};
  for (int32_t i = parent->begin; i < parent->end; i++) {
    t->spare[fill[t->items[i].triangle]++] = t->items[i];
  }
  size_t items = (size_t)(parent->end - parent->begin);
  memcpy(t->items + parent->begin, t->spare + parent->begin, items * sizeof *t->items);
}

static orb_status split_leaf(tree *t, int32_t index) {
  if (t->leaf_count + 3 > t->leaf_capacity) {
    if (t->leaf_capacity > INT32_MAX / 8) {
      return orb_fail(t->ctx, ORB_E_TOO_LARGE, "The subdivision needs too many triangles; send smaller meshes.");
    }
    leaf *leaves = orb_realloc(t->ctx, t->leaves, 2 * (size_t)t->leaf_capacity, sizeof *leaves);
    if (!leaves) {
      return ORB_E_NO_MEMORY;
    }
    t->leaves = leaves;
    t->leaf_capacity *= 2;
  }
  leaf parent = t->leaves[index];
  int32_t m[3], bound[5];
  for (int k = 0; k < 3; k++) {
    ORB_TRY(make_midpoint(t, parent.v[k], parent.v[(k + 1) % 3], &m[k]));
  }
  part_items(t, &parent, m, bound);
  for (int k = 0; k < 3; k++) {
    t->leaves[t->leaf_count++] = (leaf){{parent.v[k], m[k], m[(k + 2) % 3]}, bound[k], bound[k + 1], parent.depth + 1};
  }
  t->leaves[index] = (leaf){{m[0], m[1], m[2]}, bound[3], bound[4], parent.depth + 1};
  return ORB_OK;
}

static int crowded(const tree *t, const leaf *l, int32_t *last_seen, int32_t stamp) {
  for (int32_t i = l->begin; i < l->end; i++) {
    if (last_seen[t->items[i].shape] == stamp) {
      return 1;
    }
    last_seen[t->items[i].shape] = stamp;
  }
  return 0;
}

static orb_status split_crowded(tree *t) {
  int32_t *last_seen = ORB_NEW0(t->ctx, int32_t, t->job->shape_count);
  if (!last_seen) {
    return ORB_E_NO_MEMORY;
  }
  orb_status status = ORB_OK;
  int32_t stamp = 0;
  for (int32_t i = 0; i < t->leaf_count && status == ORB_OK; i++) {
    while (status == ORB_OK && t->leaves[i].depth < MAX_DEPTH && crowded(t, &t->leaves[i], last_seen, ++stamp)) {
      status = split_leaf(t, i);
    }
    if (i % CHECK_EVERY == 0 && status == ORB_OK) {
      status = orb_context_check(t->ctx);
    }
  }
  orb_free(t->ctx, last_seen);
  return status;
}

static int unbalanced(const tree *t, const leaf *l) {
  for (int k = 0; k < 3; k++) {
    int32_t a = l->v[k], b = l->v[(k + 1) % 3], m = midpoint_of(t, a, b);
    if (m >= 0 && (midpoint_of(t, a, m) >= 0 || midpoint_of(t, m, b) >= 0)) {
      return 1;
    }
  }
  return 0;
}

static orb_status balance(tree *t) {
  for (int again = 1; again;) {
    again = 0;
    for (int32_t i = 0; i < t->leaf_count; i++) {
      while (unbalanced(t, &t->leaves[i])) {
        ORB_TRY(split_leaf(t, i));
        again = 1;
      }
      if (i % CHECK_EVERY == 0) {
        ORB_TRY(orb_context_check(t->ctx));
      }
    }
  }
  return ORB_OK;
}

/* The leaf's triangles with its hanging vertices; returns how many. */
static int close_leaf(const tree *t, const leaf *l, int32_t out[12]) {
  int32_t m[3];
  int hanging = 0, n = 0;
  for (int k = 0; k < 3; k++) {
    m[k] = midpoint_of(t, l->v[k], l->v[(k + 1) % 3]);
    hanging += m[k] >= 0;
  }
#define EMIT(a, b, c) (out[n++] = (a), out[n++] = (b), out[n++] = (c))
  if (hanging == 0) {
    EMIT(l->v[0], l->v[1], l->v[2]);
  } else if (hanging == 3) {
    EMIT(m[0], m[1], m[2]);
    for (int k = 0; k < 3; k++) {
      EMIT(l->v[k], m[k], m[(k + 2) % 3]);
    }
  } else {
    int k = 0; /* edge k has a hanging vertex, and of two, edges k and k + 1 */
    while (m[k] < 0 || (hanging == 2 && m[(k + 1) % 3] < 0)) {
      k++;
    }
    int32_t a = l->v[k], b = l->v[(k + 1) % 3], c = l->v[(k + 2) % 3], ab = m[k], bc = m[(k + 1) % 3];
    if (hanging == 1) {
      EMIT(a, ab, c);
      EMIT(ab, b, c);
    } else {
      EMIT(ab, b, bc);
      EMIT(a, ab, bc);
      EMIT(a, bc, c);
    }
  }
#undef EMIT
  return n / 3;
}

static orb_status close_tree(tree *t, orb_quadtree_mesh *out) {
  int32_t triangles[12];
  int64_t count = 0;
  for (int32_t i = 0; i < t->leaf_count; i++) {
    count += close_leaf(t, &t->leaves[i], triangles);
  }
  if (count > INT32_MAX / 4) {
    return orb_fail(t->ctx, ORB_E_TOO_LARGE, "The subdivision needs too many triangles; send smaller meshes.");
  }
  out->triangles = ORB_NEW(t->ctx, int32_t, 3 * count);
  if (!out->triangles) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t i = 0; i < t->leaf_count; i++) {
    const leaf *l = &t->leaves[i];
    int n = close_leaf(t, l, triangles);
    for (int32_t k = l->begin; k < l->end; k++) {
      t->items[k].triangle = out->triangle_count;
    }
    memcpy(out->triangles + 3 * (int64_t)out->triangle_count, triangles, 3 * (size_t)n * sizeof *triangles);
    out->triangle_count += n;
  }
  return ORB_OK;
}

static orb_status start_tree(tree *t, int64_t items) {
  static const double corner[6][3] = {{1, 0, 0}, {0, 1, 0}, {-1, 0, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
  if (items > INT32_MAX / 8) {
    return orb_fail(t->ctx, ORB_E_TOO_LARGE, "The shapes have too many vertices together.");
  }
  t->table_size = 64;
  t->vertex_capacity = t->leaf_capacity = 64;
  t->points = ORB_NEW(t->ctx, double, 3 * t->vertex_capacity);
  t->leaves = ORB_NEW(t->ctx, leaf, t->leaf_capacity);
  t->table = ORB_NEW0(t->ctx, midpoint, t->table_size);
  t->items = ORB_NEW(t->ctx, orb_quadtree_item, items);
  t->spare = ORB_NEW(t->ctx, orb_quadtree_item, items);
  if (!t->points || !t->leaves || !t->table || !t->items || !t->spare) {
    return ORB_E_NO_MEMORY;
  }
  memcpy(t->points, corner, sizeof corner);
  t->vertex_count = 6;
  int32_t n = 0;
  for (int32_t s = 0; s < t->job->shape_count; s++) {
    for (int32_t v = 0; v < t->job->shapes[s].mesh.vertex_count; v++) {
      t->items[n++] = (orb_quadtree_item){s, v, 0};
    }
  }
  /* Partition the items by the octant that holds them. */
  int32_t begin = 0;
  for (int octant = 0; octant < 8; octant++) {
    int32_t a = octant & 3, b = (a + 1) & 3, pole = octant < 4 ? 4 : 5, end = begin;
    leaf l = {{octant < 4 ? a : b, octant < 4 ? b : a, pole}, begin, 0, 0};
    for (int32_t i = begin; i < n; i++) {
      const double *p = t->job->shapes[t->items[i].shape].points + 3 * (int64_t)t->items[i].vertex;
      int inside = octant == 7;
      if (!inside) {
        inside = 1;
        for (int k = 0; k < 3; k++) {
          inside &= orb_orient(corner[l.v[k]], corner[l.v[(k + 1) % 3]], p) >= 0;
        }
      }
      if (inside) {
        orb_quadtree_item swap = t->items[end];
        t->items[end++] = t->items[i];
        t->items[i] = swap;
      }
    }
    l.end = begin = end;
    t->leaves[t->leaf_count++] = l;
  }
  return ORB_OK;
}

orb_status orb_quadtree_build(orb_context *ctx, const orb_remesh_job *job, orb_quadtree_mesh *out) {
  memset(out, 0, sizeof *out);
  tree t = {.ctx = ctx, .job = job};
  int64_t items = 0;
  for (int32_t s = 0; s < job->shape_count; s++) {
    items += job->shapes[s].mesh.vertex_count;
  }
  orb_status status;
  ORB_GO(status, start_tree(&t, items), end);
  ORB_GO(status, split_crowded(&t), end);
  ORB_GO(status, balance(&t), end);
  ORB_GO(status, close_tree(&t, out), end);
  out->points = t.points;
  out->vertex_count = t.vertex_count;
  out->items = t.items;
  out->item_count = (int32_t)items;
  t.points = NULL;
  t.items = NULL;
end:
  orb_free(ctx, t.points);
  orb_free(ctx, t.leaves);
  orb_free(ctx, t.table);
  orb_free(ctx, t.items);
  orb_free(ctx, t.spare);
  if (status != ORB_OK) {
    orb_free(ctx, out->triangles);
    memset(out, 0, sizeof *out);
  }
  return status;
}

void orb_quadtree_free(orb_context *ctx, orb_quadtree_mesh *mesh) {
  orb_free(ctx, mesh->points);
  orb_free(ctx, mesh->triangles);
  orb_free(ctx, mesh->items);
  memset(mesh, 0, sizeof *mesh);
}
