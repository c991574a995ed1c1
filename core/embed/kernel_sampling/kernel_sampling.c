/* The driver: simplify, base mesh, insertion, intermittent optimisation (Algorithm 1).
 *
 * In: a mesh that orb_mesh_repair() accepted. Out: a unit vector for each vertex, not certified yet.
 *
 * Reading order of the folder: kernel_sampling.h (what differs from the paper and why), this file, mesh (the
 * progressive mesh), simplify (section 4), sample (Eq. 2 and 3 in double precision), search (the same in floats, for
 * speed).
 */
#include "embed/kernel_sampling/kernel_sampling.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/check.h"
#include "base/context.h"
#include "base/error.h"
#include "base/memory.h"
#include "embed/kernel_sampling/search.h"
#include "embed/kernel_sampling/simplify.h"
#include "numeric/predicates.h"
#include "numeric/vec3.h"

enum {
  MAX_RELIEF = 8,     /* how often the surroundings of a kernel too narrow for doubles are optimised, wider each time */
  RELIEF_SWEEPS = 20, /* over these surroundings */
  LOOSEN_RINGS = 2,   /* around a new vertex in a dense region */
  MAX_ATTEMPTS = 3,   /* of the whole, with growing effort; only meshes made to break the method need a second one */
  POLE = 100          /* least valence of a pole */
};

/* If the ring of a new vertex has less than the share `tight` of the area that the vertex stands for, its surroundings
 * get this many sweeps. */
static const struct effort {
  double tight;
  int32_t sweeps;
} EFFORTS[MAX_ATTEMPTS] = {{0.3, 3}, {0.5, 8}, {0.7, 20}};
static const double SPHERE_AREA = 4 * M_PI;

typedef struct orb_ks_run {
  orb_context *ctx;
  const orb_embed_options *options;
  struct effort effort;
  orb_ks_mesh m;
  orb_ks_sampler sampler;
  orb_kernel_room kernel_room;
  double *x;                                        /* positions, total area 4π */
  double *P;                                        /* the result: 3 per vertex */
  double *displacement;                             /* of each active vertex in the current iteration */
  int32_t *active, *next, active_count, next_count; /* vertices of this iteration, and of the next one */
  int32_t *stamp, stamp_value;
  int32_t *recent, recent_count; /* inserted since the last optimisation */
  int64_t iterations_sum, kernel_points_sum;
  int64_t unchecked; /* candidates evaluated since the last check for cancellation */
  orb_ks_report report;
} orb_ks_run;

/* Candidates between two checks for cancellation: a few milliseconds of work, however fine the steps of Eq. 2 are and
 * however large the rings. */
static const int64_t CHECK_AFTER = 40000;

static orb_status check_after(orb_ks_run *run, int32_t v) {
  run->unchecked += (int64_t)run->sampler.pair_count * run->m.valence[v];
  if (run->unchecked < CHECK_AFTER) {
    return ORB_OK;
  }
  run->unchecked = 0;
  return orb_context_check(run->ctx);
}

/* Scales the mesh to area 4π around its centre. A mesh without area is scaled to a diagonal of 1. */
static orb_status normalize(orb_ks_run *run, const orb_mesh *mesh) {
  orb_extent extent;
  orb_mesh_extent(mesh, &extent);
  run->x = ORB_NEW(run->ctx, double, 3 * (size_t)mesh->vertex_count);
  if (!run->x) {
    return ORB_E_NO_MEMORY;
  }
  double scale = extent.area > 0 && isfinite(extent.area) ? sqrt(SPHERE_AREA / extent.area)
                                                          : 1 / (extent.diagonal > 0 ? extent.diagonal : 1);
  for (int32_t v = 0; v < mesh->vertex_count; v++) {
    for (int k = 0; k < 3; k++) {
      double centre = 0.5 * extent.min[k] + 0.5 * extent.max[k];
      run->x[3 * (size_t)v + (size_t)k] = (mesh->positions[3 * (size_t)v + (size_t)k] - centre) * scale;
    }
  }
  return ORB_OK;
}

