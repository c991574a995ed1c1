/* Untwists the limbs of the best map.
 *
 * All limbs that orb_map_twists_find() finds are rotated back along their rings in one step. That is a one-to-one map
 * of surfaces, but triangles are straight on the sphere, so some small or thin ones flip there, scattered over the
 * limb. Untangling clears these flips roughly, and descent, with flips allowed now and then against the barrier
 * (orb_map_loosen), lowers the energy from there. Where triangles are large compared with the limb, flips remain; then
 * the limbs are rotated in smaller steps, each untangled and smoothed before the next, and if that folds too, one limb
 * after the other, so that one that folds does not stop the others. A limb that is wound by whole turns between two
 * landmarks is unwound in one step only, the last. Steps without any flip were tried: half of the vertices get stuck on
 * the way, and the twist stays.
 *
 * The result is kept if its energy is lower and if more of the area is left halfway through a linear morph. The energy
 * alone does not decide: a twist that is spread over a long limb costs little.
 */
#include <math.h>
#include <string.h>

#include "align/map/engine/loosen.h"
#include "align/map/engine/rounds.h"
#include "align/map/engine/run.h"
#include "align/map/engine/untangle.h"
#include "align/map/twist/twist.h"
#include "align/map/twist/untwist.h"
#include "base/check.h"
#include "base/loops.h"
#include "base/memory.h"

enum { SLICE = 1024 }; /* vertices between checks for cancellation */

typedef struct untwisting {
  orb_map_run *c;
  orb_map_level *l;
  const orb_map_twists *twists;
  double share; /* of the twists, undone in one step */
  int unwinds;  /* this step undoes windings */
} untwisting;

static void untwist_range(void *arg, int64_t begin, int64_t end, int thread) {
  const untwisting *u = arg;
  orb_map_level *l = u->l;
  (void)thread;
  for (int64_t v = begin; v < end; v++) {
    if (!l->pinned[v] && orb_map_twists_undo(u->twists, &u->c->b, u->share, u->unwinds, &l->place[v])) {
      orb_map_surface_at(&u->c->b, &l->place[v], NULL, l->x + 3 * v, NULL);
      orb_map_level_refresh(l, &u->c->b, (int32_t)v);
    }
  }
}

/* Locates the vertices again only if no flip is left: else the level is given up. */
static orb_status untangle(orb_map_run *c, orb_map_level *l, int32_t *flips) {
  ORB_TRY(orb_map_level_untangle(c->ctx, l, flips, &c->work));
  return *flips == 0 ? orb_map_level_locate_all(c->ctx, l, &c->b, 0) : ORB_OK;
}

static orb_map_image image_of(const orb_map_run *c, const double *points) {
  const orb_mesh *mesh = &c->moving->mesh;
  return (orb_map_image){c->vertex_count, mesh->triangle_count, mesh->triangles, c->x, points};
}

static orb_status find_twists(orb_map_run *c, const double *points, orb_map_twists *out) {
  const orb_map_image map = image_of(c, points);
  return orb_map_twists_find(c->ctx, &c->params, &c->b, &map, c->pairs.fixed, c->pairs.count, out);
}

/* Does the level keep clearly more of the area halfway than the best map? points: receives the level's, in mesh order.
 */
static orb_status keeps_more(const untwisting *u, const orb_corner_table *s, double *points, int *more) {
  const orb_map_run *c = u->c;
  double kept;
  for (int32_t v = 0; v < u->l->count; v++) {
    memcpy(points + 3 * (size_t)s->to_mesh[u->l->vertex[v]], u->l->x + 3 * (size_t)v, sizeof(double[3]));
  }
  const orb_map_image map = image_of(c, points);
  ORB_TRY(orb_map_rotations_kept(c->ctx, &c->b, &map, &kept));
  *more = kept > u->twists->kept + c->params.untwist.kept_gain;
  return ORB_OK;
}

/* Lowers the energy of untwisted limbs; the result replaces the best map if it is better. Gives up if no more area is
 * left halfway after the first descent: the limbs have gone another way. */
static orb_status descend(const untwisting *u, const orb_corner_table *s) {
  orb_map_run *c = u->c;
  const orb_map_params *p = &c->params;
  orb_map_level *l = u->l;
  int count = p->level.level_sweeps, more = 1;
  size_t n = 3 * (size_t)c->vertex_count;
  double last = INFINITY, *points = ORB_NEW(c->ctx, double, n);
  orb_status status = points ? ORB_OK : ORB_E_NO_MEMORY;
  for (int i = 0;
       i < p->untwist.descents && status == ORB_OK && more && orb_map_level_energy(l) < (1 - p->untwist.gain) * last;
       i++) {
    last = orb_map_level_energy(l);
    ORB_GO(status, orb_map_sweeps(c, l, orb_map_hard(p), count), done);
    ORB_GO(status, orb_map_loosen(c, l, p->level.loosen, count / 2, count / 2), done);
    if (i == 0) {
      ORB_GO(status, keeps_more(u, s, points, &more), done);
    }
  }
  if (status != ORB_OK || !more) {
    goto done;
  }
  ORB_GO(status, orb_map_sweeps(c, l, orb_map_hard(p), p->level.final_sweeps), done);
  if (orb_map_level_energy(l) < c->best_energy && orb_map_level_flips(l) == 0) {
    ORB_GO(status, keeps_more(u, s, points, &more), done);
    if (more) {
      c->best_energy = orb_map_level_energy(l);
      memcpy(c->best, points, n * sizeof *points);
    }
  }
done:
  orb_free(c->ctx, points);
  return status;
}

