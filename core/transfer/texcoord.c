/* Texture coordinates at the corners of a supermesh.
 *
 * A triangle that blends coordinates from both sides of a seam shows the whole texture between them, smeared. So each
 * supermesh triangle keeps to the side on which its centre lies: a walk goes straight on the sphere from the centre to
 * each corner, from input triangle to input triangle. Where it meets a seam (of coordinates or materials) it ends, and
 * the corner gets the coordinates of that point of the seam. The texture there is squeezed by less than a triangle. */
#include "transfer/texcoord.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "base/parallel.h"
#include "numeric/predicates.h"
#include "numeric/vec3.h"

enum { GRAIN = 512 };            /* triangles a thread takes at a time */
enum { MAX_STEPS = 100000 };     /* of a walk, so that rounding cannot make it endless */
static const float SAME = 1e-5f; /* coordinates that differ by less are one: a fraction of a texel */

typedef struct texcoord_job {
  orb_context *ctx;
  const orb_supermesh *supermesh;
  const orb_aligned_shape *shape;
  const orb_place *places; /* of the supermesh's vertices on the shape */
  const orb_locator *locator;
  const int32_t *twin, *home;
  int32_t *home_out;
  const float *texcoords;  /* 2 per corner of the shape */
  const int32_t *material; /* of each triangle: where it changes is a seam, too; NULL: there are none */
  float *corners;          /* 2 per corner of the supermesh */
} texcoord_job;

static void centre_of(const orb_supermesh *supermesh, int64_t t, double out[3]) {
  out[0] = out[1] = out[2] = 0;
  for (int k = 0; k < 3; k++) {
    const double *p = supermesh->points + 3 * (int64_t)supermesh->triangles[3 * t + k];
    for (int c = 0; c < 3; c++) {
      out[c] += p[c];
    }
  }
  orb_normalize(out);
}

static void home_body(void *arg, int64_t begin, int64_t end, int thread) {
  texcoord_job *job = arg;
  (void)thread;
  if (orb_context_check(job->ctx) != ORB_OK) {
    return;
  }
  for (int64_t t = begin; t < end; t++) {
    double centre[3];
    orb_place place;
    centre_of(job->supermesh, t, centre);
    orb_locate(job->locator, centre, job->places[job->supermesh->triangles[3 * t]].triangle, &place);
    job->home_out[t] = place.triangle;
  }
}

orb_status orb_home_triangles(orb_context *ctx, const orb_supermesh *supermesh, const orb_aligned_shape *shape,
                              int32_t s, int32_t *out) {
  orb_locator *locator = NULL;
  ORB_TRY(orb_locator_create(ctx, shape->points, shape->mesh.vertex_count, shape->mesh.triangles,
                             shape->mesh.triangle_count, NULL, &locator));
  texcoord_job job = {.ctx = ctx,
                      .supermesh = supermesh,
                      .places = supermesh->places + (int64_t)s * supermesh->vertex_count,
                      .locator = locator,
                      .home_out = out};
  orb_parallel_for(ctx, supermesh->triangle_count, GRAIN, home_body, &job);
  orb_locator_destroy(ctx, locator);
  return orb_context_check(ctx);
}

static const double *point_of(const texcoord_job *job, int32_t h) {
  return job->shape->points + 3 * (int64_t)job->shape->mesh.triangles[h];
}

static int same_texcoord(const float *texcoords, int32_t g, int32_t h) {
  return fabsf(texcoords[2 * (int64_t)g] - texcoords[2 * (int64_t)h]) <= SAME &&
         fabsf(texcoords[2 * (int64_t)g + 1] - texcoords[2 * (int64_t)h + 1]) <= SAME;
}

static int is_seam(const texcoord_job *job, int32_t h) {
  int32_t g = job->twin[h];
  return (job->material && job->material[g / 3] != job->material[h / 3]) ||
         !same_texcoord(job->texcoords, h, orb_next(g)) || !same_texcoord(job->texcoords, orb_next(h), g);
}

/* The edge over which the straight line from m to p leaves triangle t; −1 if p lies inside. */
static int32_t exit_edge(const texcoord_job *job, int32_t t, const double m[3], const double p[3]) {
  int32_t out[3];
  int count = 0;
  for (int32_t h = 3 * t; h < 3 * t + 3; h++) {
    if (orb_orient(point_of(job, h), point_of(job, orb_next(h)), p) < 0) {
      out[count++] = h;
    }
  }
  if (count == 0) {
    return -1;
  }
  if (count == 1) {
    return out[0];
  }
  /* p lies beyond two edges, so the corner that they share decides: it is left or right of the line. Seen from inside,
   * edges run from right to left, so the edge that ends at the corner lies to its right. */
  int32_t ends = orb_next(out[0]) == out[1] ? out[0] : out[1];
  int32_t begins = ends == out[0] ? out[1] : out[0];
  return orb_orient(m, p, point_of(job, begins)) > 0 ? ends : begins;
}

static double fraction_of(double a, double b) {
  double sum = a + b;
  return sum > 0 ? a / sum : 0.5;
}

/* The coordinates at the point where the line from m to p meets half-edge h. */
static void at_edge(const texcoord_job *job, int32_t h, const double m[3], const double p[3], float out[2]) {
  const float *texcoords = job->texcoords;
  int32_t next = orb_next(h);
  double w = fraction_of(fabs(orb_det(m, p, point_of(job, next))), fabs(orb_det(m, p, point_of(job, h))));
  for (int c = 0; c < 2; c++) {
    out[c] = (float)(w * (double)texcoords[2 * (int64_t)h + c] + (1 - w) * (double)texcoords[2 * (int64_t)next + c]);
  }
}

