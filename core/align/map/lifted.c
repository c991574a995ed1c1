#include "align/map/lifted.h"

#include <string.h>

#include "align/map/engine/clear.h"
#include "align/map/engine/rounds.h"
#include "align/map/levels.h"
#include "base/check.h"
#include "base/memory.h"

/* Puts the vertices of the copy at their points, and landmarks at those of their partners. */
static void set_start(orb_map_run *c, const orb_map_level_map *copy) {
  for (int32_t i = 0; i < copy->count; i++) {
    memcpy(c->start + 3 * (size_t)copy->vertex[i], copy->points + 3 * (size_t)i, sizeof(double[3]));
  }
  for (int32_t i = 0; i < c->pairs.count; i++) {
    memcpy(c->start + 3 * (size_t)c->pairs.moving[i], c->b.s + 3 * (size_t)c->pairs.fixed[i], sizeof(double[3]));
  }
}

/* The vertices of the copy should stay where they are. */
static void set_targets(orb_map_run *c, const orb_map_level *l) {
  memset(c->doubted, ORB_MAP_NO_TARGET, (size_t)c->vertex_count);
  for (int32_t v = 0; v < l->count; v++) {
    const int32_t m = c->hierarchy->surface.to_mesh[l->vertex[v]];
    memcpy(c->target + 3 * (size_t)m, l->y + 3 * (size_t)v, sizeof(double[3]));
    c->doubted[m] = ORB_MAP_TRUSTED;
  }
}

orb_status orb_map_lift(orb_map_run *c, const orb_map_level_map *copy) {
  orb_refiner *r = NULL;
  orb_map_level level = {0};
  int32_t flips = 0;
  orb_status status;
  orb_map_finish finish = {.hold = copy->lets_go ? 0 : c->params.copies.hold};
  orb_map_levels_adopt(c, copy->hierarchy);
  set_start(c, copy);
  ORB_GO(status, orb_map_levels_begin(c, &r), done);
  ORB_GO(status, orb_map_level_place(c, r, ORB_MAP_GIVEN, copy->count, &level), done);
  ORB_ASSERT(level.count == copy->count);
  /* The copy's edges may have been split where landmarks pass one another. Without the splits, triangles can flip. */
  if (orb_map_level_flips(&level) > 0) {
    ORB_GO(status, orb_map_clear_flips(c, &level, c->params.clear.first_barrier, c->params.clear.rounds, 0, &flips),
           done);
  }
  if (flips > 0) {
    goto done;
  }
  set_targets(c, &level);
  const int is_poor = !copy->lets_go && orb_map_level_energy(&level) > c->params.copies.poor;
  finish.rough = is_poor || c->vertex_count > c->params.copies.rough;
  finish.irons = !is_poor;
  status = orb_map_levels_finish(c, r, &level, &finish);
done:
  orb_map_level_free(c->ctx, &level);
  orb_refiner_destroy(c->ctx, r);
  return status;
}
