/* Starts from the overlay of the shapes, for maps along which edge splits would creep without end.
 *
 * Where the map is twisted, for example by landmarks that lie in another order on each shape, the overlay has a hundred
 * times the triangles of the shapes, most of them far smaller than the tolerance requires. Each shape is then first
 * reduced alone, within the tolerance, and the reduced shapes are overlaid: the number of crossings falls with the
 * number of edges of both. The result is linear on both reduced shapes, so few of its edges deviate from the original
 * shapes; these are split. What is proved is always the distance from the original shapes. */
#include "remesh/adaptive/start.h"

#include <math.h>
#include <stdatomic.h>
#include <string.h>

#include "base/check.h"
#include "base/loops.h"
#include "base/memory.h"
#include "base/tasks.h"
#include "remesh/adaptive/collapse.h"
#include "remesh/adaptive/thin.h"
#include "remesh/common/supermesh.h"
#include "remesh/placed/flip.h"
#include "sphere/locate.h"

/* One edge in SAMPLE is traced through the other shapes. A prime, because a regular mesh would otherwise show edges of
 * one direction only. Larger is faster and less accurate. */
enum { SAMPLE = 17 };
/* Rounds of collapses and flips for each shape: more make the overlay smaller and take longer. */
enum { REDUCTIONS = 4 };
/* Edges a thread traces at a time, and edges between two checks for cancellation. */
enum { GRAIN = 64, SLICE = 4096 };

typedef struct crossing_loop {
  const orb_remesh_job *job;
  int32_t own, other;
  atomic_llong count;
} crossing_loop;

static int64_t crossings_of(const crossing_loop *loop, int32_t h) {
  const orb_remesh_job *job = loop->job;
  const orb_aligned_shape *own = &job->shapes[loop->own], *other = &job->shapes[loop->other];
  orb_sphere_view view = {other->points, other->mesh.triangles, job->twin[loop->other], other->mesh.triangle_count};
  const double *p = own->points + 3 * (int64_t)own->mesh.triangles[h];
  const double *q = own->points + 3 * (int64_t)own->mesh.triangles[orb_next(h)];
  orb_place place;
  orb_hit from = orb_locate_hit(job->locator[loop->other], p, -1, &place);
  orb_arc_tracer tracer;
  orb_crossing crossing;
  int64_t count = 0;
  orb_trace_start(&tracer, &view, orb_spot_of(&from), p, q);
  while (orb_trace_next(&tracer, &crossing)) {
    count += !crossing.at_vertex;
  }
  return count;
}

static void crossing_range(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  crossing_loop *loop = arg;
  const int32_t *twin = loop->job->twin[loop->own];
  int64_t count = 0;
  for (int64_t i = begin; i < end; i++) {
    int32_t h = (int32_t)(SAMPLE * i);
    count += h < twin[h] ? crossings_of(loop, h) : 0;
  }
  atomic_fetch_add(&loop->count, count);
}

orb_status orb_adaptive_overlay_size(orb_context *ctx, const orb_remesh_job *job, int64_t *triangles) {
  int64_t vertices = 0;
  for (int32_t s = 0; s < job->shape_count; s++) {
    vertices += job->shapes[s].mesh.vertex_count;
    for (int32_t t = 0; t < s; t++) {
      crossing_loop loop = {.job = job, .own = s, .other = t};
      int64_t samples = (3 * (int64_t)job->shapes[s].mesh.triangle_count + SAMPLE - 1) / SAMPLE;
      ORB_TRY(orb_sliced_by(ctx, samples, SLICE, GRAIN, crossing_range, &loop));
      vertices += SAMPLE * atomic_load(&loop.count);
    }
  }
  *triangles = 2 * vertices;
  return ORB_OK;
}

/* A job whose shapes are the reduced ones. */
typedef struct reduced {
  orb_remesh_job job;
  orb_aligned_shape *shapes;
} reduced;

static void reduced_free(orb_context *ctx, reduced *r) {
  for (int32_t s = 0; r->shapes && s < r->job.shape_count; s++) {
    orb_free(ctx, r->shapes[s].points);
    orb_free(ctx, r->shapes[s].mesh.positions);
    orb_free(ctx, r->shapes[s].mesh.triangles);
  }
  for (int32_t s = 0; r->job.twin && s < r->job.shape_count; s++) {
    orb_free(ctx, r->job.twin[s]);
  }
  for (int32_t s = 0; r->job.locator && s < r->job.shape_count; s++) {
    orb_locator_destroy(ctx, r->job.locator[s]);
  }
  orb_free(ctx, r->shapes);
  orb_free(ctx, r->job.twin);
  orb_free(ctx, r->job.locator);
  memset(r, 0, sizeof *r);
}

