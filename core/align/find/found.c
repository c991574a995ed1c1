/* The found landmarks: points of the first shape that are far from each other in space, tips of limbs first, and where
 * the aligned spheres put them on the other shapes. They show a reader what was matched with what; a client can correct
 * them and send them as landmarks.
 *
 * The confidence compares a patch of triangles around the point with its image on each other shape, with both shapes
 * scaled to equal area. Each triangle has the symmetric Dirichlet energy E = (|J|² + |J⁻¹|²)/4 of the linear map J to
 * its image: 1 for a rigid motion, more for any other map. The mean of 1/E, weighted by area, is the confidence on that
 * shape; the least over all shapes is that of the landmark. All confidences fall where another candidate is nearly as
 * good. */
#include <math.h>
#include <string.h>

#include "align/find/found.h"
#include "align/find/params.h"
#include "base/check.h"
#include "base/memory.h"
#include "numeric/vec3.h"
#include "orbmorph/remesh.h"

typedef struct finder {
  const orb_alignment *alignment;
  int32_t *twin;         /* of the first shape */
  orb_locator **locator; /* a shape; none of the first */
  double *area;          /* a shape */
} finder;

/* 1/E of the linear map from triangle p to triangle q, E = (|J|² + |J⁻¹|²)/4: 1 for a rigid motion, 0 where it is
 * degenerate. *area: of p. |J|² is Σ cot(angle) |opposite edge's image|² over twice the area. */
static double likeness(double p[3][3], double q[3][3], double *area) {
  double u[3], v[3], n[3], sum = 0;
  orb_sub(p[1], p[0], u);
  orb_sub(p[2], p[0], v);
  orb_cross(u, v, n);
  double from = orb_length(n);
  orb_sub(q[1], q[0], u);
  orb_sub(q[2], q[0], v);
  orb_cross(u, v, n);
  double stretch = orb_length(n) / from;
  for (int k = 0; k < 3; k++) {
    orb_sub(p[(k + 1) % 3], p[k], u);
    orb_sub(p[(k + 2) % 3], p[k], v);
    sum += orb_dot(u, v) * orb_distance2(q[(k + 1) % 3], q[(k + 2) % 3]);
  }
  double energy = sum / (from * from) * (1 + 1 / (stretch * stretch)) / 4;
  *area = 0.5 * from;
  return isfinite(energy) && energy >= 1 ? 1 / energy : energy < 1 ? 1 : 0; /* below 1 by rounding only; NaN: 0 */
}

/* The first triangle and those nearest to it over edges. */
static int32_t take_patch(const finder *f, int32_t first, int32_t patch[ORB_FIND_PATCH]) {
  int32_t count = 1;
  patch[0] = first;
  for (int32_t i = 0; i < count; i++) {
    for (int k = 0; k < 3 && count < ORB_FIND_PATCH; k++) {
      int32_t t = f->twin[3 * patch[i] + k] / 3, j = 0;
      while (j < count && patch[j] != t) {
        j++;
      }
      if (j == count) {
        patch[count++] = t;
      }
    }
  }
  return count;
}

static double confidence_on(const finder *f, int32_t s, const int32_t *patch, int32_t count) {
  const orb_aligned_shape *from = &f->alignment->shapes[0], *to = &f->alignment->shapes[s];
  double sum = 0, total = 0;
  for (int32_t i = 0; i < count; i++) {
    double p[3][3], q[3][3], area;
    for (int k = 0; k < 3; k++) {
      int32_t v = from->mesh.triangles[3 * patch[i] + k];
      orb_place place;
      orb_locate(f->locator[s], from->points + 3 * (int64_t)v, -1, &place);
      orb_place_position(&to->mesh, &place, q[k]);
      for (int c = 0; c < 3; c++) {
        p[k][c] = from->mesh.positions[3 * (int64_t)v + c] / sqrt(f->area[0]);
        q[k][c] /= sqrt(f->area[s]);
      }
    }
    double like = likeness(p, q, &area);
    sum += like * area;
    total += area;
  }
  return total > 0 ? fmin(sum / total, 1) : 0;
}

