/* The composed map.
 *
 * Embeddings that are each optimal by themselves do not correspond: what decides how a morph looks is the map from one
 * shape straight to the other. So the fixed shape's embedding is kept, and the moving one is decimated (its landmarks
 * stay) and refined anew, with every vertex holding a place on the fixed shape and moving there by Newton steps of the
 * composed symmetric Dirichlet energy (compose_step.c). Of two shapes the one moves whose triangles follow the other.
 *
 * The landmarks are joined by guesses: their mirror images, where both shapes are symmetric (compose_mirror.c); these
 * hold likewise, unless a start comes near to a map with them and to a better one without. There are three kinds of
 * starts. The shape bent onto the other in space (compose_targets.c) is good where it folds little; flips on the sphere
 * are then allowed against a growing barrier until local untangling clears them all; what is sound of one that nearly
 * came to a map is used (compose_near.c). A map walked to on the sphere by the landmarks, the guesses and some samples
 * of the bent shape (compose_walk.c) has no flips to begin with. The best map so far, drawn to the targets. From a
 * start on the level is refined up to all vertices, and no flip is allowed again. The map of least energy wins, if it
 * is better than the alignment as given. Limbs that it has twisted about their axes are turned back (compose_unwind.c)
 * before it is bent again, and in the end.
 */
#include "align/map/compose.h"

#include <math.h>
#include <string.h>

#include "align/map/engine/full_level.h"
#include "align/map/engine/near.h"
#include "align/map/engine/rounds.h"
#include "align/map/engine/step.h"
#include "align/map/starts/landmark_walk.h"
#include "align/map/starts/place.h"
#include "align/map/twist/untwist.h"
#include "base/check.h"
#include "base/context.h"
#include "base/memory.h"
#include "embed/place.h"
#include "numeric/vec3.h"

enum {
  FIRST_LEVEL = 8000,  /* vertices at which a start begins */
  DRAWN_LEVEL = 16000, /* and one from a map without flips, which a coarser level would fold */
  LAST_START = 60000,  /* and beyond which it gives up untangling */
  HOPELESS = 9,        /* one flip in so many triangles: they will not be cleared */
  SOFT_ROUNDS = 8,
  ROUGH_SWEEPS = 40,
  GIVEN_UP_WORK = 90, /* what a start would take, not left to others: draws that go on for longer gain nothing */
  WORK = 550,         /* vertex steps a vertex, see orb_map_run.work */
  UNWOUND_WORK = 250  /* that bends have at least after an unwinding that helped */
};

/* A guess of so many times the best map's energy, bent after that map, comes to no better one. */
static const double FAR_ABOVE = 1.5;
/* A rough map from this energy on, with no more of the area left halfway of a morph: limbs are turned back at once. */
static const double WOUND = 2, WOUND_KEPT = 0.9;
static const double WORSE = 2, FOLLOWS = 1e-3; /* of the triangles turned over, either way: reason to swap the shapes */

static orb_map_effort effort_of(orb_preset preset) {
  return preset == ORB_PRESET_QUALITY ? (orb_map_effort){1.3, 300, 120, 80, 120}
                                      : (orb_map_effort){1.5, 150, 60, 40, 60};
}

static void orb_map_run_free(orb_map_run *c) {
  orb_context *ctx = c->ctx;
  orb_map_surface_free(ctx, &c->b);
  orb_map_packed_free(ctx, &c->packed);
  orb_free(ctx, c->x);
  orb_free(ctx, c->normal);
  orb_free(ctx, c->goal);
  orb_free(ctx, c->goal_normal);
  orb_free(ctx, c->goal_place);
  orb_free(ctx, c->keep);
  orb_free(ctx, c->sound);
  orb_hierarchy_destroy(ctx, c->hierarchy);
  orb_free(ctx, c->position);
  orb_free(ctx, c->local);
  orb_free(ctx, c->place);
  orb_free(ctx, c->start);
  orb_free(ctx, c->best);
  orb_free(ctx, c->fixed_points);
  orb_free(ctx, c->kept.points);
  orb_free(ctx, c->kept.fixed);
  orb_free(ctx, c->pairs.moving);
  orb_free(ctx, c->pairs.fixed);
}