/* Writes the net, of one shape, as a shape. */
static orb_status take_net(orb_context *ctx, const orb_placed_net *placed, orb_aligned_shape *out) {
  orb_supermesh net = {0};
  int32_t *number = ORB_NEW(ctx, int32_t, placed->net.vertex_count);
  orb_status status = number ? orb_net_export(ctx, &placed->net, &net, number) : ORB_E_NO_MEMORY;
  out->points = net.points;
  out->mesh.triangles = net.triangles;
  out->mesh.vertex_count = net.vertex_count;
  out->mesh.triangle_count = net.triangle_count;
  if (status == ORB_OK) {
    out->mesh.positions = ORB_NEW(ctx, double, 3 * (int64_t)net.vertex_count);
    status = out->mesh.positions ? ORB_OK : ORB_E_NO_MEMORY;
  }
  for (int32_t v = 0; status == ORB_OK && v < placed->net.vertex_count; v++) {
    if (number[v] >= 0) {
      memcpy(out->mesh.positions + 3 * (int64_t)number[v], orb_placed_position(placed, v, 0), 3 * sizeof(double));
    }
  }
  orb_free(ctx, number);
  return status;
}

static orb_status reduce_shape(orb_context *ctx, const orb_remesh_job *job, int32_t s, double limit2, reduced *out) {
  orb_remesh_job alone = *job;
  alone.shapes += s;
  alone.shape_count = 1;
  alone.twin += s;
  alone.locator += s;
  alone.diagonal += s;
  orb_placed_net placed;
  orb_aligned_shape *shape = &out->shapes[s];
  orb_status status;
  ORB_GO(status, orb_placed_create(ctx, &alone, &placed), end);
  for (int i = 0; i < REDUCTIONS; i++) {
    ORB_GO(status, orb_adaptive_collapse(ctx, &placed, limit2, 0, 1, i > 0), end);
    ORB_GO(status, orb_placed_compact(ctx, &placed), end);
    ORB_GO(status, orb_placed_flip_all(ctx, &placed, limit2, 0), end);
  }
  ORB_GO(status, take_net(ctx, &placed, shape), end);
  const orb_mesh *mesh = &shape->mesh;
  out->job.twin[s] = ORB_NEW(ctx, int32_t, 3 * (int64_t)mesh->triangle_count);
  status = out->job.twin[s] ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    status = orb_mesh_twins(ctx, mesh->triangles, mesh->triangle_count, mesh->vertex_count, out->job.twin[s]);
  }
  if (status == ORB_OK) {
    status = orb_locator_create(ctx, shape->points, mesh->vertex_count, mesh->triangles, mesh->triangle_count,
                                out->job.twin[s], &out->job.locator[s]);
  }
end:
  orb_placed_free(ctx, &placed);
  return status;
}

static orb_status reduce(orb_context *ctx, const orb_remesh_job *job, double limit2, reduced *out) {
  int32_t shapes = job->shape_count;
  *out = (reduced){.job = *job, .shapes = ORB_NEW0(ctx, orb_aligned_shape, shapes)};
  out->job.shapes = out->shapes;
  out->job.twin = ORB_NEW0(ctx, int32_t *, shapes);
  out->job.locator = ORB_NEW0(ctx, orb_locator *, shapes);
  orb_status status = out->shapes && out->job.twin && out->job.locator ? ORB_OK : ORB_E_NO_MEMORY;
  for (int32_t s = 0; s < shapes && status == ORB_OK; s++) {
    status = reduce_shape(ctx, job, s, limit2, out);
  }
  return status;
}

/* Thins the overlay and drops what has died. */
static orb_status take_thinned(orb_context *ctx, const orb_remesh_job *job, const orb_supermesh *overlay, double limit2,
                               orb_net *net) {
  orb_net thin;
  orb_supermesh kept = {0};
  orb_status status = orb_adaptive_thin_overlay(ctx, job, overlay, limit2, &thin);
  if (status == ORB_OK) {
    status = orb_net_export(ctx, &thin, &kept, NULL);
  }
  orb_net_free(ctx, &thin);
  if (status == ORB_OK) {
    status = orb_net_init(ctx, net, kept.points, kept.vertex_count, kept.triangles, kept.triangle_count, NULL,
                          kept.vertex_count);
  }
  orb_supermesh_free(ctx, &kept);
  return status;
}

