/* The level of all vertices, its landmarks pinned. */
#include <string.h>

#include "align/map/engine/full_level.h"
#include "base/check.h"
#include "base/memory.h"

orb_status orb_map_full_level(orb_map_run *c, const double *points, const orb_corner_table *s, orb_map_level *level) {
  orb_context *ctx = c->ctx;
  size_t n = (size_t)c->vertex_count;
  unsigned char *flags = ORB_NEW0(ctx, unsigned char, 3 * n); /* alive; pinned; pinned in mesh order */
  if (!flags) {
    return ORB_E_NO_MEMORY;
  }
  memset(flags, 1, n);
  for (int32_t i = 0; i < c->pairs.landmarks; i++) {
    flags[2 * n + (size_t)c->pairs.moving[i]] = 1;
  }
  for (size_t v = 0; v < n; v++) {
    flags[n + v] = flags[2 * n + (size_t)s->to_mesh[v]];
    memcpy(c->position + 3 * v, c->x + 3 * (size_t)s->to_mesh[v], sizeof(double[3]));
  }
  orb_status status =
      orb_map_level_create(ctx, &c->params, s, flags, flags + n, c->position, c->vertex_count, c->local, level);
  for (int32_t v = 0; status == ORB_OK && v < level->count; v++) {
    memcpy(level->x + 3 * (size_t)v, points + 3 * (size_t)s->to_mesh[level->vertex[v]], sizeof(double[3]));
  }
  if (status == ORB_OK) {
    status = orb_map_level_locate_all(ctx, level, &c->b, 1);
  }
  orb_free(ctx, flags);
  return status;
}