static orb_status prepare(orb_map_run *c) {
  orb_context *ctx = c->ctx;
  const orb_mesh *mesh = &c->moving->mesh;
  size_t n = (size_t)mesh->vertex_count;
  c->vertex_count = mesh->vertex_count;
  ORB_TRY(orb_map_surface_create(ctx, c->fixed, &c->b));
  ORB_TRY(orb_map_packed_create(ctx, &c->fixed->mesh, &c->b, &c->packed));
  c->x = ORB_NEW(ctx, double, 3 * n);
  c->normal = ORB_NEW(ctx, double, 3 * n);
  c->keep = ORB_NEW0(ctx, unsigned char, n);
  c->sound = ORB_NEW0(ctx, unsigned char, n);
  c->position = ORB_NEW(ctx, double, 3 * n);
  c->local = ORB_NEW(ctx, int32_t, n);
  c->place = ORB_NEW0(ctx, orb_place, n);
  c->start = ORB_NEW(ctx, double, 3 * n);
  c->best = ORB_NEW(ctx, double, 3 * n);
  c->goal = ORB_NEW(ctx, double, 3 * n);
  c->goal_normal = ORB_NEW(ctx, double, 3 * n);
  c->goal_place = ORB_NEW(ctx, orb_place, n);
  if (!c->x || !c->normal || !c->keep || !c->sound || !c->position || !c->local || !c->place || !c->start || !c->best ||
      !c->goal || !c->goal_normal || !c->goal_place) {
    return ORB_E_NO_MEMORY;
  }
  orb_extent extent;
  orb_mesh_extent(mesh, &extent);
  double scale = extent.area > 0 ? sqrt(4 * M_PI / extent.area) : 1;
  for (size_t i = 0; i < 3 * n; i++) {
    c->x[i] = (mesh->positions[i] - 0.5 * extent.min[i % 3] - 0.5 * extent.max[i % 3]) * scale;
  }
  orb_map_normals(c->x, mesh->vertex_count, mesh->triangles, mesh->triangle_count, c->normal);
  memcpy(c->start, c->moving->points, 3 * n * sizeof *c->start);
  return ORB_OK;
}

/* The levels, in which the vertices of all pairs stay, with the pairs meeting in c->start. */
static orb_status prepare_levels(orb_map_run *c) {
  memset(c->keep, 0, (size_t)c->vertex_count);
  for (int32_t i = 0; i < c->pairs.count; i++) {
    int32_t v = c->pairs.moving[i];
    c->keep[v] = 1;
    memcpy(c->start + 3 * (size_t)v, c->b.s + 3 * (size_t)c->pairs.fixed[i], sizeof(double[3]));
  }
  int32_t keep_until = c->pairs.count ? (4 * c->pairs.count > 300 ? 4 * c->pairs.count : 300) : 4;
  orb_hierarchy_destroy(c->ctx, c->hierarchy);
  c->hierarchy = NULL;
  ORB_TRY(orb_hierarchy_create(c->ctx, &c->moving->mesh, c->keep, keep_until, &c->hierarchy));
  for (int32_t v = 0; v < c->vertex_count; v++) {
    memcpy(c->position + 3 * (size_t)v, c->x + 3 * (size_t)c->hierarchy->surface.to_mesh[v], sizeof(double[3]));
  }
  return ORB_OK;
}

/* Writes a level back into the refiner and the places of its vertices. */
static void store_level(orb_map_run *c, const orb_map_level *l, orb_refiner *r) {
  for (int32_t v = 0; v < l->count; v++) {
    memcpy(r->point + 4 * (size_t)l->vertex[v], l->x + 3 * (size_t)v, sizeof(double[3]));
    c->place[l->vertex[v]] = l->place[v];
  }
}