/* Section 5: rays from the centroid of the tetrahedron through its vertices; a regular one where that flips a face. */
static void place_base(orb_ks_run *run) {
  const orb_ks_mesh *m = &run->m;
  int32_t v[4], found = 0;
  for (int32_t i = 0; i < m->vertex_count && found < 4; i++) {
    if (m->valence[i]) {
      v[found++] = i;
    }
  }
  ORB_ASSERT(found == 4 && m->live == 4);
  int32_t face = m->out[v[0]];
  int32_t a = m->tri[face], b = orb_ks_head(m, face), c = m->tri[orb_prev(face)],
          d = v[0] + v[1] + v[2] + v[3] - a - b - c;
  const int32_t order[4] = {a, b, c, d};
  double centre[3] = {0, 0, 0};
  for (int i = 0; i < 4; i++) {
    for (int k = 0; k < 3; k++) {
      centre[k] += 0.25 * m->x[3 * (size_t)order[i] + (size_t)k];
    }
  }
  for (int i = 0; i < 4; i++) {
    double *p = run->P + 3 * (size_t)order[i];
    orb_sub(m->x + 3 * (size_t)order[i], centre, p);
    orb_normalize(p);
  }
  const double *P = run->P;
#define AT(i) (P + 3 * (size_t)order[i])
  int valid = orb_orient(AT(0), AT(1), AT(2)) > 0 && orb_orient(AT(0), AT(2), AT(3)) > 0 &&
              orb_orient(AT(0), AT(3), AT(1)) > 0 && orb_orient(AT(1), AT(3), AT(2)) > 0;
#undef AT
  if (!valid) {
    const double s = 1 / sqrt(3.0);
    const double regular[4][3] = {{s, s, s}, {-s, s, -s}, {s, -s, -s}, {-s, -s, s}};
    int swap = orb_orient(regular[0], regular[1], regular[2]) < 0;
    for (int i = 0; i < 4; i++) {
      int j = swap && i == 1 ? 2 : swap && i == 2 ? 1 : i;
      memcpy(run->P + 3 * (size_t)order[i], regular[j], sizeof regular[j]);
    }
  }
}

/* Moves v to its best sample if that is better than where it is; *moved: by how far. */
static orb_status reposition(orb_ks_run *run, int32_t v, double *moved) {
  double *p = run->P + 3 * (size_t)v, best[3], error;
  ORB_TRY(check_after(run, v));
  ORB_TRY(orb_ks_ring_load(run->ctx, &run->sampler, &run->m, run->P, v));
  *moved = 0;
  if (orb_ks_search(&run->sampler, p, 1, orb_ks_error_at(&run->sampler, p), best, &error)) {
    *moved = sqrt(orb_distance2(p, best));
    memcpy(p, best, sizeof best);
  }
  return ORB_OK;
}

typedef struct ranked {
  double key;
  int32_t vertex;
} ranked;

static int by_displacement(const void *a, const void *b) {
  const ranked *p = a, *q = b;
  return p->key != q->key ? (p->key > q->key ? -1 : 1) : (p->vertex > q->vertex) - (p->vertex < q->vertex);
}

static void enlist(orb_ks_run *run, int32_t v) {
  if (run->stamp[v] != run->stamp_value) {
    run->stamp[v] = run->stamp_value;
    run->next[run->next_count++] = v;
  }
}

/* The rings around a new vertex do not grow across a pole: its ring would be most of the mesh for each vertex beside
 * it. The pole itself is left to the global optimisation, because its own ring costs most. */
static int is_pole(const orb_ks_run *run, int32_t v) {
  return run->m.valence[v] >= POLE;
}

