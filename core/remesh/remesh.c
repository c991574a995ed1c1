/* orb_remesh(): checks the request, prepares the shapes, runs the method, then finds the landmarks and certifies the
 * result. A result that fails its certificate is an error, and is never returned. */
#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/context.h"
#include "base/error.h"
#include "base/memory.h"
#include "remesh/common/order.h"
#include "remesh/placed/rims.h"
#include "remesh/registry.h"

/* The share of the tolerance that a method gets before rims are added: edges that they cut may deviate a little more.
 */
static const double RIMS_SHARE = 0.9;

void orb_remesh_defaults(orb_remesh_options *options) {
  *options = (orb_remesh_options){.method = ORB_REMESH_ADAPTIVE, .tolerance = 0.001, .max_triangles = 0};
}

static orb_status check_request(orb_context *ctx, const orb_aligned_shape *shapes, int32_t shape_count,
                                const orb_remesh_options *options) {
  if (shape_count < 1) {
    return orb_fail(ctx, ORB_E_BAD_OPTION, "A supermesh needs at least one shape.");
  }
  if (!(options->tolerance > 0) || !isfinite(options->tolerance)) {
    return orb_fail(ctx, ORB_E_BAD_OPTION, "remesh.tolerance must be a positive number.");
  }
  if (options->max_triangles < 0 || (options->max_triangles > 0 && options->max_triangles < 4)) {
    return orb_fail(ctx, ORB_E_BAD_OPTION, "remesh.max_triangles must be at least 4, or 0 for no limit.");
  }
  for (int32_t s = 0; s < shape_count; s++) {
    const orb_mesh *mesh = &shapes[s].mesh;
    if (mesh->triangle_count < 4 || mesh->triangle_count != 2 * (int64_t)mesh->vertex_count - 4) {
      orb_status status =
          orb_fail(ctx, ORB_E_NOT_GENUS_ZERO, "Shape %d is not a closed surface of genus zero in one piece.", s);
      orb_context_error_edit(ctx)->shape = s;
      return status;
    }
  }
  return ORB_OK;
}

static orb_status prepare(orb_context *ctx, orb_remesh_job *job) {
  job->twin = ORB_NEW0(ctx, int32_t *, job->shape_count);
  job->locator = ORB_NEW0(ctx, orb_locator *, job->shape_count);
  job->diagonal = ORB_NEW0(ctx, double, job->shape_count);
  if (!job->twin || !job->locator || !job->diagonal) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t s = 0; s < job->shape_count; s++) {
    const orb_aligned_shape *shape = &job->shapes[s];
    const orb_mesh *mesh = &shape->mesh;
    orb_extent extent;
    orb_mesh_extent(mesh, &extent);
    job->diagonal[s] = extent.diagonal;
    job->twin[s] = ORB_NEW(ctx, int32_t, 3 * (int64_t)mesh->triangle_count);
    if (!job->twin[s]) {
      return ORB_E_NO_MEMORY;
    }
    ORB_TRY(orb_mesh_twins(ctx, mesh->triangles, mesh->triangle_count, mesh->vertex_count, job->twin[s]));
    ORB_TRY(orb_locator_create(ctx, shape->points, mesh->vertex_count, mesh->triangles, mesh->triangle_count,
                               job->twin[s], &job->locator[s]));
    ORB_TRY(orb_context_check(ctx));
  }
  return ORB_OK;
}

static void release(orb_context *ctx, orb_remesh_job *job) {
  for (int32_t s = 0; s < job->shape_count; s++) {
    if (job->locator) {
      orb_locator_destroy(ctx, job->locator[s]);
    }
    if (job->twin) {
      orb_free(ctx, job->twin[s]);
    }
  }
  orb_free(ctx, job->locator);
  orb_free(ctx, job->twin);
  orb_free(ctx, job->diagonal);
}

/* The supermesh vertex whose place on every shape is the landmark's vertex; −1 where there is none. */
static int32_t landmark_vertex(const orb_remesh_job *job, const orb_supermesh *out, const orb_locator *locator,
                               int32_t landmark) {
  int32_t first = job->shapes[0].landmark_vertices ? job->shapes[0].landmark_vertices[landmark] : -1;
  if (first < 0) {
    return -1;
  }
  orb_place place;
  orb_locate(locator, job->shapes[0].points + 3 * (int64_t)first, -1, &place);
  int corner = place.at[0] == 1 ? 0 : place.at[1] == 1 ? 1 : place.at[2] == 1 ? 2 : -1;
  if (corner < 0) {
    return -1;
  }
  int32_t v = out->triangles[3 * place.triangle + corner];
  for (int32_t s = 0; s < job->shape_count; s++) {
    const int32_t *vertices = job->shapes[s].landmark_vertices;
    const orb_place *at = &out->places[(int64_t)s * out->vertex_count + v];
    int k = at->at[0] == 1 ? 0 : at->at[1] == 1 ? 1 : at->at[2] == 1 ? 2 : -1;
    if (!vertices || k < 0 || job->shapes[s].mesh.triangles[3 * at->triangle + k] != vertices[landmark]) {
      return -1;
    }
  }
  return v;
}

