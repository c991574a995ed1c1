/* The overlay method for N shapes, which are overlaid one after another. The overlay of the first shapes, with its
 * crossings rounded and certified, is the first layer of the next overlay. Its triangles map linearly to each of its
 * shapes, so a new vertex inside one has its place on them by interpolation: the result reproduces every shape exactly,
 * however many there are. */
#include "remesh/common/job.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/context.h"
#include "base/error.h"
#include "base/memory.h"
#include "numeric/vec3.h"
#include "remesh/overlay/faces.h"
#include "remesh/overlay/repair.h"
#include "remesh/overlay/snap.h"
#include "remesh/overlay/trace.h"

/* Every triangle lies in one triangle of each shape, so only places and their positions are rounded: by a few units in
 * the last place of the largest coordinate, for each shape of the overlay. */
static const double PLACE_ROUNDING = 64 * 2.3e-16;
/* Relative to the diagonal: what rounding adds when a caller measures the distance. */
static const double DISTANCE_ROUNDING = 1e-13;

/* The overlay of the first shapes: one triangulation, with places and parents on each of them. */
typedef struct partial {
  int32_t vertex_count, triangle_count, shapes;
  double *points;
  int32_t *triangles, *parent; /* parent: per triangle, one per shape */
  orb_place **places;          /* per shape */
  double *moved;               /* per shape: how far the repair of rounding may have moved it */
} partial;

static void partial_free(orb_context *ctx, partial *p) {
  for (int32_t s = 0; p->places && s < p->shapes; s++) {
    orb_free(ctx, p->places[s]);
  }
  orb_free(ctx, p->points);
  orb_free(ctx, p->triangles);
  orb_free(ctx, p->parent);
  orb_free(ctx, p->places);
  orb_free(ctx, p->moved);
  memset(p, 0, sizeof *p);
}

/* Frees what orb_overlay_trace() and orb_overlay_faces() have filled; views and locators stay. */
static void overlay_free(orb_context *ctx, orb_overlay *overlay) {
  for (int l = 0; l < 2; l++) {
    orb_layer *layer = &overlay->layer[l];
    orb_free(ctx, layer->spot);
    orb_free(ctx, layer->id);
    orb_free(ctx, layer->edge);
    orb_free(ctx, layer->half);
    orb_free(ctx, layer->begin);
    orb_free(ctx, layer->event);
    orb_free(ctx, layer->event_id);
  }
  orb_free(ctx, overlay->lone);
  orb_free(ctx, overlay->cross);
  orb_free(ctx, overlay->points);
  orb_free(ctx, overlay->places);
  orb_free(ctx, overlay->triangles);
  orb_free(ctx, overlay->parent);
  orb_free(ctx, overlay->merged);
  memset(overlay, 0, sizeof *overlay);
}

/* Adds weight times a place's coordinates, expressed in the corners of triangle `in`. Returns 0 if a corner of the
 * place with weight is not a corner of that triangle. */
static int express(const int32_t *triangles, const orb_place *place, int32_t in, double weight, double at[3]) {
  for (int k = 0; k < 3; k++) {
    if (place->at[k] > 0) {
      int j = 0;
      while (j < 3 && triangles[3 * (int64_t)in + j] != triangles[3 * (int64_t)place->triangle + k]) {
        j++;
      }
      if (j == 3) {
        return 0;
      }
      at[j] += weight * place->at[k];
    }
  }
  return 1;
}

/* The place on shape s of a point of `below`, whose triangle lies in one triangle of the shape. */
static int place_through(const partial *below, const orb_remesh_job *job, int32_t s, const orb_place *on_partial,
                         orb_place *out) {
  for (int k = 0; k < 3; k++) {
    if (on_partial->at[k] == 1) {
      *out = below->places[s][below->triangles[3 * (int64_t)on_partial->triangle + k]];
      return 1;
    }
  }
  *out = (orb_place){below->parent[(int64_t)on_partial->triangle * below->shapes + s], {0, 0, 0}};
  for (int k = 0; k < 3; k++) {
    const orb_place *corner = &below->places[s][below->triangles[3 * (int64_t)on_partial->triangle + k]];
    if (on_partial->at[k] > 0 &&
        !express(job->shapes[s].mesh.triangles, corner, out->triangle, on_partial->at[k], out->at)) {
      return 0;
    }
  }
  double sum = out->at[0] + out->at[1] + out->at[2];
  int largest = 0;
  for (int k = 0; k < 3; k++) {
    out->at[k] /= sum;
    largest = out->at[k] > out->at[largest] ? k : largest;
  }
  out->at[largest] = 1 - (out->at[(largest + 1) % 3] + out->at[(largest + 2) % 3]);
  return 1;
}