static void enlist_star(orb_ks_run *run, int32_t v) {
  enlist(run, v);
  int32_t e = run->m.out[v];
  do {
    enlist(run, orb_ks_head(&run->m, e));
    e = orb_ks_rotate(&run->m, e);
  } while (e != run->m.out[v]);
}

/* A vertex that takes no part in an iteration counts as unmoved in it. */
static void forget_displacements(orb_ks_run *run) {
  for (int32_t i = 0; i < run->active_count; i++) {
    run->displacement[run->active[i]] = 0;
  }
  run->active_count = 0;
}

/* Lines 4 and 11 to 13 of Algorithm 1: makes `next` active, ordered by falling displacement of the neighbours. */
static orb_status rank_next(orb_ks_run *run, int first) {
  ranked *order = ORB_NEW(run->ctx, ranked, run->next_count);
  if (!order) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t i = 0; i < run->next_count; i++) {
    int32_t v = run->next[i], e = run->m.out[v];
    order[i] = (ranked){0, v};
    do {
      order[i].key += run->displacement[orb_ks_head(&run->m, e)];
      e = orb_ks_rotate(&run->m, e);
    } while (e != run->m.out[v]);
  }
  if (!first) {
    qsort(order, (size_t)run->next_count, sizeof *order, by_displacement);
  }
  forget_displacements(run);
  for (int32_t i = 0; i < run->next_count; i++) {
    run->active[i] = order[i].vertex;
  }
  run->active_count = run->next_count;
  orb_free(run->ctx, order);
  return ORB_OK;
}

/* Algorithm 1, which starts with the recent vertices and their neighbours. */
static orb_status optimize(orb_ks_run *run) {
  double start = orb_clock(), most = INFINITY;
  int32_t iteration = 0;
  run->stamp_value++;
  run->next_count = 0;
  for (int32_t i = 0; i < run->recent_count; i++) {
    enlist_star(run, run->recent[i]);
  }
  run->recent_count = 0;
  for (; iteration < run->options->max_iterations && most > run->options->displacement_threshold; iteration++) {
    ORB_TRY(rank_next(run, iteration == 0));
    for (int32_t i = 0; i < run->active_count; i++) {
      ORB_TRY(reposition(run, run->active[i], &run->displacement[run->active[i]]));
    }
    most = 0;
    run->stamp_value++;
    run->next_count = 0;
    for (int32_t i = 0; i < run->active_count; i++) {
      double moved = run->displacement[run->active[i]];
      most = moved > most ? moved : most;
      if (moved > run->options->displacement_threshold) {
        enlist_star(run, run->active[i]);
      }
    }
  }
  forget_displacements(run);
  run->iterations_sum += iteration;
  run->report.executions++;
  run->report.optimize_seconds += orb_clock() - start;
  return ORB_OK;
}

/* Sections 5.1 and 5.2: the best sample in the fan of the parent, or else the kernel's centroid. The ring begins with
 * the parent. */
static orb_status place(orb_ks_run *run, int32_t v, int32_t parent, int *found) {
  orb_ks_sampler *s = &run->sampler;
  ORB_TRY(check_after(run, v));
  ORB_TRY(orb_ks_ring_load(run->ctx, s, &run->m, run->P, v));
  double error, *p = run->P + 3 * (size_t)v;
  const double *apex = run->P + 3 * (size_t)parent;
  *found = orb_ks_best_sample(s, apex, 1, s->ring.count - 1, 1, INFINITY, p, &error);
  if (!*found) {
    ORB_TRY(orb_kernel_point(run->ctx, &run->kernel_room, (const double(*)[3])s->ring.point, s->ring.count, p, found));
    run->report.clipped += *found;
  }
  return ORB_OK;
}