/* The coordinates at p inside triangle t. */
static void at_point(const texcoord_job *job, int32_t t, const double p[3], float out[2]) {
  const float *texcoords = job->texcoords;
  double weight[3], sum = 0, value[2] = {0};
  for (int k = 0; k < 3; k++) {
    weight[k] = fmax(0, orb_det(p, point_of(job, 3 * t + (k + 1) % 3), point_of(job, 3 * t + (k + 2) % 3)));
    sum += weight[k];
  }
  for (int k = 0; k < 3; k++) {
    double w = sum > 0 ? weight[k] / sum : 1.0 / 3;
    value[0] += w * (double)texcoords[2 * (3 * (int64_t)t + k)];
    value[1] += w * (double)texcoords[2 * (3 * (int64_t)t + k) + 1];
  }
  out[0] = (float)value[0];
  out[1] = (float)value[1];
}

static void corner_texcoord(const texcoord_job *job, int32_t home, const double m[3], int32_t vertex, float out[2]) {
  const double *p = job->supermesh->points + 3 * (int64_t)vertex;
  int32_t t = home;
  for (int step = 0; step < MAX_STEPS; step++) {
    int32_t edge = exit_edge(job, t, m, p);
    if (edge < 0) {
      at_point(job, t, p, out);
      return;
    }
    if (is_seam(job, edge)) {
      at_edge(job, edge, m, p, out);
      return;
    }
    t = job->twin[edge] / 3;
  }
  at_point(job, job->places[vertex].triangle, p, out);
}

static void corner_body(void *arg, int64_t begin, int64_t end, int thread) {
  texcoord_job *job = arg;
  (void)thread;
  if (orb_context_check(job->ctx) != ORB_OK) {
    return;
  }
  for (int64_t t = begin; t < end; t++) {
    double m[3];
    centre_of(job->supermesh, t, m);
    for (int64_t h = 3 * t; h < 3 * t + 3; h++) {
      corner_texcoord(job, job->home[t], m, job->supermesh->triangles[h], job->corners + 2 * h);
    }
  }
}

static orb_status gather(orb_context *ctx, const texcoord_job *job, orb_wedges *out) {
  const orb_supermesh *supermesh = job->supermesh;
  orb_wedge_chain chain = {0};
  orb_status status;
  out->width = 2;
  out->value_count = supermesh->vertex_count;
  out->values = ORB_NEW(ctx, float, 2 * (int64_t)supermesh->vertex_count);
  out->of_corner = ORB_NEW(ctx, int32_t, 3 * (int64_t)supermesh->triangle_count);
  if (!out->values || !out->of_corner) {
    return ORB_E_NO_MEMORY;
  }
  ORB_GO(status, orb_wedge_chain_begin(ctx, supermesh->vertex_count, &chain), done);
  for (int64_t h = 0; h < 3 * (int64_t)supermesh->triangle_count; h++) {
    float *value = job->corners + 2 * h;
    value[0] = isfinite(value[0]) ? value[0] + 0.0f : 0;
    value[1] = isfinite(value[1]) ? value[1] + 0.0f : 0;
    ORB_GO(status, orb_wedges_set(ctx, out, supermesh->triangles[h], h, value, SAME, &chain), done);
  }
done:
  orb_free(ctx, chain.next);
  return status;
}

static orb_status make_wedges(orb_context *ctx, texcoord_job *job, orb_wedges *out) {
  const orb_supermesh *supermesh = job->supermesh;
  const orb_mesh *mesh = &job->shape->mesh;
  memset(out, 0, sizeof *out);
  int32_t *twin = ORB_NEW(ctx, int32_t, 3 * (int64_t)mesh->triangle_count);
  float *corners = ORB_NEW0(ctx, float, 6 * (int64_t)supermesh->triangle_count);
  orb_status status = twin && corners ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    status = orb_mesh_twins(ctx, mesh->triangles, mesh->triangle_count, mesh->vertex_count, twin);
  }
  if (status == ORB_OK) {
    job->twin = twin;
    job->corners = corners;
    orb_parallel_for(ctx, supermesh->triangle_count, GRAIN, corner_body, job);
    status = orb_context_check(ctx);
    if (status == ORB_OK) {
      status = gather(ctx, job, out);
    }
  }
  orb_free(ctx, twin);
  orb_free(ctx, corners);
  if (status != ORB_OK) {
    orb_wedges_free(ctx, out);
  }
  return status;
}

orb_status orb_wedge_texcoords(orb_context *ctx, const orb_supermesh *supermesh, const orb_aligned_shape *shape,
                               const int32_t *home, orb_wedges *out) {
  texcoord_job job = {.ctx = ctx,
                      .supermesh = supermesh,
                      .shape = shape,
                      .places = supermesh->places, /* of the first shape */
                      .home = home,
                      .texcoords = shape->mesh.texcoords,
                      .material = shape->mesh.material};
  return make_wedges(ctx, &job, out);
}

orb_status orb_wedge_charts(orb_context *ctx, const orb_supermesh *supermesh, const orb_aligned_shape *shape, int32_t s,
                            const int32_t *home, const float *texcoords, orb_wedges *out) {
  texcoord_job job = {.ctx = ctx,
                      .supermesh = supermesh,
                      .shape = shape,
                      .places = supermesh->places + (int64_t)s * supermesh->vertex_count,
                      .home = home,
                      .texcoords = texcoords,
                      .material = s == 0 ? shape->mesh.material : NULL};
  return make_wedges(ctx, &job, out);
}
