/* How far a reconstructed shape is from its input.
 *
 * Both surfaces are sampled (vertices, edge midpoints, face centres) and each sample's nearest point on the other is
 * found; the greatest distance of both ways is the sampled Hausdorff distance. The mean square is integrated with the
 * rule of seven points that is exact for cubics (1/20 a corner, 2/15 a midpoint, 9/20 the centre), each surface
 * weighing the same. Supermesh vertices lie on the input by construction and are not looked up. Normals are those of
 * the flat triangles, compared at the face centres and their nearest points.
 */
#include <math.h>
#include <string.h>

#include "base/check.h"
#include "numeric/vec3.h"
#include "orbmorph/transfer.h"

enum { GRAIN = 256, BINS = 18000 };
static const double DEGREE = 180 / 3.14159265358979323846;

typedef struct surface {
  const double *positions;
  const int32_t *triangles;
  int32_t triangle_count, vertex_count;
  int32_t *twin;
  double *area;      /* a triangle */
  double *ring_area; /* a vertex: of the triangles around it */
  int32_t *first;    /* a vertex: its lowest half-edge, whose triangle samples it */
  orb_nearest *tree;
  double total;
} surface;

typedef struct chunk_sum {
  double worst2, sum2; /* greatest squared distance; ∫ d² */
} chunk_sum;

typedef struct sample_job {
  orb_context *ctx;
  const surface *from, *to;
  int vertices;    /* sample those, too */
  chunk_sum *sums; /* a chunk */
  float *angle;    /* a triangle of `from`: degrees between the normals; −1: none */
} sample_job;

static const double *corner_of(const surface *s, int64_t h) {
  return s->positions + 3 * (int64_t)s->triangles[h];
}

static double triangle_normal(const surface *s, int64_t t, double out[3]) {
  double u[3], w[3];
  orb_sub(corner_of(s, 3 * t + 1), corner_of(s, 3 * t), u);
  orb_sub(corner_of(s, 3 * t + 2), corner_of(s, 3 * t), w);
  orb_cross(u, w, out);
  return 0.5 * orb_normalize(out);
}

static void surface_free(orb_context *ctx, surface *s) {
  orb_nearest_destroy(ctx, s->tree);
  orb_free(ctx, s->twin);
  orb_free(ctx, s->area);
  orb_free(ctx, s->ring_area);
  orb_free(ctx, s->first);
}

static orb_status surface_prepare(orb_context *ctx, surface *s) {
  s->twin = ORB_NEW(ctx, int32_t, 3 * (int64_t)s->triangle_count);
  s->area = ORB_NEW(ctx, double, s->triangle_count);
  s->ring_area = ORB_NEW0(ctx, double, s->vertex_count);
  s->first = ORB_NEW(ctx, int32_t, s->vertex_count);
  if (!s->twin || !s->area || !s->ring_area || !s->first) {
    return ORB_E_NO_MEMORY;
  }
  ORB_TRY(orb_mesh_twins(ctx, s->triangles, s->triangle_count, s->vertex_count, s->twin));
  ORB_TRY(orb_nearest_create(ctx, s->positions, s->triangles, s->triangle_count, &s->tree));
  for (int64_t t = 0; t < s->triangle_count; t++) {
    double normal[3];
    s->area[t] = triangle_normal(s, t, normal);
    s->total += s->area[t];
    for (int k = 0; k < 3; k++) {
      s->ring_area[s->triangles[3 * t + k]] += s->area[t];
    }
  }
  for (int32_t h = 3 * s->triangle_count - 1; h >= 0; h--) {
    s->first[s->triangles[h]] = h;
  }
  return orb_context_check(ctx);
}

static orb_place add_sample(const sample_job *job, const double p[3], double weight, chunk_sum *sum) {
  orb_place place;
  double distance2 = orb_nearest_query(job->to->tree, p, INFINITY, &place);
  sum->worst2 = distance2 > sum->worst2 ? distance2 : sum->worst2;
  sum->sum2 += weight * distance2;
  return place;
}

/* The centre of triangle t, the midpoints of its edges and the corners that are its to sample. */
static void sample_triangle(sample_job *job, int64_t t, chunk_sum *sum) {
  const surface *from = job->from;
  double centre[3] = {0};
  for (int64_t h = 3 * t; h < 3 * t + 3; h++) {
    const double *a = corner_of(from, h), *b = corner_of(from, orb_next((int32_t)h));
    double middle[3];
    for (int c = 0; c < 3; c++) {
      centre[c] += a[c] / 3;
      middle[c] = 0.5 * (a[c] + b[c]);
    }
    int32_t vertex = from->triangles[h], twin = from->twin[h];
    if (h < twin) {
      add_sample(job, middle, 2.0 / 15 * (from->area[t] + from->area[twin / 3]), sum);
    }
    if (job->vertices && from->first[vertex] == h) {
      add_sample(job, a, 1.0 / 20 * from->ring_area[vertex], sum);
    }
  }
  orb_place place = add_sample(job, centre, 9.0 / 20 * from->area[t], sum);
  double here[3], there[3], cross[3];
  job->angle[t] = -1;
  if (place.triangle >= 0 && triangle_normal(from, t, here) > 0 &&
      triangle_normal(job->to, place.triangle, there) > 0) {
    orb_cross(here, there, cross);
    job->angle[t] = (float)(atan2(orb_length(cross), orb_dot(here, there)) * DEGREE);
  }
}