/* Enlists this many rings around the one enlisted vertex; skips poles unless `poles` is set. */
static void enlist_rings(orb_ks_run *run, int32_t rings, int poles) {
  for (int32_t r = 0; r < rings; r++) {
    for (int32_t i = 0, end = run->next_count; i < end; i++) {
      if (i == 0 || !is_pole(run, run->next[i])) {
        enlist_star(run, run->next[i]);
      }
    }
  }
  int32_t kept = 1;
  for (int32_t i = 1; i < run->next_count; i++) {
    run->next[kept] = run->next[i];
    kept += poles || !is_pole(run, run->next[i]);
  }
  run->next_count = kept;
}

/* Widens a kernel that doubles cannot hold: optimises the surroundings of the parent for area rather than shape. */
static orb_status relieve(orb_ks_run *run, int32_t parent, int32_t rings) {
  double aspect_exponent = run->sampler.aspect_exponent;
  run->sampler.aspect_exponent = aspect_exponent < 1 ? aspect_exponent : 1;
  run->stamp_value++;
  run->next_count = 0;
  enlist(run, parent);
  enlist_rings(run, rings, 1);
  orb_status status = ORB_OK;
  for (int32_t sweep = 0; sweep < RELIEF_SWEEPS && status == ORB_OK; sweep++) {
    for (int32_t i = 0; i < run->next_count && status == ORB_OK; i++) {
      double moved;
      status = reposition(run, run->next[i], &moved);
    }
  }
  run->sampler.aspect_exponent = aspect_exponent;
  run->report.relieved++;
  return status;
}

/* Sweeps over the rings around a new vertex in a dense region. Eq. 1 removes whole limbs one after another, so they
 * come back one after another too, and are squeezed by orders of magnitude long before the next global optimisation. */
static orb_status loosen(orb_ks_run *run, int32_t v) {
  run->stamp_value++;
  run->next_count = 0;
  enlist(run, v);
  enlist_rings(run, LOOSEN_RINGS, 0);
  for (int32_t sweep = 0; sweep < run->effort.sweeps; sweep++) {
    for (int32_t i = 0; i < run->next_count; i++) {
      double moved;
      ORB_TRY(reposition(run, run->next[i], &moved));
    }
  }
  run->report.loosened++;
  return ORB_OK;
}

static orb_status insert_vertex(orb_ks_run *run) {
  orb_ks_mesh *m = &run->m;
  int32_t parent = orb_ks_head(m, m->log[m->log_count - 1].edge), v;
  int found = 0;
  for (int32_t tries = 0;; tries++) {
    v = orb_ks_split_last(m);
    ORB_TRY(place(run, v, parent, &found));
    if (found) {
      break;
    }
    if (tries == MAX_RELIEF) {
      return orb_fail(
          run->ctx, ORB_E_NOT_CERTIFIED,
          "The kernel of a vertex is too narrow for double precision after %d of %d vertices; use the method "
          "newton, or other exponents.",
          m->live, m->vertex_count);
    }
    ORB_TRY(orb_ks_collapse_edge(run->ctx, m, m->out[v]));
    ORB_TRY(relieve(run, parent, 2 << tries));
  }
  run->kernel_points_sum += run->sampler.kernel_points;
  run->recent[run->recent_count++] = v;
  if (run->sampler.ring.fill < run->effort.tight) {
    return loosen(run, v);
  }
  return ORB_OK;
}

static orb_status refine(orb_ks_run *run) {
  orb_ks_mesh *m = &run->m;
  double interval = run->options->first_optimization;
  while (m->live < m->vertex_count) {
    int32_t until = interval < m->vertex_count - m->live ? m->live + (int32_t)interval : m->vertex_count;
    double start = orb_clock();
    while (m->live < until) {
      ORB_TRY(insert_vertex(run));
    }
    run->report.place_seconds += orb_clock() - start;
    ORB_TRY(optimize(run));
    if (run->report.trace) {
      run->report.trace(run->report.trace_user, m->live, run->report.place_seconds, run->report.optimize_seconds);
    }
    orb_progress(run->ctx, "embed", (double)m->live / m->vertex_count);
    interval *= run->options->growth;
  }
  return ORB_OK;
}