static orb_status partial_start(orb_context *ctx, const orb_remesh_job *job, partial *out) {
  const orb_aligned_shape *shape = &job->shapes[0];
  size_t vertices = (size_t)shape->mesh.vertex_count, triangles = (size_t)shape->mesh.triangle_count;
  out->shapes = 1;
  out->vertex_count = (int32_t)vertices;
  out->triangle_count = (int32_t)triangles;
  out->points = ORB_NEW(ctx, double, 3 * vertices);
  out->triangles = ORB_NEW(ctx, int32_t, 3 * triangles);
  out->parent = ORB_NEW(ctx, int32_t, triangles);
  out->places = ORB_NEW0(ctx, orb_place *, 1);
  out->moved = ORB_NEW0(ctx, double, 1);
  if (out->places) {
    out->places[0] = ORB_NEW(ctx, orb_place, vertices);
  }
  if (!out->points || !out->triangles || !out->parent || !out->places || !out->moved || !out->places[0]) {
    return ORB_E_NO_MEMORY;
  }
  memcpy(out->points, shape->points, 3 * vertices * sizeof(double));
  memcpy(out->triangles, shape->mesh.triangles, 3 * triangles * sizeof(int32_t));
  for (int32_t h = 3 * out->triangle_count - 1; h >= 0; h--) {
    orb_place *place = &out->places[0][out->triangles[h]];
    *place = (orb_place){h / 3, {0, 0, 0}};
    place->at[h % 3] = 1;
    out->parent[h / 3] = h / 3;
  }
  return ORB_OK;
}

/* Renumbers the vertices without those that were merged away. */
static orb_status drop_unused(orb_context *ctx, partial *p) {
  int32_t *number = ORB_NEW0(ctx, int32_t, p->vertex_count), n = 0;
  if (!number) {
    return ORB_E_NO_MEMORY;
  }
  for (int64_t h = 0; h < 3 * (int64_t)p->triangle_count; h++) {
    number[p->triangles[h]] = 1;
  }
  for (int32_t v = 0; v < p->vertex_count; v++) {
    if (number[v]) {
      memmove(p->points + 3 * (int64_t)n, p->points + 3 * (int64_t)v, 3 * sizeof(double));
      for (int32_t s = 0; s < p->shapes; s++) {
        p->places[s][n] = p->places[s][v];
      }
      number[v] = n++;
    }
  }
  for (int64_t h = 0; h < 3 * (int64_t)p->triangle_count; h++) {
    p->triangles[h] = number[p->triangles[h]];
  }
  p->vertex_count = n;
  orb_free(ctx, number);
  return ORB_OK;
}

/* Makes *out of the overlay: places on the earlier shapes through `below`, on the new shape as they are. Takes over
 * points and triangles. */
static orb_status partial_add(orb_context *ctx, const orb_remesh_job *job, const partial *below, orb_overlay *overlay,
                              partial *out) {
  int32_t n = overlay->vertex_count, shapes = below->shapes + 1;
  out->shapes = shapes;
  out->vertex_count = n;
  out->triangle_count = overlay->triangle_count;
  out->places = ORB_NEW0(ctx, orb_place *, shapes);
  out->parent = ORB_NEW(ctx, int32_t, (int64_t)overlay->triangle_count * shapes);
  out->moved = ORB_NEW0(ctx, double, shapes);
  if (!out->places || !out->parent || !out->moved) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t s = 0; s < shapes; s++) {
    out->places[s] = ORB_NEW(ctx, orb_place, n);
    if (!out->places[s]) {
      return ORB_E_NO_MEMORY;
    }
    for (int32_t v = 0; v < n && s < below->shapes; v++) {
      if (!place_through(below, job, s, &overlay->places[v], &out->places[s][v])) {
        return orb_fail(ctx, ORB_E_INTERNAL, "A vertex of the overlay lost its place on shape %d.", s);
      }
    }
    ORB_TRY(orb_context_check(ctx));
  }
  memcpy(out->places[shapes - 1], overlay->places + n, (size_t)n * sizeof(orb_place));
  for (int64_t t = 0; t < overlay->triangle_count; t++) {
    for (int32_t s = 0; s < below->shapes; s++) {
      out->parent[t * shapes + s] = below->parent[(int64_t)overlay->parent[2 * t] * below->shapes + s];
    }
    out->parent[t * shapes + below->shapes] = overlay->parent[2 * t + 1];
  }
  out->points = overlay->points;
  out->triangles = overlay->triangles;
  overlay->points = NULL;
  overlay->triangles = NULL;
  for (int32_t s = 0; s < shapes; s++) {
    out->moved[s] = s < below->shapes ? below->moved[s] : 0;
    for (int32_t i = 0; i < overlay->merged_count; i++) {
      double gone[3], kept[3];
      orb_place_position(&job->shapes[s].mesh, &out->places[s][overlay->merged[2 * i]], gone);
      orb_place_position(&job->shapes[s].mesh, &out->places[s][overlay->merged[2 * i + 1]], kept);
      out->moved[s] += sqrt(orb_distance2(gone, kept));
    }
  }
  return overlay->merged_count ? drop_unused(ctx, out) : ORB_OK;
}