static orb_status prepare(orb_context *ctx, finder *f) {
  const orb_mesh *first = &f->alignment->shapes[0].mesh;
  int32_t shapes = f->alignment->shape_count;
  f->twin = ORB_NEW(ctx, int32_t, 3 * (int64_t)first->triangle_count);
  f->locator = ORB_NEW0(ctx, orb_locator *, shapes);
  f->area = ORB_NEW(ctx, double, shapes);
  if (!f->twin || !f->locator || !f->area) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t s = 0; s < shapes; s++) {
    const orb_aligned_shape *shape = &f->alignment->shapes[s];
    orb_extent extent;
    orb_mesh_extent(&shape->mesh, &extent);
    f->area[s] = extent.area;
    if (s > 0) {
      ORB_TRY(orb_locator_create(ctx, shape->points, shape->mesh.vertex_count, shape->mesh.triangles,
                                 shape->mesh.triangle_count, NULL, &f->locator[s]));
    }
  }
  return orb_mesh_twins(ctx, first->triangles, first->triangle_count, first->vertex_count, f->twin);
}

static orb_status fill(orb_context *ctx, const finder *f, int32_t v, int32_t i, orb_alignment *out) {
  orb_place *at = out->found + (int64_t)i * out->shape_count;
  const double *p = out->shapes[0].points + 3 * (int64_t)v;
  int32_t patch[ORB_FIND_PATCH];
  ORB_TRY(orb_place_of_vertex(ctx, &out->shapes[0].mesh, v, &at[0]));
  int32_t count = take_patch(f, at[0].triangle, patch);
  memcpy(out->found_points + 3 * (int64_t)i, p, 3 * sizeof *p);
  out->confidence[i] = 1;
  for (int32_t s = 1; s < out->shape_count; s++) {
    orb_locate(f->locator[s], p, -1, &at[s]);
    out->confidence[i] = fmin(out->confidence[i], confidence_on(f, s, patch, count));
  }
  return orb_context_check(ctx);
}

/* Farthest points: first the vertex farthest from vertex 0, then each time the one farthest from all before it. Stops
 * early if only vertices at the same positions are left. */
static orb_status spread(orb_context *ctx, const orb_mesh *mesh, int32_t out[ORB_FOUND_MAX], int32_t *count) {
  double *far = ORB_NEW(ctx, double, mesh->vertex_count);
  if (!far) {
    return ORB_E_NO_MEMORY;
  }
  int32_t last = 0;
  *count = 0;
  for (int32_t i = -1; i < ORB_FOUND_MAX; i++) {
    const double *p = mesh->positions + 3 * (int64_t)last;
    int32_t best = 0;
    for (int32_t v = 0; v < mesh->vertex_count; v++) {
      double d = orb_distance2(mesh->positions + 3 * (int64_t)v, p);
      far[v] = i < 1 || d < far[v] ? d : far[v];
      best = far[v] > far[best] ? v : best;
    }
    if (i >= 0) {
      out[(*count)++] = last;
    }
    if (!(far[best] > 0)) {
      break;
    }
    last = best;
  }
  orb_free(ctx, far);
  return orb_context_check(ctx);
}

orb_status orb_align_find(orb_context *ctx, orb_alignment *alignment, double clear) {
  finder f = {.alignment = alignment};
  int32_t vertices[ORB_FOUND_MAX], count = 0;
  orb_status status;
  alignment->found = ORB_NEW(ctx, orb_place, (int64_t)ORB_FOUND_MAX * alignment->shape_count);
  alignment->confidence = ORB_NEW(ctx, double, ORB_FOUND_MAX);
  alignment->found_points = ORB_NEW(ctx, double, 3 * ORB_FOUND_MAX);
  if (!alignment->found || !alignment->confidence || !alignment->found_points) {
    return ORB_E_NO_MEMORY;
  }
  ORB_GO(status, prepare(ctx, &f), end);
  ORB_GO(status, spread(ctx, &alignment->shapes[0].mesh, vertices, &count), end);
  for (int32_t i = 0; i < count; i++) {
    ORB_GO(status, fill(ctx, &f, vertices[i], i, alignment), end);
    alignment->confidence[i] *= fmin(1, clear / ORB_FIND_CLEAR);
    alignment->found_count++;
  }
end:
  for (int32_t s = 0; f.locator && s < alignment->shape_count; s++) {
    orb_locator_destroy(ctx, f.locator[s]);
  }
  orb_free(ctx, f.locator);
  orb_free(ctx, f.twin);
  orb_free(ctx, f.area);
  return status;
}
