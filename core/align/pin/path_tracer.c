/* Paths on a sheet by A*, laid as chains of edges. */
#include <math.h>
#include <string.h>

#include "align/pin/path_tracer.h"
#include "align/pin/straighten.h"
#include "base/check.h"
#include "base/memory.h"
#include "numeric/vec3.h"

static const double *point_of(const orb_sheet *s, int32_t v) {
  return s->shape.points + 3 * (size_t)v;
}

static void place_of(const orb_path_tracer *t, int32_t node, double out[3]) {
  const orb_sheet *s = t->sheet;
  if (node & 1) {
    const double *a = point_of(s, s->shape.mesh.triangles[node >> 1]),
                 *b = point_of(s, s->shape.mesh.triangles[orb_next(node >> 1)]);
    for (int k = 0; k < 3; k++) {
      out[k] = 0.5 * (a[k] + b[k]);
    }
  } else {
    memcpy(out, point_of(s, node >> 1), 3 * sizeof *out);
  }
}

orb_status orb_path_tracer_fit(orb_path_tracer *t) {
  int32_t wanted = 6 * t->sheet->triangle_capacity + 2;
  if (t->nodes >= wanted) {
    return ORB_OK;
  }
  double *cost = orb_realloc(t->ctx, t->cost, (size_t)wanted, sizeof *cost);
  t->cost = cost ? cost : t->cost;
  int32_t *from = orb_realloc(t->ctx, t->from, (size_t)wanted, sizeof *from);
  t->from = from ? from : t->from;
  int32_t *stamp = orb_realloc(t->ctx, t->stamp, (size_t)wanted, sizeof *stamp);
  t->stamp = stamp ? stamp : t->stamp;
  int32_t *chain = orb_realloc(t->ctx, t->chain, (size_t)wanted, sizeof *chain);
  t->chain = chain ? chain : t->chain;
  unsigned char *gate = orb_realloc(t->ctx, t->gate, (size_t)wanted, 1);
  t->gate = gate ? gate : t->gate;
  if (!cost || !from || !stamp || !chain || !gate) {
    return ORB_E_NO_MEMORY;
  }
  memset(stamp + t->nodes, 0, (size_t)(wanted - t->nodes) * sizeof *stamp);
  memset(gate + t->nodes, 0, (size_t)(wanted - t->nodes));
  t->nodes = wanted;
  return ORB_OK;
}

/* A binary heap, ties by node number. */
static int before(orb_path_node a, orb_path_node b) {
  return a.estimate != b.estimate ? a.estimate < b.estimate : a.node < b.node;
}

static orb_status heap_push(orb_path_tracer *t, orb_path_node item) {
  if (t->heap_count == t->heap_capacity) {
    int32_t capacity = t->heap_capacity + t->heap_capacity / 2 + 1024;
    orb_path_node *heap = orb_realloc(t->ctx, t->heap, (size_t)capacity, sizeof *heap);
    if (!heap) {
      return ORB_E_NO_MEMORY;
    }
    t->heap = heap;
    t->heap_capacity = capacity;
  }
  int32_t i = t->heap_count++;
  while (i > 0 && before(item, t->heap[(i - 1) / 2])) {
    t->heap[i] = t->heap[(i - 1) / 2];
    i = (i - 1) / 2;
  }
  t->heap[i] = item;
  return ORB_OK;
}

static orb_path_node heap_pop(orb_path_tracer *t) {
  orb_path_node top = t->heap[0], last = t->heap[--t->heap_count];
  int32_t i = 0;
  for (;;) {
    int32_t child = 2 * i + 1;
    if (child >= t->heap_count) {
      break;
    }
    if (child + 1 < t->heap_count && before(t->heap[child + 1], t->heap[child])) {
      child++;
    }
    if (!before(t->heap[child], last)) {
      break;
    }
    t->heap[i] = t->heap[child];
    i = child;
  }
  t->heap[i] = last;
  return top;
}

static int32_t edge_name(const orb_sheet *s, int32_t h) {
  return h < s->twin[h] ? h : s->twin[h];
}

int32_t orb_path_tracer_outgoing(const orb_path_tracer *t, int32_t v, int32_t e) {
  int32_t start = t->sheet->corner[v], h = start;
  do {
    if (t->paths->path[h] == e) {
      return h;
    }
    h = orb_sheet_swing(t->sheet, h);
  } while (h != start);
  return -1;
}