static void run_free(orb_ks_run *run) {
  orb_ks_mesh_free(run->ctx, &run->m);
  orb_ks_sampler_free(run->ctx, &run->sampler);
  orb_kernel_room_free(run->ctx, &run->kernel_room);
  orb_free(run->ctx, run->x);
  orb_free(run->ctx, run->displacement);
  orb_free(run->ctx, run->active);
  orb_free(run->ctx, run->next);
  orb_free(run->ctx, run->stamp);
  orb_free(run->ctx, run->recent);
}

static orb_status check_options(orb_context *ctx, const orb_embed_options *o) {
  if (!(o->step >= 0.01 && o->step <= 0.33)) {
    return orb_fail(ctx, ORB_E_BAD_OPTION, "step must be from 0.01 to 0.33 (the paper uses 0.11).");
  }
  if (!(o->area_exponent >= 0 && o->area_exponent <= 64) || !(o->aspect_exponent >= 0 && o->aspect_exponent <= 64)) {
    return orb_fail(ctx, ORB_E_BAD_OPTION, "area_exponent and aspect_exponent must be from 0 to 64.");
  }
  if (!(o->displacement_threshold >= 0) || o->max_iterations < 1 || o->first_optimization < 1 || !(o->growth >= 1.01) ||
      o->qem_until < 0) {
    return orb_fail(ctx, ORB_E_BAD_OPTION,
                    "displacement_threshold must be at least 0, max_iterations and first_optimization at least 1, "
                    "growth at least 1.01, qem_until at least 0.");
  }
  return ORB_OK;
}

static orb_status run_once(orb_ks_run *run, const orb_mesh *mesh) {
  orb_context *ctx = run->ctx;
  size_t n = (size_t)mesh->vertex_count;
  double start = orb_clock();
  ORB_TRY(normalize(run, mesh));
  ORB_TRY(orb_ks_mesh_create(ctx, mesh, run->x, &run->m));
  ORB_TRY(orb_ks_sampler_create(ctx, run->options, &run->sampler));
  run->displacement = ORB_NEW0(ctx, double, n);
  run->active = ORB_NEW(ctx, int32_t, n);
  run->next = ORB_NEW(ctx, int32_t, n);
  run->stamp = ORB_NEW0(ctx, int32_t, n);
  run->recent = ORB_NEW(ctx, int32_t, n);
  if (!run->displacement || !run->active || !run->next || !run->stamp || !run->recent) {
    return ORB_E_NO_MEMORY;
  }
  ORB_TRY(orb_ks_simplify(ctx, &run->m, run->options->qem_until));
  run->report.simplify_seconds += orb_clock() - start;
  place_base(run);
  ORB_TRY(refine(run));
  if (mesh->vertex_count > 4) {
    run->report.kernel_points = (double)run->kernel_points_sum / (mesh->vertex_count - 4);
  }
  if (run->report.executions) {
    run->report.iterations = (double)run->iterations_sum / run->report.executions;
  }
  return ORB_OK;
}

orb_status orb_kernel_sampling(orb_context *ctx, const orb_mesh *mesh, const orb_embed_options *options, double *points,
                               orb_ks_report *report) {
  ORB_TRY(check_options(ctx, options));
  orb_ks_report sum = {0};
  if (report) {
    sum.trace = report->trace;
    sum.trace_user = report->trace_user;
  }
  orb_status status = ORB_E_NOT_CERTIFIED;
  for (int attempt = 0; attempt < MAX_ATTEMPTS && status == ORB_E_NOT_CERTIFIED; attempt++) {
    orb_ks_run run = {.ctx = ctx, .options = options, .P = points, .effort = EFFORTS[attempt], .report = sum};
    run.report.attempts = attempt + 1;
    orb_error_clear(ctx);
    status = run_once(&run, mesh);
    sum = run.report;
    run_free(&run);
  }
  if (report) {
    *report = sum;
  }
  return status;
}