/* A level of the vertices that live now, with the places of those that lived before; new ones are located. */
static orb_status load_level(orb_map_run *c, const orb_refiner *r, const unsigned char *known, orb_map_level *l) {
  ORB_TRY(orb_map_level_create(c->ctx, &c->hierarchy->surface, r->alive, r->pinned, c->position, r->live, c->local, l));
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

/* From a level without flips up to all vertices. rough: only so far that samples of the map are of use. */
static orb_status refine(orb_map_run *c, orb_refiner *r, orb_map_level *l, double pull, int rough, int *failed) {
  const int32_t *to_mesh = c->hierarchy->surface.to_mesh;
  const orb_map_rules hard = orb_map_hard();
  unsigned char *known = ORB_NEW(c->ctx, unsigned char, c->vertex_count);
  orb_status status = known ? ORB_OK : ORB_E_NO_MEMORY;
  int first = 1;
  while (status == ORB_OK) {
    int last = r->live == c->vertex_count;
    orb_map_set_pull(c, l, to_mesh, last ? 0 : pull);
    pull *= 0.5;
    int count = last             ? c->effort.final_sweeps
                : first          ? c->effort.first_sweeps
                : r->live < 3000 ? c->effort.coarse_sweeps
                                 : c->effort.level_sweeps;
    first = 0;
    if (rough) {
      ORB_GO(status, orb_map_sweeps(c, l, hard, count < ROUGH_SWEEPS ? count : ROUGH_SWEEPS), done);
    } else {
      ORB_GO(status, orb_map_sweeps(c, l, hard, count), done);
      ORB_GO(status, orb_map_loosen(c, l, count / 2, count / 2), done);
    }
    *failed = orb_map_level_flips(l) > 0;
    if (*failed) {
      break;
    }
    store_level(c, l, r);
    if (last) {
      break;
    }
    memcpy(known, r->alive, (size_t)c->vertex_count);
    double target = c->effort.growth * r->live;
    target = target > c->vertex_count / 1.2 ? c->vertex_count : target;
    while (r->live < c->vertex_count && r->live < target) {
      ORB_GO(status, orb_refiner_undo_round(c->ctx, r, r->settings.blend), done);
    }
    orb_map_level_free(c->ctx, l);
    ORB_GO(status, load_level(c, r, known, l), done);
    for (int32_t v = 0; v < l->count; v++) {
      if (pull > 0) {
        (void)orb_map_level_try(l, &c->b, &hard, v, &c->goal_place[to_mesh[l->vertex[v]]]);
      }
      for (int i = 0; i < 3 && !known[l->vertex[v]]; i++) {
        orb_map_level_step(l, &c->b, &hard, v);
      }
    }
    orb_progress(c->ctx, "align", (double)r->live / c->vertex_count);
  }
done:
  orb_free(c->ctx, known);
  return status;
}

/* Runs one start; keeps its points if they are the best so far. */
static orb_status run_start(orb_map_run *c, orb_map_start start) {
  orb_context *ctx = c->ctx;
  orb_embed_options options;
  orb_embed_defaults(&options);
  orb_refiner *r = NULL;
  orb_map_level level = {0};
  int32_t flips = 1;
  int failed = 0;
  orb_status status;
  ORB_GO(status, orb_refiner_create(ctx, c->hierarchy, &options, &r), done);
  r->settings.crowded = INFINITY;
  const int32_t *to_mesh = c->hierarchy->surface.to_mesh;
  for (int32_t want = start == ORB_MAP_SPATIAL ? FIRST_LEVEL : DRAWN_LEVEL; flips;) {
    ORB_GO(status, orb_refiner_skip(ctx, r, want < c->vertex_count ? want : c->vertex_count), done);
    for (int32_t v = 0; v < c->vertex_count; v++) {
      r->pinned[v] = c->keep[to_mesh[v]];
    }
    orb_map_level_free(ctx, &level);
    ORB_GO(
        status,
        orb_map_level_create(ctx, &c->hierarchy->surface, r->alive, r->pinned, c->position, r->live, c->local, &level),
        done);
    orb_map_place(c, &level, to_mesh, start);
    orb_map_set_pull(c, &level, to_mesh, start == ORB_MAP_SPATIAL ? 1 : 0);
    flips = orb_map_level_flips(&level);
    if (flips <= level.triangle_count / HOPELESS) {
      if (orb_map_level_energy(&level) > c->hopeless) {
        c->work -= GIVEN_UP_WORK * (int64_t)c->vertex_count;
        goto done;
      }
      ORB_GO(status, orb_map_clear_flips(c, &level, SOFT_ROUNDS, &flips), done);
    }
    int last = r->live == c->vertex_count || r->live > LAST_START;
    if (flips && last && start == ORB_MAP_SPATIAL && c->pairs.count > 0 && orb_map_is_near(&level, flips)) {
      ORB_GO(status, orb_map_keep_sound(c, &level, to_mesh), done);
      ORB_GO(status, orb_map_release(c, &level, to_mesh, &flips), done);
    }
    if (flips && (last || flips > level.triangle_count / HOPELESS)) {
      goto done; /* this guess leads nowhere: not an error, another one or the given alignment stays */
    }
    for (int32_t v = 0; v < c->vertex_count && flips; v++) {
      r->pinned[v] = 0;
    }
    want = r->live * 2;
  }
  if (start == ORB_MAP_DRAWN) {
    ORB_GO(status, orb_map_draw(c, &level, to_mesh), done);
  }
  store_level(c, &level, r);
  ORB_GO(status, refine(c, r, &level, start == ORB_MAP_GIVEN ? 0 : 0.5, start == ORB_MAP_GIVEN && c->rough, &failed),
         done);
  if (!failed) {
    double energy = orb_map_level_energy(&level);
    if (energy < c->best_energy) {
      c->best_energy = energy;
      orb_refiner_points(r, c->best);
    }
  }
done:
  orb_map_level_free(ctx, &level);
  orb_refiner_destroy(ctx, r);
  return status;
}

/* The composed energy of the alignment as it was given. */
static orb_status given_energy(orb_map_run *c, double *energy) {
  orb_corner_table s;
  orb_map_level level = {0};
  ORB_TRY(orb_corner_table_create(c->ctx, &c->moving->mesh, &s));
  orb_status status = orb_map_full_level(c, c->moving->points, &s, &level);
  if (status == ORB_OK) {
    *energy = orb_map_level_energy(&level);
  }
  orb_map_level_free(c->ctx, &level);
  orb_corner_table_free(c->ctx, &s);
  return status;
}

/* Walks to a map in which all pairs meet: by way of samples, of few, of none. */
static orb_status walk_pairs(orb_map_run *c, int *stuck) {
  static const int32_t samples[] = {ORB_MAP_SOUND_STEPS, ORB_MAP_STEPS, 0};
  *stuck = 1;
  for (int i = c->has_sound ? 0 : 1; i < 3 && c->pairs.count > 0 && *stuck; i++) {
    ORB_TRY(orb_map_landmark_walk(c, samples[i], stuck));
  }
  return ORB_OK;
}

/* Before the starts that need a map in which all pairs meet: one is walked to, or the guesses are given up. */
static orb_status meet_pairs(orb_map_run *c) {
  int stuck;
  ORB_TRY(walk_pairs(c, &stuck));
  if (!stuck || c->pairs.count == c->pairs.landmarks) {
    return ORB_OK;
  }
  c->pairs.count = c->pairs.landmarks;
  if (c->has_sound) {
    ORB_TRY(walk_pairs(c, &stuck));
  }
  if (stuck) {
    memcpy(c->start, c->moving->points, 3 * (size_t)c->vertex_count * sizeof *c->start);
  }
  ORB_TRY(orb_map_register(c, 0));
  return prepare_levels(c);
}

/* Twisted limbs are turned back before the best map is bent again: targets that follow twists keep them. What the
 * bends are for then is new, so there is some work for them. */
static orb_status unwind_early(orb_map_run *c, double most_kept) {
  double twisted = c->best_energy;
  int64_t least = UNWOUND_WORK * (int64_t)c->vertex_count;
  ORB_TRY(orb_map_untwist(c, most_kept));
  c->work = c->best_energy < twisted && c->work < least ? least : c->work;
  return ORB_OK;
}

/* A rough map of much energy that is thin halfway has limbs that are wound: drawn to its targets it folds, and samples
 * of it are wound too. So limbs are turned back before it is drawn. If that does not help, it has cost the draws
 * nothing. */
static orb_status unwind_first(orb_map_run *c) {
  double before = c->best_energy;
  int64_t work = c->work;
  if (before <= WOUND) {
    return ORB_OK;
  }
  ORB_TRY(unwind_early(c, WOUND_KEPT));
  c->work = c->best_energy < before ? c->work : work;
  return ORB_OK;
}

/* A spatial start that nearly came to a map, and one more without the guesses: a guess that lies a little beside its
 * true place folds what the landmarks alone do not. If that leads to nothing better, all is as it was before. */
static orb_status start_without_guesses(orb_map_run *c) {
  orb_context *ctx = c->ctx;
  size_t n = (size_t)c->vertex_count;
  int32_t count = c->pairs.count;
  double before = c->best_energy;
  unsigned char *sound = ORB_NEW(ctx, unsigned char, n);
  orb_place *place = ORB_NEW(ctx, orb_place, n);
  orb_status status = sound && place ? ORB_OK : ORB_E_NO_MEMORY;
  if (status != ORB_OK) {
    goto done;
  }
  memcpy(sound, c->sound, n);
  memcpy(place, c->goal_place, n * sizeof *place);
  c->pairs.count = c->pairs.landmarks;
  ORB_GO(status, orb_map_register(c, 0), done);
  ORB_GO(status, prepare_levels(c), done);
  ORB_GO(status, run_start(c, ORB_MAP_SPATIAL), done);
  if (c->best_energy < before) {
    goto done; /* the guesses stay away */
  }
  c->pairs.count = count;
  ORB_GO(status, orb_map_register(c, 0), done);
  ORB_GO(status, prepare_levels(c), done);
  memcpy(c->sound, sound, n);
  memcpy(c->goal_place, place, n * sizeof *place);
  c->has_sound = 1;
done:
  orb_free(ctx, sound);
  orb_free(ctx, place);
  return status;
}

/* The starts, until nothing comes of them any more. */
static orb_status run_starts(orb_map_run *c, orb_map_from from, orb_preset preset) {
  if (from == ORB_MAP_MAP_ONLY) {
    return run_start(c, ORB_MAP_GIVEN);
  }
  if (c->pairs.landmarks == 0 && c->best_energy <= ORB_MAP_GOOD_ENERGY) {
    /* A good map is not given up for another, of a symmetric shape say, that is as good. */
    return run_start(c, ORB_MAP_GIVEN);
  }
  if (from != ORB_MAP_SPACE_DONE) {
    ORB_TRY(run_start(c, ORB_MAP_SPATIAL));
    if (c->has_sound && c->pairs.count > c->pairs.landmarks && c->best_energy > ORB_MAP_GOOD_ENERGY) {
      ORB_TRY(start_without_guesses(c));
    }
  }
  if (from == ORB_MAP_SPACE_ONLY || (preset != ORB_PRESET_QUALITY && c->best_energy <= ORB_MAP_GOOD_ENERGY)) {
    return ORB_OK;
  }
  ORB_TRY(meet_pairs(c));
  ORB_TRY(run_start(c, ORB_MAP_GIVEN)); /* without flips and cheap, and the better it is the further the others get */
  ORB_TRY(unwind_first(c));
  ORB_TRY(run_start(c, ORB_MAP_DRAWN));
  ORB_TRY(unwind_early(c, INFINITY));
  double last = INFINITY;
  while (c->best_energy < 0.99 * last && c->passes-- > 0 && c->work > 0) {
    last = c->best_energy;
    ORB_TRY(orb_map_register(c, ORB_MAP_SAMPLES));
    c->hopeless = FAR_ABOVE * c->best_energy;
    ORB_TRY(run_start(c, ORB_MAP_SPATIAL));
    c->hopeless = INFINITY;
    if (!(c->best_energy < last)) {
      ORB_TRY(run_start(c, ORB_MAP_DRAWN));
    }
  }
  return ORB_OK;
}

/* Writes the best map back if it is better than what was given and certified. */
static orb_status take_best(orb_map_run *c, orb_aligned_shape *fixed, double energy[2], int *improved) {
  orb_aligned_shape *shapes[2] = {c->moving, fixed};
  orb_map_candidate best = {c->best, c->fixed_points, c->best_energy};
  orb_certificate certificate[2] = {{.valid = 1}, {.valid = 1}};
  best = c->kept.points && c->kept.energy <= best.energy ? c->kept : best;
  const double *points[2] = {best.points, best.fixed};
  if (!(best.energy < energy[0])) {
    return ORB_OK;
  }
  for (int s = 0; s < 2; s++) {
    const orb_mesh *mesh = &shapes[s]->mesh;
    if (points[s]) {
      ORB_TRY(
          orb_certify(c->ctx, points[s], mesh->vertex_count, mesh->triangles, mesh->triangle_count, &certificate[s]));
    }
  }
  *improved = certificate[0].valid && certificate[1].valid;
  for (int s = 0; s < 2 && *improved; s++) {
    if (points[s]) {
      memcpy(shapes[s]->points, points[s], 3 * (size_t)shapes[s]->mesh.vertex_count * sizeof *points[s]);
      shapes[s]->certificate = certificate[s];
      energy[1] = best.energy;
    }
  }
  return ORB_OK;
}

/* The share of a shape's triangles whose images on another turn against its normals. */
static orb_status turned_share(orb_context *ctx, const orb_aligned_shape *from, const orb_aligned_shape *to,
                               double *share) {
  const orb_mesh *mesh = &from->mesh;
  orb_map_surface b;
  int32_t turned = 0;
  ORB_TRY(orb_map_surface_create(ctx, to, &b));
  double *image = ORB_NEW(ctx, double, 6 * (size_t)mesh->vertex_count);
  orb_status status = image ? ORB_OK : ORB_E_NO_MEMORY;
  orb_place place = {.triangle = -1};
  for (int32_t v = 0; v < mesh->vertex_count && status == ORB_OK; v++) {
    double *y = image + 6 * (size_t)v;
    orb_locate(b.locator, from->points + 3 * (size_t)v, place.triangle, &place);
    orb_map_surface_at(&b, &place, y, NULL, y + 3);
    status = (v & 4095) == 4095 ? orb_context_check(ctx) : ORB_OK;
  }
  for (int32_t t = 0; t < mesh->triangle_count && status == ORB_OK; t++) {
    const int32_t *v = mesh->triangles + 3 * (size_t)t;
    const double *p = image + 6 * (size_t)v[0], *q = image + 6 * (size_t)v[1], *r = image + 6 * (size_t)v[2];
    double u[3], w[3], n[3];
    orb_sub(q, p, u);
    orb_sub(r, p, w);
    orb_cross(u, w, n);
    turned += orb_dot(n, p + 3) + orb_dot(n, q + 3) + orb_dot(n, r + 3) < 0;
  }
  *share = (double)turned / mesh->triangle_count;
  orb_free(ctx, image);
  orb_map_surface_free(ctx, &b);
  return status;
}

/* Whether the shapes should change places: triangles that are to move must be able to follow the other surface. Where
 * it has a limb that the moving shape has hardly a triangle for, their images turn over. */
static orb_status should_swap(orb_context *ctx, const orb_aligned_shape *fixed, const orb_aligned_shape *moving,
                              int *swap) {
  double here, there;
  ORB_TRY(turned_share(ctx, moving, fixed, &here));
  ORB_TRY(turned_share(ctx, fixed, moving, &there));
  *swap = here > FOLLOWS + WORSE * there;
  return ORB_OK;
}

orb_status orb_compose(orb_context *ctx, orb_aligned_shape *fixed, orb_aligned_shape *moving, int both,
                       int32_t landmark_count, orb_map_from from, orb_preset preset, double energy[2], int *improved) {
  int swap = 0;
  *improved = 0;
  if (both) {
    ORB_TRY(should_swap(ctx, fixed, moving, &swap));
  }
  if (swap) {
    orb_aligned_shape *other = fixed;
    fixed = moving;
    moving = other;
  }
  orb_map_run c = {.ctx = ctx,
                   .fixed = fixed,
                   .moving = moving,
                   .both = both,
                   .landmark_count = landmark_count,
                   .hopeless = INFINITY,
                   .twisted_energy = INFINITY,
                   .effort = effort_of(preset)};
  c.passes = preset == ORB_PRESET_QUALITY ? 6 : 3;
  c.rough = preset != ORB_PRESET_QUALITY;
  c.work = (preset == ORB_PRESET_QUALITY ? 5000 : WORK) * (int64_t)moving->mesh.vertex_count;
  c.work = from == ORB_MAP_SPACE_DONE ? c.work / 2 : c.work; /* the rest is spent */
  orb_status status;
  ORB_GO(status, prepare(&c), done);
  ORB_GO(status, given_energy(&c, &energy[0]), done);
  energy[1] = c.best_energy = energy[0];
  memcpy(c.best, moving->points, 3 * (size_t)moving->mesh.vertex_count * sizeof *c.best);
  ORB_GO(status, orb_map_pairs_create(&c), done);
  if (from != ORB_MAP_MAP_ONLY) {
    ORB_GO(status, orb_map_register(&c, from == ORB_MAP_FROM_MAP ? ORB_MAP_SAMPLES : 0), done);
  }
  ORB_GO(status, prepare_levels(&c), done);
  ORB_GO(status, run_starts(&c, from, preset), done);
  if (from != ORB_MAP_MAP_ONLY) {
    ORB_GO(status, orb_map_untwist(&c, INFINITY), done);
  }
  status = take_best(&c, fixed, energy, improved);
done:
  orb_map_run_free(&c);
  return status;
}
