/* The Laplace–Beltrami operator of linear finite elements: cotangent weights (Pinkall & Polthier 1993) and lumped
 * mass, a third of the area around each vertex. */
#include "spectral/shape.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "numeric/vec3.h"
#include "spectral/distances.h"
#include "spectral/eigen.h"

enum { LEAST = 4 * ORB_SPECTRAL_FUNCTIONS }; /* least vertices of a usable shape */

static const double FLAT = 1e-9; /* of the mean area: a triangle with less counts as having this much */

typedef struct work {
  orb_context *ctx;
  int32_t vertices, triangles;
  const int32_t *corner;
  double *x, *mass, *normal; /* positions in units of √area; 3 per vertex: area normals */
  orb_entry *entries;
} work;

static void work_free(work *w) {
  orb_free(w->ctx, w->x);
  orb_free(w->ctx, w->mass);
  orb_free(w->ctx, w->normal);
  orb_free(w->ctx, w->entries);
}

/* Twice the area of the triangle v. */
static double triangle_area2(const double *x, const int32_t *v, double normal[3]) {
  orb_triangle_normal_at(x, v, normal);
  return orb_length(normal);
}

/* Scales positions so that the area is 1. Returns 0 if there is no area. */
static int scale_positions(const orb_mesh *mesh, double *x) {
  double area = 0, normal[3];
  for (int32_t t = 0; t < mesh->triangle_count; t++) {
    area += triangle_area2(mesh->positions, mesh->triangles + 3 * (size_t)t, normal) / 2;
  }
  for (size_t i = 0; i < 3 * (size_t)mesh->vertex_count; i++) {
    x[i] = mesh->positions[i] / sqrt(area);
  }
  return area > 0 && isfinite(area);
}

/* Entries of the stiffness matrix, lumped masses and vertex normals. */
static void assemble(work *w) {
  double least = FLAT * 2 / w->triangles;
  orb_entry *e = w->entries;
  for (int32_t t = 0; t < w->triangles; t++) {
    const int32_t *v = w->corner + 3 * (size_t)t;
    double normal[3], area2 = fmax(triangle_area2(w->x, v, normal), least);
    for (int k = 0; k < 3; k++) {
      int32_t a = v[k], b = v[(k + 1) % 3], c = v[(k + 2) % 3];
      double p[3], q[3];
      orb_sub(w->x + 3 * (size_t)a, w->x + 3 * (size_t)c, p);
      orb_sub(w->x + 3 * (size_t)b, w->x + 3 * (size_t)c, q);
      double half_cotangent = orb_dot(p, q) / area2 / 2;
      *e++ = (orb_entry){a, b, -half_cotangent};
      *e++ = (orb_entry){b, a, -half_cotangent};
      *e++ = (orb_entry){a, a, half_cotangent};
      *e++ = (orb_entry){b, b, half_cotangent};
      w->mass[a] += area2 / 6;
      for (int i = 0; i < 3; i++) {
        w->normal[3 * (size_t)a + (size_t)i] += normal[i];
      }
    }
  }
  for (int32_t v = 0; v < w->vertices; v++) {
    (void)orb_normalize(w->normal + 3 * (size_t)v);
  }
}

/* The share of the area that each of the samples so far owns. */
static void fill_shares(const work *w, const int32_t *owner, int32_t count, double *share) {
  double sum = 0;
  for (int32_t v = 0; v < w->vertices; v++) {
    share[owner[v]] += w->mass[v];
    sum += w->mass[v];
  }
  for (int i = 0; i < count; i++) {
    share[i] /= sum;
  }
}

/* Samples by farthest points along the surface, from the point farthest from vertex 0, and the distances between them.
 * buffer: two doubles per vertex. */
static void spread(const work *w, orb_distances *distances, double *buffer, int32_t *owner, orb_spectral_shape *out) {
  double *far = buffer, *one = buffer + w->vertices;
  orb_distances_from(distances, 0, far);
  int32_t next = 0;
  for (int32_t v = 0; v < w->vertices; v++) {
    next = far[v] > far[next] ? v : next;
  }
  for (int32_t i = 0; i < ORB_SPECTRAL_SAMPLES; i++) {
    out->sample[i] = next;
    orb_distances_from(distances, next, one);
    for (int32_t v = 0; v < w->vertices; v++) {
      if (i == 0 || one[v] < far[v]) {
        far[v] = one[v];
        owner[v] = i;
      }
      next = far[v] > far[next] ? v : next;
    }
    for (int32_t k = 0; k <= i; k++) {
      out->distance[i * ORB_SPECTRAL_SAMPLES + k] = out->distance[k * ORB_SPECTRAL_SAMPLES + i] =
          (float)one[out->sample[k]];
    }
    for (int detail = 0; detail < ORB_SPECTRAL_DETAILS; detail++) {
      if (i + 1 == orb_spectral_samples(detail)) {
        fill_shares(w, owner, i + 1, out->share[detail]);
      }
    }
  }
}

static void fill_samples(const work *w, orb_spectral_shape *out) {
  for (int k = 0; k < ORB_SPECTRAL_FUNCTIONS; k++) {
    for (int s = 0; s < ORB_SPECTRAL_SAMPLES; s++) {
      out->at[k][s] = (float)out->function[(size_t)k * (size_t)w->vertices + (size_t)out->sample[s]];
    }
  }
}

static void fill_heights(const work *w, orb_spectral_shape *out) {
  for (int32_t i = 0; i < ORB_SPECTRAL_SAMPLES; i++) {
    size_t a = 3 * (size_t)out->sample[i];
    for (int32_t k = 0; k < ORB_SPECTRAL_SAMPLES; k++) {
      double d[3];
      orb_sub(w->x + 3 * (size_t)out->sample[k], w->x + a, d);
      out->height[i * ORB_SPECTRAL_SAMPLES + k] = (float)orb_dot(w->normal + a, d);
    }
  }
}

