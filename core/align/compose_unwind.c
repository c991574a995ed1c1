/* Twisted limbs of the best map, turned back.
 *
 * All limbs that cm_twists_find() finds are turned back at once, whole, along their rings. As a map of surfaces that is
 * one-to-one; but triangles are straight on the sphere, so some of the small or thin ones flip there, here and there
 * and not in heaps. Untangling clears them, if roughly, and descent, with flips allowed now and then against the
 * barrier (cm_loosen), comes down from there. Small steps without any flip were tried: half of the vertices get stuck
 * on the way, and the twist stays.
 */
#include <math.h>
#include <string.h>

#include "align/compose_run.h"
#include "align/compose_twist.h"
#include "base/check.h"
#include "embed/loops.h"

enum {
  ROUNDS = 2,
  CLEARINGS = 4,
  DESCENTS = 6,
  SLICE = 1024,
  WORK = 450
};                               /* WORK: vertex steps a vertex that loosening may take */
static const double GAIN = 2e-3; /* by a descent, for another one */

typedef struct unwind {
  cm_run *c;
  cm_level *l;
  const cm_twists *twists;
} unwind;

static void turn_range(void *arg, int64_t begin, int64_t end, int thread) {
  const unwind *u = arg;
  cm_level *l = u->l;
  (void)thread;
  for (int64_t v = begin; v < end; v++) {
    if (!l->pinned[v] && cm_twists_undo(u->twists, &u->c->b, 1, &l->place[v])) {
      cm_surface_at(&u->c->b, &l->place[v], NULL, l->x + 3 * v, NULL);
      cm_level_refresh(l, &u->c->b, (int32_t)v);
    }
  }
}

static orb_status untangle(cm_run *c, cm_level *l, int32_t *flips) {
  ORB_TRY(cm_level_untangle(c->ctx, l, flips, &c->work));
  for (int32_t v = 0; v < l->count; v++) {
    if (!l->pinned[v]) {
      cm_level_locate(l, &c->b, v, l->place[v].triangle);
    }
  }
  return ORB_OK;
}

static orb_status descend(cm_run *c, cm_level *l) {
  int count = c->effort.level_sweeps;
  double last = INFINITY;
  for (int i = 0; i < DESCENTS && cm_level_energy(l) < (1 - GAIN) * last; i++) {
    last = cm_level_energy(l);
    ORB_TRY(cm_sweeps(c, l, cm_hard(), count));
    ORB_TRY(cm_loosen(c, l, count / 2, count / 2));
  }
  return cm_sweeps(c, l, cm_hard(), c->effort.final_sweeps);
}

static double sum_of(const cm_twists *t) {
  double sum = 0;
  for (int32_t i = 0; i < t->count; i++) {
    sum += t->limb[i].most;
  }
  return sum;
}

static orb_status find_twists(cm_run *c, const double *points, cm_twists *out) {
  const orb_mesh *mesh = &c->moving->mesh;
  cm_image map = {c->vertex_count, mesh->triangle_count, mesh->triangles, c->x, points};
  return cm_twists_find(c->ctx, &c->b, &map, c->pairs.fixed, c->pairs.count, out);
}

/* Takes the level for the best map if its energy is less and it is less twisted; the twists become those that are
 * left. points: room for all. */
static orb_status keep_better(cm_run *c, const orb_surface *s, const cm_level *l, double *points, cm_twists *twists,
                              int *better) {
  double energy = cm_level_energy(l);
  cm_twists left;
  *better = 0;
  if (!(energy < c->best_energy) || cm_level_flips(l) > 0) {
    return ORB_OK;
  }
  for (int32_t v = 0; v < l->count; v++) {
    memcpy(points + 3 * (size_t)s->to_mesh[l->vertex[v]], l->x + 3 * (size_t)v, sizeof(double[3]));
  }
  ORB_TRY(find_twists(c, points, &left));
  *better = sum_of(&left) < sum_of(twists);
  if (*better) {
    c->best_energy = energy;
    memcpy(c->best, points, 3 * (size_t)c->vertex_count * sizeof *points);
  }
  cm_twists_free(c->ctx, twists);
  *twists = left;
  return ORB_OK;
}

static orb_status unwind_once(cm_run *c, const orb_surface *s, double *points, cm_twists *twists, int *better) {
  cm_level level = {0};
  unwind u = {c, &level, twists};
  int32_t flips;
  orb_status status;
  int64_t least = WORK * (int64_t)c->vertex_count;
  c->work = c->work > least ? c->work : least;
  ORB_GO(status, cm_full_level(c, c->best, s, &level), done);
  cm_set_pull(c, &level, s->to_mesh, 0);
  ORB_GO(status, orb_sliced_by(c->ctx, level.count, SLICE, 64, turn_range, &u), done);
  ORB_GO(status, untangle(c, &level, &flips), done);
  if (flips) {
    ORB_GO(status, cm_clear_flips(c, &level, CLEARINGS, &flips), done);
  }
  if (!flips) {
    ORB_GO(status, descend(c, &level), done);
  }
  status = keep_better(c, s, &level, points, twists, better);
done:
  cm_level_free(c->ctx, &level);
  return status;
}

orb_status cm_unwind(cm_run *c) {
  orb_surface s = {0};
  cm_twists twists;
  double *points = NULL;
  orb_status status = ORB_OK;
  int better = 1;
  ORB_TRY(find_twists(c, c->best, &twists));
  if (twists.count == 0) {
    goto done;
  }
  points = ORB_NEW(c->ctx, double, 3 * (size_t)c->vertex_count);
  status = points ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    status = orb_surface_create(c->ctx, &c->moving->mesh, &s);
  }
  for (int round = 0; round < ROUNDS && better && twists.count > 0 && status == ORB_OK; round++) {
    status = unwind_once(c, &s, points, &twists, &better);
  }
done:
  cm_twists_free(c->ctx, &twists);
  orb_surface_free(c->ctx, &s);
  orb_free(c->ctx, points);
  return status;
}