/* A placed net for `job` on the overlay of the shapes of `laid`, thinned out if limit2 is above 0. */
static orb_status create_on_overlay(orb_context *ctx, const orb_remesh_job *laid, const orb_remesh_job *job,
                                    double limit2, orb_placed_net *placed) {
  orb_supermesh overlay = {.error_bound = ORB_NEW(ctx, double, job->shape_count)};
  orb_net net = {0};
  orb_status status = overlay.error_bound ? orb_remesh_overlay(ctx, laid, &overlay) : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    status = limit2 > 0 ? take_thinned(ctx, laid, &overlay, limit2, &net)
                        : orb_net_init(ctx, &net, overlay.points, overlay.vertex_count, overlay.triangles,
                                       overlay.triangle_count, NULL, overlay.vertex_count);
  }
  orb_supermesh_free(ctx, &overlay);
  if (status == ORB_OK) {
    orb_placed_free(ctx, placed);
    status = orb_placed_create_on(ctx, job, &net, placed);
  }
  orb_net_free(ctx, &net);
  return status;
}

/* Inserts the live vertices of a thinned shape. */
static orb_status insert_all(orb_context *ctx, const orb_net *thin, const orb_locator *locator, orb_net *net) {
  for (int32_t v = 0; v < thin->vertex_count; v++) {
    if (thin->out[v] >= 0) {
      orb_place near;
      orb_locate(locator, orb_net_point(thin, v), -1, &near);
      (void)orb_net_insert(net, orb_net_point(thin, v), &near.triangle);
    }
    if (v % SLICE == 0) {
      ORB_TRY(orb_context_check(ctx));
    }
  }
  return ORB_OK;
}

static int64_t live_vertices(const orb_net *net) {
  int64_t live = 0;
  for (int32_t v = 0; v < net->vertex_count; v++) {
    live += net->out[v] >= 0;
  }
  return live;
}

/* A net of the live vertices of all thinned shapes: the one with the most is kept, the others' are inserted. */
static orb_status join_thinned(orb_context *ctx, const orb_net *thin, int32_t shapes, orb_net *net) {
  int32_t base = 0;
  int64_t all = 0;
  for (int32_t s = 0; s < shapes; s++) {
    base = live_vertices(&thin[s]) > live_vertices(&thin[base]) ? s : base;
    all += live_vertices(&thin[s]);
  }
  orb_supermesh kept = {0};
  orb_locator *locator = NULL;
  orb_status status;
  ORB_GO(status, orb_net_export(ctx, &thin[base], &kept, NULL), end);
  ORB_GO(status, orb_net_init(ctx, net, kept.points, kept.vertex_count, kept.triangles, kept.triangle_count, NULL, all),
         end);
  ORB_GO(status,
         orb_locator_create(ctx, kept.points, kept.vertex_count, kept.triangles, kept.triangle_count, NULL, &locator),
         end);
  for (int32_t s = 0; s < shapes; s++) {
    if (s != base) {
      ORB_GO(status, insert_all(ctx, &thin[s], locator, net), end);
    }
  }
end:
  orb_locator_destroy(ctx, locator);
  orb_supermesh_free(ctx, &kept);
  return status;
}

/* Shapes that are thinned side by side. */
typedef struct thinning {
  const orb_remesh_job *job;
  double limit2;
  orb_net *thin;
} thinning;

static orb_status thin_one(orb_context *ctx, void *arg, int32_t s) {
  const thinning *t = arg;
  return orb_adaptive_thin_shape(ctx, t->job, s, t->limit2, &t->thin[s]);
}

orb_status orb_adaptive_start_from_thinned(orb_context *ctx, const orb_remesh_job *job, double limit2,
                                           orb_placed_net *placed) {
  orb_net *thin = ORB_NEW0(ctx, orb_net, job->shape_count), net = {0};
  thinning all = {job, limit2, thin};
  orb_status status = thin ? orb_tasks_run(ctx, job->shape_count, thin_one, &all) : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    status = join_thinned(ctx, thin, job->shape_count, &net);
  }
  for (int32_t s = 0; s < job->shape_count && thin; s++) {
    orb_net_free(ctx, &thin[s]);
  }
  orb_free(ctx, thin);
  if (status == ORB_OK) {
    status = orb_placed_create_on(ctx, job, &net, placed);
  }
  orb_net_free(ctx, &net);
  return status;
}

orb_status orb_adaptive_start_from_overlay(orb_context *ctx, const orb_remesh_job *job, double limit2,
                                           orb_placed_net *placed) {
  return create_on_overlay(ctx, job, job, limit2, placed);
}

orb_status orb_adaptive_start_from_reduced(orb_context *ctx, const orb_remesh_job *job, double limit2,
                                           orb_placed_net *placed) {
  reduced r;
  orb_status status = reduce(ctx, job, limit2, &r);
  if (status == ORB_OK) {
    status = create_on_overlay(ctx, &r.job, job, 0, placed);
  }
  reduced_free(ctx, &r);
  return status;
}
