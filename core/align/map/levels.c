#include "align/map/levels.h"

#include <math.h>
#include <string.h>

#include "align/map/engine/iron.h"
#include "align/map/engine/loosen.h"
#include "align/map/engine/rounds.h"
#include "align/map/engine/step.h"
#include "align/map/starts/place.h"
#include "base/check.h"
#include "base/context.h"
#include "base/error.h"
#include "base/memory.h"
#include "embed/newton/place.h"
#include "numeric/vec3.h"

/* The vertices of pairs and springs stay on every level, and there is no hierarchy yet. */
static void reset(orb_map_run *c) {
  orb_hierarchy_destroy(c->ctx, c->hierarchy);
  c->hierarchy = NULL;
  memset(c->keep, 0, (size_t)c->vertex_count);
  for (int32_t i = 0; i < c->pairs.count; i++) {
    c->keep[c->pairs.moving[i]] = ORB_MAP_PINNED;
  }
  for (int32_t i = 0; i < c->springs.count; i++) {
    unsigned char *keep = &c->keep[c->springs.moving[i]];
    *keep = *keep ? *keep : ORB_MAP_FREE;
  }
}

static void take(orb_map_run *c, orb_hierarchy *hierarchy) {
  c->hierarchy = hierarchy;
  for (int32_t v = 0; v < c->vertex_count; v++) {
    memcpy(c->position + 3 * (size_t)v, c->x + 3 * (size_t)hierarchy->surface.to_mesh[v], sizeof(double[3]));
  }
}

orb_status orb_map_levels_prepare(orb_map_run *c) {
  orb_hierarchy *hierarchy = NULL;
  reset(c);
  for (int32_t i = 0; i < c->pairs.count; i++) {
    memcpy(c->start + 3 * (size_t)c->pairs.moving[i], c->b.s + 3 * (size_t)c->pairs.fixed[i], sizeof(double[3]));
  }
  const int32_t keep_until = orb_map_keep_until(&c->params, c->pairs.count + c->springs.count);
  ORB_TRY(orb_hierarchy_create(c->ctx, &c->moving->mesh, c->keep, keep_until, &hierarchy));
  take(c, hierarchy);
  return ORB_OK;
}

void orb_map_levels_adopt(orb_map_run *c, orb_hierarchy **hierarchy) {
  reset(c);
  take(c, *hierarchy);
  *hierarchy = NULL;
}

orb_status orb_map_levels_begin(orb_map_run *c, orb_refiner **out) {
  orb_embed_options options;
  orb_embed_defaults(&options);
  ORB_TRY(orb_refiner_create(c->ctx, c->hierarchy, &options, out));
  (*out)->settings.crowded = INFINITY;
  if (c->keeps_angles) {
    orb_refiner_keep_angles(*out);
  }
  return ORB_OK;
}

void orb_map_level_store(orb_map_run *c, const orb_map_level *l, orb_refiner *r) {
  for (int32_t v = 0; v < l->count; v++) {
    memcpy(r->point + 4 * (size_t)l->vertex[v], l->x + 3 * (size_t)v, sizeof(double[3]));
    c->place[l->vertex[v]] = l->place[v];
  }
}

/* A level of the vertices that are alive now. Those in `known` keep their places; new ones are located. */
static orb_status load_level(orb_map_run *c, const orb_refiner *r, const unsigned char *known, orb_map_level *l) {
  ORB_TRY(orb_map_level_create(c->ctx, &c->params, &c->hierarchy->surface, r->alive, r->pinned, c->position, r->live,
                               c->local, l));
  int32_t hint = -1;
  for (int32_t v = 0; v < l->count; v++) {
    int32_t u = l->vertex[v];
    memcpy(l->x + 3 * (size_t)v, r->point + 4 * (size_t)u, sizeof(double[3]));
    if (known && known[u]) {
      l->place[v] = c->place[u];
      orb_map_level_refresh(l, &c->b, v);
    } else {
      orb_map_level_locate(l, &c->b, v, hint);
    }
    hint = l->place[v].triangle;
  }
  return ORB_OK;
}

/* The most sweeps on a level of the refinement. */
static int sweeps_of(const orb_map_run *c, const orb_refiner *r, int first, int rough) {
  const orb_map_params *p = &c->params;
  int count = r->live == c->vertex_count  ? p->level.final_sweeps
              : first                     ? p->level.first_sweeps
              : r->live < p->level.coarse ? p->level.coarse_sweeps
                                          : p->level.level_sweeps;
  return rough && count > p->level.rough_sweeps ? p->level.rough_sweeps : count;
}