/* Gradients of the first functions after the constant one at every vertex: means of those of its triangles, weighted by
 * area. The weight cancels, but for a factor that is positive. */
static void add_gradients(const work *w, const double *function, double *gradient) {
  for (int32_t t = 0; t < w->triangles; t++) {
    const int32_t *v = w->corner + 3 * (size_t)t;
    double normal[3], sum[3] = {0};
    if (!(triangle_area2(w->x, v, normal) > 0)) {
      continue;
    }
    (void)orb_normalize(normal);
    for (int k = 0; k < 3; k++) {
      double edge[3], rotated[3];
      orb_sub(w->x + 3 * (size_t)v[(k + 2) % 3], w->x + 3 * (size_t)v[(k + 1) % 3], edge);
      orb_cross(normal, edge, rotated);
      for (int i = 0; i < 3; i++) {
        sum[i] += function[v[k]] * rotated[i];
      }
    }
    for (int k = 0; k < 3; k++) {
      for (int i = 0; i < 3; i++) {
        gradient[3 * (size_t)v[k] + (size_t)i] += sum[i];
      }
    }
  }
}

static void fill_triples(const work *w, double *gradient, orb_spectral_shape *out) {
  size_t n = 3 * (size_t)w->vertices;
  memset(gradient, 0, ORB_SPECTRAL_GRADIENTS * n * sizeof *gradient);
  for (int k = 0; k < ORB_SPECTRAL_GRADIENTS; k++) {
    add_gradients(w, out->function + (size_t)(k + 1) * (size_t)w->vertices, gradient + (size_t)k * n);
  }
  for (int s = 0; s < ORB_SPECTRAL_SAMPLES; s++) {
    size_t v = 3 * (size_t)out->sample[s];
    for (int i = 0, at = 0; i < ORB_SPECTRAL_GRADIENTS; i++) {
      for (int k = i + 1; k < ORB_SPECTRAL_GRADIENTS; k++, at++) {
        out->triple[at][s] = (float)orb_det(w->normal + v, gradient + (size_t)i * n + v, gradient + (size_t)k * n + v);
      }
    }
  }
}

static orb_status fill(work *w, const orb_mesh *mesh, orb_spectral_shape *out) {
  orb_status status = ORB_E_NO_MEMORY;
  size_t n = (size_t)w->vertices;
  orb_distances distances = {0};
  orb_mesh scaled = *mesh;
  double *buffer = ORB_NEW(w->ctx, double, 3 * ORB_SPECTRAL_GRADIENTS * n);
  int32_t *owner = ORB_NEW(w->ctx, int32_t, n);
  if (!buffer || !owner) {
    goto end;
  }
  assemble(w);
  ORB_GO(status,
         orb_eigen_lowest(w->ctx, w->vertices, w->entries, 12 * (int64_t)w->triangles, w->mass, ORB_SPECTRAL_FUNCTIONS,
                          out->value, out->function, &out->is_usable),
         end);
  if (out->is_usable) {
    scaled.positions = w->x;
    ORB_GO(status, orb_distances_create(w->ctx, &scaled, &distances), end);
    spread(w, &distances, buffer, owner, out);
    fill_samples(w, out);
    fill_heights(w, out);
    fill_triples(w, buffer, out);
  }
end:
  orb_distances_free(w->ctx, &distances);
  orb_free(w->ctx, buffer);
  orb_free(w->ctx, owner);
  return status;
}

orb_status orb_spectral_shape_create(orb_context *ctx, const orb_mesh *mesh, int mirrored, orb_spectral_shape *out) {
  size_t n = (size_t)mesh->vertex_count;
  memset(out, 0, sizeof *out);
  out->mesh = mesh;
  if (mesh->vertex_count < LEAST) {
    return ORB_OK;
  }
  work w = {.ctx = ctx, .vertices = mesh->vertex_count, .triangles = mesh->triangle_count, .corner = mesh->triangles};
  w.x = ORB_NEW(ctx, double, 3 * n);
  w.mass = ORB_NEW0(ctx, double, n);
  w.normal = ORB_NEW0(ctx, double, 3 * n);
  w.entries = ORB_NEW(ctx, orb_entry, 12 * (size_t)mesh->triangle_count);
  out->function = ORB_NEW(ctx, double, (size_t)ORB_SPECTRAL_FUNCTIONS *n);
  out->distance = ORB_NEW(ctx, float, (size_t)ORB_SPECTRAL_SAMPLES *ORB_SPECTRAL_SAMPLES);
  out->height = ORB_NEW(ctx, float, (size_t)ORB_SPECTRAL_SAMPLES *ORB_SPECTRAL_SAMPLES);
  orb_status status = ORB_E_NO_MEMORY;
  if (w.x && w.mass && w.normal && w.entries && out->function && out->distance && out->height) {
    status = scale_positions(mesh, w.x) ? fill(&w, mesh, out) : ORB_OK;
  }
  work_free(&w);
  if (mirrored) {
    orb_spectral_shape_mirror(out);
  }
  return status;
}

void orb_spectral_shape_mirror(orb_spectral_shape *shape) {
  for (int at = 0; at < ORB_SPECTRAL_TRIPLES; at++) {
    for (int s = 0; s < ORB_SPECTRAL_SAMPLES; s++) {
      shape->triple[at][s] = -shape->triple[at][s];
    }
  }
}

void orb_spectral_shape_free(orb_context *ctx, orb_spectral_shape *shape) {
  orb_free(ctx, shape->function);
  orb_free(ctx, shape->distance);
  orb_free(ctx, shape->height);
  shape->function = NULL;
  shape->distance = shape->height = NULL;
}
