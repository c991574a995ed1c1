/* The parts of a run are in the order in which it goes through them. */
#include "align/map/whole.h"

#include <math.h>
#include <string.h>

#include "align/map/space/part.h"
#include "align/map/space/slide.h"
#include "align/map/starts/landmark_walk.h"
#include "base/check.h"
#include "base/memory.h"
#include "base/tasks.h"

void orb_map_run_free(orb_map_run *c) {
  orb_context *ctx = c->ctx;
  orb_map_surface_free(ctx, &c->b);
  orb_map_packed_free(ctx, &c->packed);
  orb_free(ctx, c->x);
  orb_free(ctx, c->normal);
  orb_free(ctx, c->target);
  orb_free(ctx, c->target_normal);
  orb_free(ctx, c->target_place);
  orb_free(ctx, c->doubted);
  orb_free(ctx, c->keep);
  orb_free(ctx, c->usable);
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

static orb_status prepare_moving(orb_context *ctx, orb_map_run *c) {
  const orb_mesh *mesh = &c->moving->mesh;
  const size_t n = (size_t)mesh->vertex_count;
  c->vertex_count = mesh->vertex_count;
  c->x = ORB_NEW(ctx, double, 3 * n);
  c->normal = ORB_NEW(ctx, double, 3 * n);
  c->keep = ORB_NEW0(ctx, unsigned char, n);
  c->usable = ORB_NEW0(ctx, unsigned char, n);
  c->position = ORB_NEW(ctx, double, 3 * n);
  c->local = ORB_NEW(ctx, int32_t, n);
  c->place = ORB_NEW0(ctx, orb_place, n);
  c->start = ORB_NEW(ctx, double, 3 * n);
  c->best = ORB_NEW(ctx, double, 3 * n);
  c->target = ORB_NEW(ctx, double, 3 * n);
  c->target_normal = ORB_NEW(ctx, double, 3 * n);
  c->target_place = ORB_NEW(ctx, orb_place, n);
  c->doubted = ORB_NEW0(ctx, unsigned char, n);
  if (!c->x || !c->normal || !c->keep || !c->usable || !c->position || !c->local || !c->place || !c->start ||
      !c->best || !c->target || !c->target_normal || !c->target_place || !c->doubted) {
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

static orb_status prepare_one(orb_context *ctx, void *arg, int32_t s) {
  orb_map_run *c = arg;
  return s == 0 ? orb_map_surface_create(ctx, c->fixed, &c->b) : prepare_moving(ctx, c);
}

orb_status orb_map_run_prepare(orb_map_run *c) {
  return orb_tasks_run(c->ctx, 2, prepare_one, c);
}

/* A run of these two shapes. */
orb_map_run orb_map_run_of(orb_context *ctx, orb_aligned_shape *fixed, orb_aligned_shape *moving, int both,
                           int32_t landmark_count, const orb_map_guide *guide, orb_preset preset) {
  const orb_map_params params = orb_map_params_of(preset);
  return (orb_map_run){.ctx = ctx,
                       .params = params,
                       .fixed = fixed,
                       .moving = moving,
                       .both = both,
                       .landmark_count = landmark_count,
                       .given_target = guide->target,
                       .keeps_angles = guide->keeps_angles,
                       .slides = guide->slides,
                       .may_fit_parts = guide->fits_parts,
                       .beat = guide->beat,
                       .rival = guide->rival,
                       .wants_course = guide->course && guide->target,
                       .walks_first = guide->walks_first && both,
                       .walks_early = guide->walks_early && both,
                       .springs = guide->springs,
                       .hopeless_flips = params.clear.hopeless,
                       .passes = params.work.passes,
                       .work = params.work.all * (int64_t)moving->mesh.vertex_count,
                       .hopeless = INFINITY,
                       .crumpled = INFINITY,
                       .settled = INFINITY,
                       .twisted_energy = INFINITY};
}

/* What a run that opens finds out, side by side. */
typedef struct opening {
  orb_map_run *run;
  orb_map_run measured, paired; /* the run as it is before, for each of two tasks */
  const orb_map_guide *guide;
  double energy; /* of the map as given */
} opening;

enum { OPEN_TARGET, OPEN_PACKED, OPEN_ENERGY, OPEN_PAIRS, OPENINGS }; /* the longest comes first */

/* Mirror landmarks would hold what targets determine better, and what a finished map has or must let go. */
static int may_mirror(const orb_map_guide *guide) {
  const orb_map_from from = guide->from;
  return !guide->target && (from == ORB_MAP_FROM_SPACE || from == ORB_MAP_FROM_MAP || from == ORB_MAP_FROM_WALK);
}

static orb_status open_one(orb_context *ctx, void *arg, int32_t what) {
  opening *o = arg;
  orb_map_run *c = o->run;
  const orb_map_aim *aim = &o->guide->aim;
  if (what == OPEN_TARGET) {
    return aim->fill ? aim->fill(ctx, aim->user) : ORB_OK;
  }
  if (what == OPEN_PACKED) {
    return orb_map_packed_create(ctx, &c->fixed->mesh, &c->b, &c->packed);
  }
  if (what == OPEN_PAIRS) {
    o->paired.ctx = ctx;
    return orb_map_pairs_create(&o->paired, may_mirror(o->guide));
  }
  o->measured.ctx = ctx;
  return o->guide->from == ORB_MAP_FROM_COPY
             ? ORB_OK
             : orb_map_energy_of(&o->measured, o->measured.moving->points, o->measured.params.energy.cap, &o->energy);
}

/* Measures the map as given, finds the pairs and fills the target. energy: as of orb_compose(), both of the map as
 * given. */
orb_status orb_map_run_open(orb_map_run *c, const orb_map_guide *guide, double energy[2]) {
  const orb_aligned_shape *moving = c->moving;
  ORB_TRY(orb_map_run_prepare(c));
  opening o = {c, *c, *c, guide, INFINITY};
  const orb_status status = orb_tasks_run(c->ctx, OPENINGS, open_one, &o);
  c->pairs = o.paired.pairs;
  ORB_TRY(status);
  energy[0] = o.energy;
  memcpy(c->best, moving->points, 3 * (size_t)moving->mesh.vertex_count * sizeof *c->best);
  c->best_energy = energy[0];
  if ((guide->target && c->pairs.landmarks > 0) /* the landmarks are apart */ || guide->from == ORB_MAP_FROM_SPRINGS) {
    energy[0] = c->best_energy = INFINITY;
  }
  energy[1] = energy[0];
  return ORB_OK;
}

int orb_map_run_is_hopeless(const orb_map_run *c) {
  return c->course.is_beaten || (c->given_target && c->best_energy > c->params.targets.hopeless);
}

/* Should the map slide? Not if it is an isometry. Otherwise yes, if it is not poor, or begins with targets on spheres
 * that keep angles. A
 * slide ends where shapes do not fit: of 42 maps of animals of other kinds with landmarks, it changes one, and takes a
 * fifth off its error. A poor landmark walk stays; so does a walk that came first because the shapes bend much: of 14
 * such pairs and 20 of animals, none fitted in space. */
static int should_slide(const orb_map_run *c, orb_map_from from) {
  if ((c->walks_first && c->course.is_walked) || c->best_energy <= c->params.slide.least) {
    return 0;
  }
  return (c->given_target || c->slides || from == ORB_MAP_FROM_WALK) &&
         (c->best_energy <= c->params.energy.poor || (c->given_target && c->keeps_angles));
}

/* Draws the map to where parts of the shapes fit in space, or slides where that may help. before: the energy of the map
 * as given. */
orb_status orb_map_run_fit(orb_map_run *c, orb_map_from from, double before) {
  orb_map_part part = ORB_MAP_NO_PART;
  if (c->may_fit_parts) {
    ORB_TRY(orb_map_find_part(c->ctx, &c->params, c->fixed, c->moving, c->landmark_count, &part));
  }
  if (part != ORB_MAP_NO_PART) {
    ORB_TRY(orb_map_fit_part(c, part));
  }
  return !c->course.fits_part && should_slide(c, from) ? orb_map_slide(c, before) : ORB_OK;
}

/* Writes the best map back if it is better than the alignment as given, or fits parts, and is certified. */
orb_status orb_map_run_take(orb_map_run *c, orb_aligned_shape *fixed, double energy[2], int *improved) {
  orb_aligned_shape *shapes[2] = {c->moving, fixed};
  orb_map_candidate best = {c->best, c->fixed_points, c->best_energy};
  orb_certificate certificate[2] = {{.valid = 1}, {.valid = 1}};
  best = c->kept.points && c->kept.energy <= best.energy ? c->kept : best;
  const double *points[2] = {best.points, best.fixed};
  if (!c->course.fits_part && !(best.energy < energy[0])) {
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
