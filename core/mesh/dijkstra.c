#include "mesh/dijkstra.h"

#include <string.h>

#include "base/memory.h"

static void place(orb_dijkstra *p, int32_t at, int32_t v) {
  p->heap[at] = v;
  p->slot[v] = at;
}

static void rise(orb_dijkstra *p, int32_t at, int32_t v) {
  while (at > 0 && p->distance[p->heap[(at - 1) / 2]] > p->distance[v]) {
    place(p, at, p->heap[(at - 1) / 2]);
    at = (at - 1) / 2;
  }
  place(p, at, v);
}

int32_t orb_dijkstra_pop(orb_dijkstra *p) {
  int32_t top = p->heap[0], last = p->heap[--p->heap_count], at = 0;
  for (int32_t child; (child = 2 * at + 1) < p->heap_count; at = child) {
    child += child + 1 < p->heap_count && p->distance[p->heap[child + 1]] < p->distance[p->heap[child]];
    if (p->distance[p->heap[child]] >= p->distance[last]) {
      break;
    }
    place(p, at, p->heap[child]);
  }
  if (p->heap_count > 0) {
    place(p, at, last);
  }
  return top;
}

void orb_dijkstra_start(orb_dijkstra *p, int32_t seed) {
  for (int32_t i = 0; i < p->touched_count; i++) {
    p->state[p->touched[i]] = ORB_DIJKSTRA_UNSEEN;
  }
  p->touched_count = 0;
  p->touched[p->touched_count++] = seed;
  p->state[seed] = ORB_DIJKSTRA_WAITING;
  p->distance[seed] = 0;
  p->parent[seed] = -1;
  p->walked[seed] = 0;
  p->heap_count = 1;
  place(p, 0, seed);
}

void orb_dijkstra_reach(orb_dijkstra *p, int32_t h, double distance) {
  int32_t v = orb_dijkstra_target(p, h);
  if (p->state[v] == ORB_DIJKSTRA_UNSEEN) {
    p->touched[p->touched_count++] = v;
    p->state[v] = ORB_DIJKSTRA_WAITING;
    p->slot[v] = p->heap_count++;
  } else if (p->state[v] != ORB_DIJKSTRA_WAITING || p->distance[v] <= distance) {
    return;
  }
  p->distance[v] = distance;
  p->parent[v] = h;
  p->walked[v] = p->walked[orb_dijkstra_origin(p, h)] ^ p->label[h];
  rise(p, p->slot[v], v);
}

orb_status orb_dijkstra_open(orb_dijkstra *p, orb_surface *s) {
  const orb_mesh *mesh = s->mesh;
  orb_context *ctx = s->ctx;
  size_t vertices = (size_t)mesh->vertex_count, half_edges = 3 * (size_t)mesh->triangle_count;
  *p = (orb_dijkstra){.s = s,
                      .corner = ORB_NEW(ctx, int32_t, vertices),
                      .label = ORB_NEW(ctx, uint64_t, half_edges),
                      .distance = ORB_NEW(ctx, double, vertices),
                      .parent = ORB_NEW(ctx, int32_t, vertices),
                      .walked = ORB_NEW(ctx, uint64_t, vertices),
                      .state = ORB_NEW0(ctx, unsigned char, vertices),
                      .heap = ORB_NEW(ctx, int32_t, vertices),
                      .slot = ORB_NEW(ctx, int32_t, vertices),
                      .touched = ORB_NEW(ctx, int32_t, vertices)};
  if (!p->corner || !p->label || !p->distance || !p->parent || !p->walked || !p->state || !p->heap || !p->slot ||
      !p->touched) {
    return ORB_E_NO_MEMORY;
  }
  memset(p->corner, 0xff, vertices * sizeof *p->corner);
  for (size_t h = half_edges; h-- > 0;) {
    p->corner[mesh->triangles[h]] = (int32_t)h;
  }
  return ORB_OK;
}

void orb_dijkstra_close(orb_dijkstra *p) {
  void *blocks[] = {p->corner, p->label, p->distance, p->parent, p->walked, p->state, p->heap, p->slot, p->touched};
  for (size_t i = 0; i < sizeof blocks / sizeof *blocks; i++) {
    orb_free(p->s->ctx, blocks[i]);
  }
}
