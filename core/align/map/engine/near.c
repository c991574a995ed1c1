/* A spatial start that is nearly a map: few triangles are still flipped, around vertices that are held.
 *
 * The held vertices near the flips are released, the flips are cleared without them, and the vertices are drawn back
 * while no flip is allowed. If that fails, the vertices some rings away from the flips are still usable: the landmark
 * walk (starts/landmark_walk.c) goes to samples of them, which are better than the spatial targets alone.
 */
#include <math.h>
#include <string.h>

#include "align/map/engine/clear.h"
#include "align/map/engine/near.h"
#include "align/map/engine/rounds.h"
#include "align/map/engine/untangle.h"
#include "base/check.h"
#include "base/memory.h"
#include "numeric/predicates.h"

int orb_map_is_near(const orb_map_level *l, int32_t flips) {
  return flips <= l->triangle_count / l->params->near.few;
}

static const double *point(const orb_map_level *l, int32_t v) {
  return l->x + 3 * (size_t)v;
}

/* Holds v at its point again if that flips nothing. */
static int settle(const orb_map_run *c, orb_map_level *l, int32_t v, const double home[3]) {
  double *x = l->x + 3 * (size_t)v, old[3];
  memcpy(old, x, sizeof old);
  memcpy(x, home, sizeof old);
  for (int32_t i = l->start[v]; i < l->start[v + 1]; i++) {
    if (orb_orient(x, point(l, l->spoke[i].q), point(l, l->spoke[i].r)) <= 0) {
      memcpy(x, old, sizeof old);
      return 0;
    }
  }
  l->pinned[v] = 1;
  l->pull[v] = 0;
  orb_map_level_locate(l, &c->b, v, l->place[v].triangle);
  return 1;
}

/* Draws the released vertices to their points, more strongly from round to round. *count: those that are not back. */
static orb_status draw_home(orb_map_run *c, orb_map_level *l, const int32_t *to_mesh, const double *home,
                            unsigned char *released, int32_t *count) {
  double pull = c->params.near.home_pull;
  orb_map_set_pull(c, l, to_mesh, 0);
  for (int round = 0; round < c->params.near.home_rounds && *count; round++, pull *= 2) {
    for (int32_t v = 0; v < l->count; v++) {
      if (released[v] && settle(c, l, v, home + 3 * (size_t)v)) {
        released[v] = 0;
        --*count;
      } else if (released[v]) {
        l->pull[v] = pull * l->area[v];
      }
    }
    if (*count) {
      ORB_TRY(orb_map_sweeps(c, l, orb_map_hard(&c->params), c->params.near.home_sweeps));
    }
  }
  return ORB_OK;
}

orb_status orb_map_release(orb_map_run *c, orb_map_level *l, const int32_t *to_mesh, int32_t *flips) {
  orb_context *ctx = c->ctx;
  size_t n = (size_t)l->count;
  unsigned char *released = ORB_NEW0(ctx, unsigned char, 3 * n);
  double *home = ORB_NEW(ctx, double, 3 * n);
  int32_t count = 0;
  orb_status status = released && home ? ORB_OK : ORB_E_NO_MEMORY;
  if (status != ORB_OK) {
    goto done;
  }
  ORB_GO(status, orb_map_level_mark_flips(ctx, l, c->params.near.rings, released + n, released + 2 * n), done);
  memcpy(home, l->x, 3 * n * sizeof *home);
  orb_map_set_pull(c, l, to_mesh, 1);
  for (size_t v = 0; v < n; v++) {
    if (released[n + v] && l->pinned[v]) {
      released[v] = 1;
      l->pinned[v] = 0;
      l->pull[v] = c->params.near.home_pull * l->area[v];
      count++;
    }
  }
  ORB_GO(status, orb_map_clear_flips(c, l, c->params.clear.first_barrier, c->params.near.clearings, 0, flips), done);
  if (*flips == 0) {
    ORB_GO(status, draw_home(c, l, to_mesh, home, released, &count), done);
    *flips = count;
  }
done:
  orb_free(ctx, released);
  orb_free(ctx, home);
  return status;
}

orb_status orb_map_keep_usable(orb_map_run *c, const orb_map_level *l, const int32_t *to_mesh) {
  size_t n = (size_t)l->count;
  unsigned char *mark = ORB_NEW(c->ctx, unsigned char, 2 * n);
  orb_status status =
      mark ? orb_map_level_mark_flips(c->ctx, l, c->params.near.usable_rings, mark, mark + n) : ORB_E_NO_MEMORY;
  if (status != ORB_OK) {
    goto done;
  }
  memset(c->usable, 0, (size_t)c->vertex_count);
  for (size_t i = 0; i < n; i++) {
    int32_t v = to_mesh[l->vertex[i]];
    if (!mark[i]) {
      c->usable[v] = 1;
      c->target_place[v] = l->place[i];
      c->doubted[v] = ORB_MAP_TRUSTED;
    }
  }
  c->has_usable = 1;
done:
  orb_free(c->ctx, mark);
  return status;
}