static orb_status find_landmarks(orb_context *ctx, const orb_remesh_job *job, orb_supermesh *out) {
  out->landmark_count = job->landmark_count;
  out->landmark_vertices = ORB_NEW(ctx, int32_t, job->landmark_count);
  if (!out->landmark_vertices) {
    return ORB_E_NO_MEMORY;
  }
  if (job->landmark_count == 0) {
    return ORB_OK;
  }
  orb_locator *locator = NULL;
  ORB_TRY(orb_locator_create(ctx, out->points, out->vertex_count, out->triangles, out->triangle_count, NULL, &locator));
  for (int32_t i = 0; i < job->landmark_count; i++) {
    out->landmark_vertices[i] = landmark_vertex(job, out, locator, i);
  }
  orb_locator_destroy(ctx, locator);
  return ORB_OK;
}

static orb_status run_method(orb_context *ctx, const orb_remesh_job *job, orb_supermesh *out) {
  orb_remesh_method method = job->options->method;
  const char *name = orb_remesh_method_name(method);
  if (!name) {
    return orb_fail(ctx, ORB_E_BAD_OPTION, "Unknown remesh method %d.", (int)method);
  }
  orb_remesh_fn run = orb_remesh_function(method);
  if (!run) {
    return orb_fail(ctx, ORB_E_UNSUPPORTED, "This build does not have the remesh method '%s'; use 'adaptive'.", name);
  }
  return run(ctx, job, out);
}

/* A method that keeps the given triangles cannot make fewer of them: it refuses instead. */
static orb_status refuse_more(orb_context *ctx, const orb_remesh_options *options, const orb_supermesh *made) {
  if (options->max_triangles == 0 || made->triangle_count <= options->max_triangles) {
    return ORB_OK;
  }
  return orb_fail(
      ctx, ORB_E_BAD_OPTION,
      "The method '%s' makes %d triangles here, more than max_triangles = %lld; raise it, or use 'adaptive' "
      "for fewer.",
      orb_remesh_method_name(options->method), made->triangle_count, (long long)options->max_triangles);
}

orb_status orb_remesh(orb_context *ctx, const orb_aligned_shape *shapes, int32_t shape_count, int32_t landmark_count,
                      const orb_remesh_options *options, orb_supermesh *out) {
  memset(out, 0, sizeof *out);
  orb_remesh_options defaults;
  if (!options) {
    orb_remesh_defaults(&defaults);
    options = &defaults;
  }
  ORB_TRY(check_request(ctx, shapes, shape_count, options));
  orb_remesh_job job = {
      .shapes = shapes, .shape_count = shape_count, .landmark_count = landmark_count, .options = options};
  orb_progress(ctx, "remesh", 0);
  out->shape_count = shape_count;
  orb_shape_order order = {0};
  orb_status status = ORB_OK;
  if (options->method == ORB_REMESH_ADAPTIVE && !(options->rims && orb_rims_any(&job))) {
    status = orb_shape_order_make(ctx, shapes, shape_count, landmark_count, &order);
    job.shapes = order.shapes;
  }
  if (status == ORB_OK) {
    status = prepare(ctx, &job);
  }
  if (status == ORB_OK) {
    out->error_bound = ORB_NEW(ctx, double, shape_count);
    status = out->error_bound ? ORB_OK : ORB_E_NO_MEMORY;
  }
  for (int32_t s = 0; s < shape_count && status == ORB_OK; s++) {
    out->error_bound[s] = NAN;
  }
  orb_remesh_options tight = *options;
  if (status == ORB_OK && options->rims && orb_rims_any(&job)) {
    tight.tolerance *= RIMS_SHARE;
  }
  job.options = &tight;
  if (status == ORB_OK) {
    status = run_method(ctx, &job, out);
  }
  if (status == ORB_OK) {
    status = refuse_more(ctx, options, out);
  }
  job.options = options;
  out->has_rims = options->method == ORB_REMESH_OVERLAY || options->method == ORB_REMESH_TEMPLATE;
  if (status == ORB_OK && options->rims && !out->has_rims) {
    status = orb_rims_add(ctx, &job, out);
  }
  if (status == ORB_OK) {
    status = find_landmarks(ctx, &job, out);
  }
  if (status == ORB_OK) {
    status = orb_supermesh_check(ctx, out);
  }
  if (status == ORB_OK) {
    orb_shape_order_restore(&order, out);
  }
  release(ctx, &job);
  orb_shape_order_free(ctx, &order);
  if (status != ORB_OK) {
    orb_supermesh_free(ctx, out);
    return status;
  }
  orb_progress(ctx, "remesh", 1);
  return ORB_OK;
}
