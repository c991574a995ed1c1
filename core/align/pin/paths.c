/* The flags of paths on a sheet, kept as the sheet grows. */
#include <string.h>

#include "align/pin/paths.h"
#include "base/check.h"
#include "base/memory.h"

void orb_paths_free(orb_context *ctx, orb_paths *paths) {
  orb_free(ctx, paths->path);
  orb_free(ctx, paths->on);
  memset(paths, 0, sizeof *paths);
}

orb_status orb_paths_fit(orb_context *ctx, const orb_sheet *s, orb_paths *paths) {
  if (paths->half_edges < 3 * s->triangle_capacity) {
    int32_t capacity = 3 * s->triangle_capacity, *path = orb_realloc(ctx, paths->path, (size_t)capacity, sizeof *path);
    if (!path) {
      return ORB_E_NO_MEMORY;
    }
    for (int32_t h = paths->half_edges; h < capacity; h++) {
      path[h] = -1;
    }
    paths->path = path;
    paths->half_edges = capacity;
  }
  if (paths->vertices < s->vertex_capacity) {
    unsigned char *on = orb_realloc(ctx, paths->on, (size_t)s->vertex_capacity, 1);
    if (!on) {
      return ORB_E_NO_MEMORY;
    }
    memset(on + paths->vertices, 0, (size_t)(s->vertex_capacity - paths->vertices));
    paths->on = on;
    paths->vertices = s->vertex_capacity;
  }
  return ORB_OK;
}

orb_status orb_paths_split(orb_context *ctx, orb_sheet *s, orb_paths *paths, int32_t h, int32_t *vertex) {
  int32_t g = s->twin[h], side[2] = {orb_next(h), orb_next(g)}, held[2] = {paths->path[side[0]], paths->path[side[1]]};
  ORB_ASSERT(paths->path[h] < 0);
  ORB_TRY(orb_sheet_split_edge(ctx, s, h, 0.5, vertex));
  ORB_TRY(orb_paths_fit(ctx, s, paths));
  int32_t moved[2] = {orb_next(s->twin[g]), orb_next(s->twin[h])};
  for (int k = 0; k < 2; k++) {
    paths->path[side[k]] = -1;
    paths->path[moved[k]] = held[k];
  }
  return ORB_OK;
}