void orb_path_tracer_gates(orb_path_tracer *t, int32_t v, int32_t first, int32_t last, int open) {
  const orb_sheet *s = t->sheet;
  int32_t start = first < 0 ? s->corner[v] : first, end = first < 0 ? start : last, h = start;
  do {
    t->gate[h] = !open ? 0 : t->paths->path[h] >= 0 ? 1 : 3;
    h = orb_sheet_swing(s, h);
  } while (h != end);
}

/* Where a search ends (for a ball: all ends, and their distances), and the node that is being expanded. */
typedef struct goal {
  int32_t vertex;
  double place[3], from[3];
  const int32_t *mark;
  int32_t mark_count;
  double *distance, radius;
} goal;

/* A ball has reached a vertex of a path. */
static void arrive(const orb_path_tracer *t, int32_t from, int32_t vertex, const goal *g) {
  if (vertex < g->mark_count && g->mark[vertex] >= 0) {
    double *least = &g->distance[g->mark[vertex]],
           cost = t->cost[from] + sqrt(orb_distance2(g->from, point_of(t->sheet, vertex)));
    *least = cost < *least ? cost : *least;
  }
}

static orb_status reach(orb_path_tracer *t, int32_t from, int32_t to, const goal *g) {
  double b[3];
  place_of(t, to, b);
  double cost = t->cost[from] + sqrt(orb_distance2(g->from, b));
  if (t->stamp[to] == t->now && t->cost[to] <= cost) {
    return ORB_OK;
  }
  double estimate = g->mark ? cost : cost + sqrt(orb_distance2(b, g->place));
  if (g->mark && cost > g->radius) {
    return ORB_OK;
  }
  t->stamp[to] = t->now;
  t->cost[to] = cost;
  t->from[to] = from;
  return heap_push(t, (orb_path_node){estimate, cost, to});
}

/* Along half-edge h, from its origin (node) to its end. */
static orb_status along(orb_path_tracer *t, int32_t node, int32_t h, const goal *g) {
  const orb_sheet *s = t->sheet;
  int32_t end = s->shape.mesh.triangles[orb_next(h)];
  if (t->paths->path[h] >= 0) {
    return ORB_OK;
  }
  if (g->mark && t->paths->on[end]) {
    arrive(t, node, end, g);
    return ORB_OK;
  }
  if (end == g->vertex ? (t->gate[s->twin[h]] & 2) == 0 : t->paths->on[end]) {
    return ORB_OK;
  }
  return reach(t, node, 2 * end, g);
}

static orb_status to_edge(orb_path_tracer *t, int32_t node, int32_t h, const goal *g) {
  return t->paths->path[h] >= 0 ? ORB_OK : reach(t, node, 2 * edge_name(t->sheet, h) + 1, g);
}

static orb_status expand_vertex(orb_path_tracer *t, int32_t node, int is_start, const goal *g) {
  const orb_sheet *s = t->sheet;
  int32_t start = s->corner[node >> 1], h = start;
  do {
    if (!is_start || (t->gate[h] & 2)) {
      ORB_TRY(along(t, node, h, g));
    }
    if (!is_start || (t->gate[h] & 1)) {
      ORB_TRY(to_edge(t, node, orb_next(h), g));
    }
    h = orb_sheet_swing(s, h);
  } while (h != start);
  return ORB_OK;
}

static orb_status expand_edge(orb_path_tracer *t, int32_t node, const goal *g) {
  const orb_sheet *s = t->sheet;
  int32_t sides[2] = {node >> 1, s->twin[node >> 1]};
  for (int k = 0; k < 2; k++) {
    int32_t h = sides[k], apex_h = orb_prev(h), apex = s->shape.mesh.triangles[apex_h];
    ORB_TRY(to_edge(t, node, orb_next(h), g));
    ORB_TRY(to_edge(t, node, apex_h, g));
    if (g->mark && t->paths->on[apex]) {
      arrive(t, node, apex, g);
    } else if (apex == g->vertex ? (t->gate[apex_h] & 1) != 0 : !t->paths->on[apex]) {
      ORB_TRY(reach(t, node, 2 * apex, g));
    }
  }
  return ORB_OK;
}

static orb_status begin(orb_path_tracer *t, int32_t from) {
  int32_t start = 2 * from;
  t->now++;
  t->heap_count = 0;
  t->cost[start] = 0;
  t->stamp[start] = t->now;
  t->from[start] = -1;
  return heap_push(t, (orb_path_node){0, 0, start});
}