static void sample_body(void *arg, int64_t begin, int64_t end, int thread) {
  sample_job *job = arg;
  (void)thread;
  chunk_sum sum = {0};
  if (orb_context_check(job->ctx) == ORB_OK) {
    for (int64_t t = begin; t < end; t++) {
      sample_triangle(job, t, &sum);
    }
  }
  job->sums[begin / GRAIN] = sum;
}

/* What both ways add up to. */
typedef struct totals {
  double worst2, mean2; /* of the distance */
  double angle_sum, angle_weight;
  double *bins; /* BINS of a hundredth of a degree */
} totals;

static orb_status one_way(orb_context *ctx, const surface *from, const surface *to, int vertices, totals *all) {
  int64_t chunks = ((int64_t)from->triangle_count + GRAIN - 1) / GRAIN;
  sample_job job = {
      ctx, from, to, vertices, ORB_NEW(ctx, chunk_sum, chunks), ORB_NEW(ctx, float, from->triangle_count)};
  orb_status status = job.sums && job.angle ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    orb_parallel_for(ctx, from->triangle_count, GRAIN, sample_body, &job);
    status = orb_context_check(ctx);
  }
  if (status == ORB_OK && from->total > 0) {
    double sum2 = 0;
    for (int64_t i = 0; i < chunks; i++) {
      sum2 += job.sums[i].sum2;
      all->worst2 = fmax(all->worst2, job.sums[i].worst2);
    }
    all->mean2 += 0.5 * sum2 / from->total;
    for (int32_t t = 0; t < from->triangle_count; t++) {
      if (job.angle[t] >= 0) {
        double weight = from->area[t] / from->total;
        int bin = (int)((double)job.angle[t] * 100);
        all->bins[bin < BINS ? bin : BINS - 1] += weight;
        all->angle_sum += weight * (double)job.angle[t];
        all->angle_weight += weight;
      }
    }
  }
  orb_free(ctx, job.sums);
  orb_free(ctx, job.angle);
  return status;
}

static double percentile_99(const totals *all) {
  double sum = 0;
  for (int i = 0; i < BINS; i++) {
    sum += all->bins[i];
    if (sum >= 0.99 * all->angle_weight) {
      return (i + 1) / 100.0;
    }
  }
  return 180;
}

static void fill_report(const surface *made, const totals *all, orb_shape_report *out) {
  out->hausdorff_sampled = sqrt(all->worst2);
  out->rms = sqrt(all->mean2);
  out->normal_mean = all->angle_weight > 0 ? all->angle_sum / all->angle_weight : 0;
  out->normal_p99 = all->angle_weight > 0 ? percentile_99(all) : 0;
  double least = INFINITY;
  for (int32_t t = 0; t < made->triangle_count; t++) {
    least = made->area[t] < least ? made->area[t] : least;
  }
  out->min_area_ratio = made->total > 0 ? least * made->triangle_count / made->total : 0;
}

orb_status orb_shape_measure(orb_context *ctx, const orb_aligned_shape *shape, const orb_supermesh *supermesh,
                             int32_t shape_index, orb_shape_report *out) {
  const orb_mesh *mesh = &shape->mesh;
  const orb_place *places = supermesh->places + (int64_t)shape_index * supermesh->vertex_count;
  orb_extent extent;
  orb_mesh_extent(mesh, &extent);
  memset(out, 0, sizeof *out);
  out->diagonal = extent.diagonal;
  out->hausdorff = supermesh->error_bound ? supermesh->error_bound[shape_index] : (double)NAN;
  double *positions = ORB_NEW(ctx, double, 3 * (int64_t)supermesh->vertex_count);
  totals all = {.bins = ORB_NEW0(ctx, double, BINS)};
  surface input = {.positions = mesh->positions,
                   .triangles = mesh->triangles,
                   .triangle_count = mesh->triangle_count,
                   .vertex_count = mesh->vertex_count};
  surface made = {.positions = positions,
                  .triangles = supermesh->triangles,
                  .triangle_count = supermesh->triangle_count,
                  .vertex_count = supermesh->vertex_count};
  orb_status status = positions && all.bins ? ORB_OK : ORB_E_NO_MEMORY;
  if (status != ORB_OK) {
    goto done;
  }
  ORB_GO(status, orb_transfer_positions(ctx, shape, places, supermesh->vertex_count, positions), done);
  ORB_GO(status, surface_prepare(ctx, &input), done);
  ORB_GO(status, surface_prepare(ctx, &made), done);
  ORB_GO(status, one_way(ctx, &made, &input, 0, &all), done);
  ORB_GO(status, one_way(ctx, &input, &made, 1, &all), done);
  fill_report(&made, &all, out);
done:
  surface_free(ctx, &input);
  surface_free(ctx, &made);
  orb_free(ctx, positions);
  orb_free(ctx, all.bins);
  return status;
}
