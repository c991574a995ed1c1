/* Welding, edge by edge.
 *
 * Vertices are welded because two open edges share their positions, never because two vertices do: surfaces that
 * merely touch stay apart, and a closed mesh stays as it is. In this order, each step only while edges are open:
 *  1. an open edge of no length is collapsed (the row of vertices at the pole of a sphere);
 *  2. of isolated faces over the same three positions one is kept (facet soups repeat facets);
 *  3. open edges over the same two positions are welded in pairs. Where more than two meet, they are paired in order
 *     around the edge, so that each pair bounds solid matter: two cubes that touch along an edge stay two cubes.
 */
#include "mesh/weld.h"

#include "base/check.h"
#include "base/forest.h"
#include "base/hash.h"
#include "base/memory.h"
#include "mesh/edit.h"
#include "mesh/sort.h"
#include "numeric/vec3.h"

enum { ROUNDS = 8 }; /* each round but the last collapses edges or drops faces, which may open the way for the next */

typedef struct weld {
  orb_context *ctx;
  orb_mesh *mesh;
  int32_t *twin;
  int32_t *root;  /* forest of the vertices */
  int32_t *place; /* the lowest vertex on an open edge at the same position; −1: not on an open edge */
  unsigned char *flags;
  int64_t welded;
} weld;

static void unite(weld *w, int32_t a, int32_t b) {
  w->welded += orb_forest_join(w->root, a, b);
}

static int32_t origin(const weld *w, int32_t h) {
  return w->mesh->triangles[h];
}
static int32_t target(const weld *w, int32_t h) {
  return w->mesh->triangles[orb_next(h)];
}

static uint64_t hash_place(const weld *w, const double *p) {
  const double place[3] = {p[0] + 0.0, p[1] + 0.0, p[2] + 0.0}; /* −0 becomes 0 */
  return orb_hash(w->ctx, place, sizeof place);
}

/* Fills place; *open_count: open half-edges. */
static orb_status find_places(weld *w, int64_t *open_count) {
  const orb_mesh *mesh = w->mesh;
  int32_t half_edges = 3 * mesh->triangle_count;
  for (int32_t v = 0; v < mesh->vertex_count; v++) {
    w->place[v] = -1;
  }
  int64_t open = 0;
  for (int32_t h = 0; h < half_edges; h++) {
    if (w->twin[h] == ORB_OPEN) {
      w->place[origin(w, h)] = w->place[target(w, h)] = 0;
      open++;
    }
  }
  *open_count = open;
  uint64_t size = 16;
  while (size < 4 * (uint64_t)open) { /* a vertex on an open edge begins or ends one: at most 2·open of them */
    size *= 2;
  }
  int32_t *table = ORB_NEW0(w->ctx, int32_t, size);
  if (!table) {
    return ORB_E_NO_MEMORY;
  }
  orb_status status = ORB_OK;
  /* in order, so that the lowest vertex comes first */
  for (int32_t v = 0; v < mesh->vertex_count && status == ORB_OK; v++) {
    if ((v & 0xffff) == 0) {
      status = orb_context_check(w->ctx);
    }
    if (w->place[v] < 0) {
      continue;
    }
    const double *p = mesh->positions + 3 * (size_t)v;
    uint64_t slot = hash_place(w, p) & (size - 1);
    for (;; slot = (slot + 1) & (size - 1)) {
      if (!table[slot]) {
        table[slot] = v + 1;
        break;
      }
      const double *q = mesh->positions + 3 * (size_t)(table[slot] - 1);
      if (p[0] == q[0] && p[1] == q[1] && p[2] == q[2]) {
        break;
      }
    }
    w->place[v] = table[slot] - 1;
  }
  orb_free(w->ctx, table);
  return status;
}

/* Applies the unions and removes the collapsed faces. */
static orb_status apply(weld *w, orb_edges *edges) {
  for (int32_t v = 0; v < w->mesh->vertex_count; v++) {
    w->root[v] = orb_forest_root(w->root, v);
  }
  orb_mesh_apply_weld(w->mesh, w->root);
  if (orb_mesh_flag_degenerate(w->mesh, w->flags)) {
    orb_mesh_note(w->mesh, "degenerate-faces", orb_mesh_drop_faces(w->mesh, w->flags));
  }
  return orb_edges_match(w->ctx, w->mesh->triangles, w->mesh->triangle_count, w->mesh->vertex_count, w->twin, edges);
}