/* Expands nodes in their order until the search reaches its end. *last: that node; −1: there is no path. */
static orb_status expand_all(orb_path_tracer *t, int32_t start, goal *g, int32_t *last) {
  *last = -1;
  for (int32_t popped = 0; t->heap_count > 0; popped++) {
    if (popped % 8192 == 8191) {
      ORB_TRY(orb_context_check(t->ctx));
    }
    if (--*t->work < 0) {
      break;
    }
    orb_path_node top = heap_pop(t);
    int32_t node = top.node;
    if (t->bound > 0 && !g->mark && top.estimate > t->bound) {
      break;
    }
    if (node == 2 * g->vertex) {
      t->length = top.cost;
      *last = node;
      break;
    }
    if (top.cost > t->cost[node]) {
      continue; /* a shorter way has been found since */
    }
    place_of(t, node, g->from);
    ORB_TRY(node & 1 ? expand_edge(t, node, g) : expand_vertex(t, node, node == start, g));
  }
  return ORB_OK;
}

orb_status orb_path_tracer_search(orb_path_tracer *t, int32_t from, int32_t to, int *found) {
  goal g = {.vertex = to};
  int32_t last;
  place_of(t, 2 * to, g.place);
  ORB_TRY(begin(t, from));
  ORB_TRY(expand_all(t, 2 * from, &g, &last));
  *found = last >= 0;
  t->chain_count = 0;
  for (int32_t node = last; node >= 0; node = t->from[node]) {
    t->chain[t->chain_count++] = node;
  }
  return ORB_OK;
}

orb_status orb_path_tracer_ball(orb_path_tracer *t, int32_t from, double radius, const int32_t *mark,
                                int32_t mark_count, double *distance, int32_t distance_count) {
  int32_t last;
  orb_status status;
  double *found = ORB_NEW(t->ctx, double, distance_count);
  if (!found) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t k = 0; k < distance_count; k++) {
    found[k] = radius;
  }
  goal g = {.vertex = -1, .mark = mark, .mark_count = mark_count, .distance = found, .radius = radius};
  orb_path_tracer_gates(t, from, -1, -1, 1);
  ORB_GO(status, begin(t, from), end);
  status = expand_all(t, 2 * from, &g, &last);
end:
  orb_path_tracer_gates(t, from, -1, -1, 0);
  for (int32_t k = 0; status == ORB_OK && k < distance_count; k++) {
    distance[k] = found[k] > distance[k] ? found[k] : distance[k];
  }
  orb_free(t->ctx, found);
  return status;
}

/* Remembers edges by their ends, since splits renumber half-edges. */
orb_status orb_path_tracer_lay(orb_path_tracer *t, int32_t e, int *good) {
  orb_sheet *s = t->sheet;
  int32_t count = t->chain_count, first = s->shape.mesh.vertex_count, last = -1;
  orb_status status = ORB_OK;
  int32_t *ends = ORB_NEW(t->ctx, int32_t, 2 * (size_t)count);
  if (!ends) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t i = 0; i < count; i++) {
    int32_t node = t->chain[i];
    ends[2 * i] = node & 1 ? s->shape.mesh.triangles[node >> 1] : node >> 1;
    ends[2 * i + 1] = node & 1 ? s->shape.mesh.triangles[orb_next(node >> 1)] : -1;
  }
  for (int32_t i = 0; i < count; i++) {
    int32_t v = ends[2 * i];
    if (ends[2 * i + 1] >= 0) {
      int32_t h = orb_sheet_edge(s, v, ends[2 * i + 1]);
      if (h < 0) {
        *good = 0;
        break;
      }
      ORB_GO(status, orb_paths_split(t->ctx, s, t->paths, h, &v), end);
    }
    t->paths->on[v] = 1;
    if (last >= 0) {
      int32_t h = orb_sheet_edge(s, last, v);
      if (h < 0 || t->paths->path[h] >= 0) {
        *good = 0;
        break;
      }
      t->paths->path[h] = t->paths->path[s->twin[h]] = e;
    }
    last = v;
  }
  if (*good) {
    orb_paths_straighten(s, t->paths, first);
  }
end:
  orb_free(t->ctx, ends);
  return status;
}

void orb_path_tracer_free(orb_path_tracer *t) {
  orb_free(t->ctx, t->cost);
  orb_free(t->ctx, t->from);
  orb_free(t->ctx, t->stamp);
  orb_free(t->ctx, t->chain);
  orb_free(t->ctx, t->gate);
  orb_free(t->ctx, t->heap);
}