orb_status orb_map_level_next(orb_map_run *c, orb_refiner *r, orb_map_level *l, unsigned char *known, double pull,
                              int *has_room) {
  const int32_t *to_mesh = c->hierarchy->surface.to_mesh;
  const orb_map_rules hard = orb_map_hard(&c->params);
  memcpy(known, r->alive, (size_t)c->vertex_count);
  double wanted = c->params.level.growth * r->live;
  wanted = wanted > c->vertex_count / c->params.level.last_growth ? c->vertex_count : wanted;
  *has_room = 1;
  while (r->live < c->vertex_count && r->live < wanted) {
    const orb_status status = orb_refiner_undo_round(c->ctx, r, r->settings.blend);
    if (status == ORB_E_NOT_CERTIFIED) {
      orb_error_clear(c->ctx);
      *has_room = 0;
      return ORB_OK;
    }
    ORB_TRY(status);
  }
  orb_map_level_free(c->ctx, l);
  ORB_TRY(load_level(c, r, known, l));
  for (int32_t v = 0; v < l->count; v++) {
    if (pull > 0) {
      (void)orb_map_level_try(l, &c->b, &hard, v, &c->target_place[to_mesh[l->vertex[v]]]);
    }
    for (int i = 0; i < c->params.level.new_steps && !known[l->vertex[v]]; i++) {
      orb_map_level_step(l, &c->b, &hard, v);
    }
  }
  return ORB_OK;
}

orb_status orb_map_levels_refine(orb_map_run *c, orb_refiner *r, orb_map_level *l, double pull, double hold, int rough,
                                 int *failed) {
  const int32_t *to_mesh = c->hierarchy->surface.to_mesh;
  unsigned char *known = ORB_NEW(c->ctx, unsigned char, c->vertex_count);
  orb_status status = known ? ORB_OK : ORB_E_NO_MEMORY;
  for (int first = 1; status == ORB_OK; first = 0) {
    int last = r->live == c->vertex_count, count = sweeps_of(c, r, first, rough);
    orb_map_set_pull(c, l, to_mesh, fmax(last ? 0 : pull, hold));
    pull *= c->params.level.pull_fall;
    ORB_GO(status, orb_map_sweeps(c, l, orb_map_hard(&c->params), count), done);
    if (!rough && (last || (!c->walks_first && orb_map_level_energy(l) > c->params.level.rigid))) {
      ORB_GO(status, orb_map_loosen(c, l, c->params.level.loosen, count / 2, count / 2), done);
    }
    *failed = orb_map_level_flips(l) > 0 || (last && orb_map_level_degree(l) != 1);
    if (*failed) {
      break;
    }
    orb_map_level_store(c, l, r);
    if (last) {
      break;
    }
    int has_room;
    ORB_GO(status, orb_map_level_next(c, r, l, known, pull, &has_room), done);
    if (!has_room) {
      *failed = 1;
      break;
    }
  }
done:
  orb_free(c->ctx, known);
  return status;
}

orb_status orb_map_levels_finish(orb_map_run *c, orb_refiner *r, orb_map_level *l, const orb_map_finish *how) {
  int failed = 0;
  orb_map_level_store(c, l, r);
  ORB_TRY(orb_map_levels_refine(c, r, l, how->pull, how->hold, how->rough, &failed));
  if (!failed && how->irons) {
    ORB_TRY(orb_map_iron(c, l));
    orb_map_level_store(c, l, r);
  }
  const double energy = failed ? INFINITY : orb_map_level_energy(l);
  if (energy < c->best_energy) {
    c->best_energy = energy;
    orb_refiner_points(r, c->best);
  }
  return ORB_OK;
}

orb_status orb_map_level_place(orb_map_run *c, orb_refiner *r, orb_map_start start, int32_t size, orb_map_level *l) {
  const int32_t *to_mesh = c->hierarchy->surface.to_mesh;
  ORB_TRY(orb_refiner_skip(c->ctx, r, size < c->vertex_count ? size : c->vertex_count));
  for (int32_t v = 0; v < c->vertex_count; v++) {
    r->pinned[v] = c->keep[to_mesh[v]] == ORB_MAP_PINNED;
  }
  orb_map_level_free(c->ctx, l);
  ORB_TRY(orb_map_level_create(c->ctx, &c->params, &c->hierarchy->surface, r->alive, r->pinned, c->position, r->live,
                               c->local, l));
  ORB_TRY(orb_map_place(c, l, to_mesh, start));
  orb_map_set_pull(c, l, to_mesh, start == ORB_MAP_SPATIAL ? 1 : 0);
  return ORB_OK;
}