static int64_t collapse_short_edges(weld *w) {
  int64_t before = w->welded;
  for (int32_t h = 0; h < 3 * w->mesh->triangle_count; h++) {
    if (w->twin[h] == ORB_OPEN && w->place[origin(w, h)] == w->place[target(w, h)]) {
      unite(w, origin(w, h), target(w, h));
    }
  }
  return w->welded - before;
}

static orb_status drop_repeated_loose_faces(weld *w, int64_t *dropped) {
  orb_mesh *mesh = w->mesh;
  *dropped = 0;
  int64_t loose = 0;
  for (int32_t t = 0; t < mesh->triangle_count; t++) {
    const int32_t *twin = w->twin + 3 * (size_t)t;
    w->flags[t] = twin[0] == ORB_OPEN && twin[1] == ORB_OPEN && twin[2] == ORB_OPEN;
    loose += w->flags[t];
  }
  if (loose < 2) {
    return ORB_OK;
  }
  unsigned char *drop = ORB_NEW(w->ctx, unsigned char, mesh->triangle_count);
  int32_t *first = ORB_NEW(w->ctx, int32_t, mesh->triangle_count);
  int32_t count = 0;
  orb_status status =
      drop && first ? orb_mesh_flag_duplicates(w->ctx, mesh, w->place, w->flags, drop, first, &count) : ORB_E_NO_MEMORY;
  if (status == ORB_OK && count > 0) {
    for (int32_t t = 0; t < mesh->triangle_count; t++) {
      for (int i = 0; drop[t] && i < 9; i++) {
        int32_t a = mesh->triangles[3 * first[t] + i / 3], b = mesh->triangles[3 * t + i % 3];
        if (w->place[a] == w->place[b]) {
          unite(w, a, b);
        }
      }
    }
    orb_mesh_note(mesh, "duplicate-faces", orb_mesh_drop_faces(mesh, drop));
    *dropped = count;
  }
  orb_free(w->ctx, drop);
  orb_free(w->ctx, first);
  return status;
}

static void weld_pair(weld *w, int32_t g, int32_t h) {
  int crossed = w->place[origin(w, g)] != w->place[origin(w, h)];
  unite(w, origin(w, g), crossed ? target(w, h) : origin(w, h));
  unite(w, target(w, g), crossed ? origin(w, h) : target(w, h));
}

/* The angle of the face of h around the edge from a to b, as the upper half of a sort key. */
static uint64_t angle_key(const weld *w, int32_t h, int32_t a, int32_t b) {
  const double *positions = w->mesh->positions;
  const double *pa = positions + 3 * (size_t)a;
  double axis[3], side[3], across[3], reference[3] = {0, 0, 0}, out[3];
  orb_sub(positions + 3 * (size_t)b, pa, axis);
  orb_normalize(axis);
  int least =
      fabs(axis[0]) < fabs(axis[1]) ? (fabs(axis[0]) < fabs(axis[2]) ? 0 : 2) : (fabs(axis[1]) < fabs(axis[2]) ? 1 : 2);
  reference[least] = 1;
  orb_cross(axis, reference, across);
  orb_cross(across, axis, out); /* out, across: a right-handed frame with the axis */
  orb_sub(positions + 3 * (size_t)w->mesh->triangles[orb_prev(h)], pa, side);
  double angle = atan2(orb_dot(side, across), orb_dot(side, out));
  return (uint64_t)(uint32_t)((angle + 3.15) * 6.8e8) << 32; /* −π … π spreads over 32 bits */
}

/* Welds three or more open edges over the same two positions; run: half-edges in the lower halves. */
static void weld_crowd(weld *w, uint64_t *run, int32_t count, int32_t *stack) {
  int32_t a = w->place[origin(w, (int32_t)(uint32_t)run[0])], b = w->place[target(w, (int32_t)(uint32_t)run[0])];
  for (int32_t i = 0; i < count; i++) {
    run[i] = angle_key(w, (int32_t)(uint32_t)run[i], a, b) | (uint32_t)run[i];
  }
  orb_sort_u64(run, count);
  int32_t depth = 0, waiting = 0;
  /* Matter lies from a face that runs b to a, counter-clockwise, to one that runs a to b. */
  int32_t *wait = stack + count;
  for (int32_t i = 0; i < count; i++) {
    int32_t h = (int32_t)(uint32_t)run[i];
    if (w->place[origin(w, h)] != a) {
      stack[depth++] = h;
    } else if (depth > 0) {
      weld_pair(w, stack[--depth], h);
    } else {
      wait[waiting++] = h;
    }
  }
  int32_t next = 0;
  while (depth > 0 && next < waiting) {
    weld_pair(w, stack[--depth], wait[next++]);
  }
  for (; depth > 1; depth -= 2) { /* the rest all run in one direction: their faces face against each other */
    weld_pair(w, stack[depth - 1], stack[depth - 2]);
  }
  for (; waiting - next > 1; next += 2) {
    weld_pair(w, wait[next], wait[next + 1]);
  }
}