/* Untwists all limbs in this number of steps, with sweeps between them. *flips: those that cannot be cleared. */
static orb_status untwist_all(untwisting *u, const orb_corner_table *s, int steps, int32_t *flips) {
  orb_map_run *c = u->c;
  orb_map_level_free(c->ctx, u->l);
  ORB_TRY(orb_map_full_level(c, c->best, s, u->l));
  orb_map_set_pull(c, u->l, s->to_mesh, 0);
  *flips = 0;
  u->share = 1.0 / steps;
  for (int i = 0; i < steps && *flips == 0; i++) {
    if (i > 0) {
      ORB_TRY(orb_map_sweeps(c, u->l, orb_map_hard(&c->params), c->params.untwist.step_sweeps));
    }
    u->unwinds = i == steps - 1;
    ORB_TRY(orb_sliced_by(c->ctx, u->l->count, SLICE, 64, untwist_range, u));
    ORB_TRY(untangle(c, u->l, flips));
  }
  return ORB_OK;
}

/* Untwists one limb after the other, and omits those that fold. *flips: 0 if any limb was untwisted. */
static orb_status untwist_each(untwisting *u, const orb_corner_table *s, int32_t *flips) {
  orb_map_run *c = u->c;
  const orb_map_twists *all = u->twists;
  orb_map_copy before = {0};
  orb_status status;
  orb_map_level_free(c->ctx, u->l);
  *flips = 1;
  ORB_GO(status, orb_map_full_level(c, c->best, s, u->l), done);
  orb_map_set_pull(c, u->l, s->to_mesh, 0);
  u->share = u->unwinds = 1;
  for (int32_t i = 0; i < all->count; i++) {
    orb_map_twists one = *all;
    int32_t folded;
    for (int32_t k = 0; k < all->count; k++) {
      one.limb[k].count = k == i ? all->limb[k].count : 0;
    }
    u->twists = &one;
    ORB_GO(status, orb_map_copy_take(c, u->l, &before), done);
    ORB_GO(status, orb_sliced_by(c->ctx, u->l->count, SLICE, 64, untwist_range, u), done);
    ORB_GO(status, untangle(c, u->l, &folded), done);
    if (folded) {
      orb_map_copy_restore(&before, u->l);
    } else {
      *flips = 0;
    }
    orb_map_copy_free(c, &before);
  }
done:
  orb_map_copy_free(c, &before);
  u->twists = all;
  return status;
}

/* Steps in which limbs can be untwisted: there is nothing between a wound limb and an unwound one. */
static int most_steps(const orb_map_params *params, const orb_map_twists *twists) {
  int most = 1;
  for (int32_t k = 0; k < twists->count; k++) {
    most = twists->limb[k].pole >= 0 ? params->untwist.steps : most;
  }
  return most;
}

static orb_status untwist_limbs(orb_map_run *c, const orb_map_twists *twists) {
  orb_corner_table s = {0};
  orb_map_level level = {0};
  untwisting u = {.c = c, .l = &level, .twists = twists};
  int32_t flips = 1;
  orb_status status;
  ORB_GO(status, orb_corner_table_create(c->ctx, &c->moving->mesh, &s), done);
  const int most = most_steps(&c->params, twists);
  ORB_GO(status, untwist_all(&u, &s, 1, &flips), done);
  if (flips && most > 1) {
    ORB_GO(status, untwist_all(&u, &s, most, &flips), done);
  }
  if (flips && twists->count > 1) {
    ORB_GO(status, untwist_each(&u, &s, &flips), done);
  }
  if (!flips) {
    status = descend(&u, &s);
  }
done:
  orb_map_level_free(c->ctx, &level);
  orb_corner_table_free(c->ctx, &s);
  return status;
}

orb_status orb_map_untwist(orb_map_run *c, double most_kept) {
  orb_map_twists twists;
  if (c->best_energy == c->twisted_energy) {
    return ORB_OK; /* this map has been tried */
  }
  ORB_TRY(find_twists(c, c->best, &twists));
  orb_status status = ORB_OK;
  if (twists.count > 0 && twists.kept <= most_kept) {
    c->twisted_energy = c->best_energy;
    orb_map_allow(c, c->params.work.untwist);
    status = untwist_limbs(c, &twists);
  }
  orb_map_twists_free(c->ctx, &twists);
  return status;
}