static orb_status overlay_shape(orb_context *ctx, const orb_remesh_job *job, int32_t s, partial *below, partial *out) {
  const orb_aligned_shape *shape = &job->shapes[s];
  orb_overlay overlay = {0};
  orb_locator *locator = NULL, *moved = NULL;
  int32_t *twin = ORB_NEW(ctx, int32_t, 3 * (int64_t)below->triangle_count), snapped = 0;
  double *points = ORB_NEW(ctx, double, 3 * (int64_t)shape->mesh.vertex_count);
  orb_status status = twin && points ? ORB_OK : ORB_E_NO_MEMORY;
  if (status != ORB_OK) {
    goto end;
  }
  ORB_GO(status, orb_mesh_twins(ctx, below->triangles, below->triangle_count, below->vertex_count, twin), end);
  ORB_GO(status,
         orb_locator_create(ctx, below->points, below->vertex_count, below->triangles, below->triangle_count, twin,
                            &locator),
         end);
  overlay.layer[0].view = (orb_sphere_view){below->points, below->triangles, twin, below->triangle_count};
  overlay.layer[0].vertex_count = below->vertex_count;
  overlay.layer[0].locator = locator;
  overlay.layer[1].view =
      (orb_sphere_view){shape->points, shape->mesh.triangles, job->twin[s], shape->mesh.triangle_count};
  overlay.layer[1].vertex_count = shape->mesh.vertex_count;
  overlay.layer[1].locator = job->locator[s];
  ORB_GO(status, orb_overlay_snap(ctx, &overlay.layer[0], &overlay.layer[1], points, &snapped), end);
  if (snapped) {
    ORB_GO(status,
           orb_locator_create(ctx, points, shape->mesh.vertex_count, shape->mesh.triangles, shape->mesh.triangle_count,
                              job->twin[s], &moved),
           end);
    overlay.layer[1].view.points = points;
    overlay.layer[1].locator = moved;
  }
  ORB_GO(status, orb_overlay_trace(ctx, &overlay), end);
  ORB_GO(status, orb_overlay_faces(ctx, &overlay), end);
  ORB_GO(status, orb_overlay_repair(ctx, &overlay), end);
  ORB_GO(status, partial_add(ctx, job, below, &overlay, out), end);
end:
  overlay_free(ctx, &overlay);
  orb_locator_destroy(ctx, moved);
  orb_locator_destroy(ctx, locator);
  orb_free(ctx, points);
  orb_free(ctx, twin);
  return status;
}

static double largest_coordinate(const orb_mesh *mesh) {
  double largest = 0;
  for (int64_t i = 0; i < 3 * (int64_t)mesh->vertex_count; i++) {
    largest = fmax(largest, fabs(mesh->positions[i]));
  }
  return largest;
}

orb_status orb_remesh_overlay(orb_context *ctx, const orb_remesh_job *job, orb_supermesh *out) {
  partial now = {0}, next = {0};
  orb_status status;
  ORB_GO(status, partial_start(ctx, job, &now), end);
  for (int32_t s = 1; s < job->shape_count; s++) {
    ORB_GO(status, overlay_shape(ctx, job, s, &now, &next), end);
    partial_free(ctx, &now);
    now = next;
    memset(&next, 0, sizeof next);
    orb_progress(ctx, "remesh", (double)s / job->shape_count);
  }
  out->places = ORB_NEW(ctx, orb_place, (int64_t)job->shape_count * now.vertex_count);
  if (!out->places) {
    status = ORB_E_NO_MEMORY;
    goto end;
  }
  for (int32_t s = 0; s < job->shape_count; s++) {
    memcpy(out->places + (int64_t)s * now.vertex_count, now.places[s], (size_t)now.vertex_count * sizeof(orb_place));
    out->error_bound[s] = now.moved[s] + PLACE_ROUNDING * job->shape_count * largest_coordinate(&job->shapes[s].mesh) +
                          DISTANCE_ROUNDING * job->diagonal[s];
  }
  out->vertex_count = now.vertex_count;
  out->triangle_count = now.triangle_count;
  out->points = now.points;
  out->triangles = now.triangles;
  now.points = NULL;
  now.triangles = NULL;
end:
  partial_free(ctx, &now);
  partial_free(ctx, &next);
  return status;
}