static orb_status weld_edges(weld *w, int64_t open_count) {
  orb_mesh *mesh = w->mesh;
  int32_t half_edges = 3 * mesh->triangle_count;
  int32_t *start = ORB_NEW0(w->ctx, int32_t, (size_t)mesh->vertex_count + 2);
  uint64_t *entry = ORB_NEW(w->ctx, uint64_t, open_count);
  int32_t *stack = ORB_NEW(w->ctx, int32_t, 2 * open_count);
  orb_status status = start && entry && stack ? ORB_OK : ORB_E_NO_MEMORY;
  for (int pass = 0; pass < 2 && status == ORB_OK; pass++) {
    for (int32_t h = 0; h < half_edges; h++) {
      if (w->twin[h] != ORB_OPEN) {
        continue;
      }
      int32_t a = w->place[origin(w, h)], b = w->place[target(w, h)];
      int32_t low = a < b ? a : b, high = a < b ? b : a;
      if (pass == 0) {
        start[low + 2]++;
      } else {
        entry[start[low + 1]++] = (uint64_t)(uint32_t)high << 32 | (uint32_t)h;
      }
    }
    for (int32_t v = 0; pass == 0 && v < mesh->vertex_count; v++) {
      start[v + 2] += start[v + 1];
    }
  }
  for (int32_t v = 0; v < mesh->vertex_count && status == ORB_OK; v++) {
    if ((v & 0xffff) == 0) {
      status = orb_context_check(w->ctx);
    }
    int32_t first = start[v], last = start[v + 1];
    orb_sort_u64(entry + first, last - first);
    while (first < last) {
      int32_t next = first + 1;
      while (next < last && entry[next] >> 32 == entry[first] >> 32) {
        next++;
      }
      if (next - first == 2) {
        weld_pair(w, (int32_t)(uint32_t)entry[first], (int32_t)(uint32_t)entry[first + 1]);
      } else if (next - first > 2) {
        weld_crowd(w, entry + first, next - first, stack);
      }
      first = next;
    }
  }
  orb_free(w->ctx, start);
  orb_free(w->ctx, entry);
  orb_free(w->ctx, stack);
  return status;
}

/* One round; *more: whether another one may find something. */
static orb_status weld_round(weld *w, orb_edges *edges, int *more) {
  int64_t open = 0, dropped = 0;
  ORB_TRY(find_places(w, &open));
  *more = 1;
  if (collapse_short_edges(w) > 0) {
    return apply(w, edges);
  }
  ORB_TRY(drop_repeated_loose_faces(w, &dropped));
  if (dropped > 0) {
    return apply(w, edges);
  }
  *more = 0;
  ORB_TRY(weld_edges(w, open));
  return apply(w, edges);
}

orb_status orb_mesh_weld(orb_context *ctx, orb_mesh *mesh, int32_t *twin, orb_edges *edges) {
  weld w = {.ctx = ctx, .mesh = mesh, .twin = twin};
  w.root = ORB_NEW(ctx, int32_t, mesh->vertex_count);
  w.place = ORB_NEW(ctx, int32_t, mesh->vertex_count);
  w.flags = ORB_NEW(ctx, unsigned char, mesh->triangle_count);
  orb_status status = w.root && w.place && w.flags ? ORB_OK : ORB_E_NO_MEMORY;
  for (int32_t v = 0; v < mesh->vertex_count && status == ORB_OK; v++) {
    w.root[v] = v;
  }
  int more = 1;
  for (int round = 0; round < ROUNDS && more && edges->open > 0 && status == ORB_OK; round++) {
    status = weld_round(&w, edges, &more);
  }
  if (status == ORB_OK) {
    orb_mesh_note(mesh, "weld", w.welded);
  }
  orb_free(ctx, w.root);
  orb_free(ctx, w.place);
  orb_free(ctx, w.flags);
  return status;
}
