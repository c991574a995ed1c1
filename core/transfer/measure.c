/* How far a reconstructed shape is from its input.
 *
 * Both surfaces are sampled (vertices, edge midpoints, face centres), and each sample's nearest point on the other is
 * found; the greatest distance of both ways is the sampled Hausdorff distance. The mean square is integrated by the
 * rule of seven points that is exact for cubics (1/20 a corner, 2/15 a midpoint, 9/20 the centre), with equal weight
 * for both surfaces. Supermesh vertices lie on the input by construction and are not sampled. Normals are those of the
 * flat triangles, compared at the face centres and their nearest points.
 *
 * Most samples need no search. A supermesh triangle whose corners have their places in one triangle of the input lies
 * on it, and so do its samples, by interpolation of the corners' coordinates; the other way, a sample of an input
 * triangle is compared with the supermesh triangles that lie in it. A distance up to SETTLED, which is rounding, is
 * accepted. Only the remaining samples query the tree of the other surface, starting from the nearest place known. The
 * tree is built when the first sample needs it, so never for an exact overlay. */
#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "base/parallel.h"
#include "mesh/nearest.h"
#include "numeric/vec3.h"
#include "orbmorph/transfer.h"
#include "transfer/inside.h"

enum { GRAIN = 256 };  /* triangles a thread takes at a time; the sums, and so the result, depend on it */
enum { BINS = 18000 }; /* of the histogram of angles: a hundredth of a degree each */
static const double DEGREE = 180 / 3.14159265358979323846;
static const double SETTLED = 1e-13; /* relative to the diagonal */
/* Relative to the square of SETTLED: a search for a nearer triangle would not change the result. */
static const double EXACT = 1e-6;

typedef struct surface {
  const double *positions;
  const int32_t *triangles;
  int32_t triangle_count, vertex_count;
  int32_t *twin;
  double *area;      /* per triangle */
  double *ring_area; /* per vertex: of the triangles around it */
  int32_t *first;    /* per vertex: its lowest half-edge, whose triangle samples it */
  orb_nearest *tree;
  double total;
  const orb_place *places;  /* of the supermesh's vertices on the input; NULL: this is the input */
  const orb_inside *inside; /* which triangles of the supermesh lie in which of the input */
} surface;

typedef struct chunk_sum {
  double worst2, sum2; /* greatest squared distance; ∫ d² */
  int unsettled;       /* a sample needs the tree, and there is none yet */
} chunk_sum;

/* A point of triangle `triangle` with its coordinates there. */
typedef struct sample {
  double p[3], at[3];
  int32_t triangle;
} sample;

typedef struct sample_job {
  orb_context *ctx;
  const surface *from, *to;
  int vertices;    /* sample the vertices too */
  double settled2; /* squared distances up to this are rounding */
  chunk_sum *sums; /* per chunk of GRAIN triangles */
  float *angle;    /* per triangle of `from`: degrees between the normals; −1: none */
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

static double distance2_to(const surface *to, int32_t t, const double p[3], double at[3]) {
  double corners[9];
  for (int k = 0; k < 3; k++) {
    memcpy(corners + 3 * k, corner_of(to, 3 * (int64_t)t + k), 3 * sizeof(double));
  }
  return orb_triangle_nearest(corners, p, at);
}

/* The squared distance to the point of the input that the places of its triangle's corners give for the sample. */
static double known_on_input(const sample_job *job, const sample *s, orb_place *known) {
  const surface *from = job->from, *to = job->to;
  int32_t own = from->inside->of[s->triangle];
  if (own < 0) {
    return INFINITY;
  }
  double d[3] = {s->p[0], s->p[1], s->p[2]};
  for (int i = 0; i < 3; i++) {
    double at[3];
    const orb_place *place = &from->places[from->triangles[3 * (int64_t)s->triangle + i]];
    ORB_ASSERT(orb_place_in(to->triangles, place, own, at));
    for (int k = 0; s->at[i] != 0 && k < 3; k++) {
      const double *corner = corner_of(to, 3 * (int64_t)own + k);
      for (int c = 0; c < 3; c++) {
        d[c] -= s->at[i] * at[k] * corner[c];
      }
    }
  }
  known->triangle = own;
  return orb_dot(d, d);
}

/* The squared distance to the nearest of the supermesh triangles that lie in the sample's triangle. */
static double known_on_made(const sample_job *job, const sample *s, orb_place *known) {
  const orb_inside *inside = job->from->inside;
  double best = INFINITY;
  for (int32_t i = inside->first[s->triangle]; i < inside->first[s->triangle + 1] && best > EXACT * job->settled2;
       i++) {
    double at[3], distance2 = distance2_to(job->to, inside->held[i], s->p, at);
    if (distance2 < best) {
      best = distance2;
      known->triangle = inside->held[i];
      memcpy(known->at, at, sizeof at);
    }
  }
  return best;
}

/* Adds a sample. *near: in, the place found for the previous sample; out, for this one. */
static void add_sample(const sample_job *job, const sample *s, double weight, orb_place *near, chunk_sum *sum) {
  orb_place known = {.triangle = -1};
  double distance2 = job->from->places ? known_on_input(job, s, &known) : known_on_made(job, s, &known);
  if (!(distance2 <= job->settled2)) {
    if (!job->to->tree) {
      sum->unsettled = 1;
      return;
    }
    known.triangle = known.triangle >= 0 ? known.triangle : near->triangle;
    if (known.triangle >= 0) {
      distance2 = distance2_to(job->to, known.triangle, s->p, known.at);
    }
    distance2 = orb_nearest_query_from(job->to->tree, s->p, &known, distance2, &known);
  }
  *near = known;
  sum->worst2 = distance2 > sum->worst2 ? distance2 : sum->worst2;
  sum->sum2 += weight * distance2;
}

/* Samples the centre of triangle t, the midpoints of its edges with the lower half-edge, and the vertices whose lowest
 * half-edge it has. */
static void sample_triangle(sample_job *job, int32_t t, orb_place *near, chunk_sum *sum) {
  const surface *from = job->from;
  sample centre = {.at = {1.0 / 3, 1.0 / 3, 1.0 / 3}, .triangle = t};
  for (int32_t k = 0, h = 3 * t; k < 3; k++, h++) {
    const double *a = corner_of(from, h), *b = corner_of(from, orb_next(h));
    sample middle = {.triangle = t}, corner = {.p = {a[0], a[1], a[2]}, .triangle = t};
    middle.at[k] = middle.at[(k + 1) % 3] = 0.5;
    corner.at[k] = 1;
    for (int c = 0; c < 3; c++) {
      centre.p[c] += a[c] / 3;
      middle.p[c] = 0.5 * (a[c] + b[c]);
    }
    int32_t vertex = from->triangles[h], twin = from->twin[h];
    if (h < twin) {
      add_sample(job, &middle, 2.0 / 15 * (from->area[t] + from->area[twin / 3]), near, sum);
    }
    if (job->vertices && from->first[vertex] == h) {
      add_sample(job, &corner, 1.0 / 20 * from->ring_area[vertex], near, sum);
    }
  }
  add_sample(job, &centre, 9.0 / 20 * from->area[t], near, sum);
  double here[3], there[3], cross[3];
  job->angle[t] = -1;
  if (near->triangle >= 0 && triangle_normal(from, t, here) > 0 &&
      triangle_normal(job->to, near->triangle, there) > 0) {
    orb_cross(here, there, cross);
    job->angle[t] = (float)(atan2(orb_length(cross), orb_dot(here, there)) * DEGREE);
  }
}

static void sample_body(void *arg, int64_t begin, int64_t end, int thread) {
  sample_job *job = arg;
  (void)thread;
  chunk_sum sum = {0};
  if (orb_context_check(job->ctx) == ORB_OK) {
    orb_place near = {.triangle = -1};
    for (int64_t t = begin; t < end && !sum.unsettled; t++) {
      sample_triangle(job, (int32_t)t, &near, &sum);
    }
  }
  job->sums[begin / GRAIN] = sum;
}

/* The sums of both ways. */
typedef struct totals {
  double worst2, mean2; /* of the distance */
  double angle_sum, angle_weight;
  double *bins; /* BINS weights */
} totals;

/* Takes all samples; if some need the tree, builds it and takes all again. */
static orb_status take_samples(sample_job *job, surface *to, int64_t chunks) {
  orb_context *ctx = job->ctx;
  int32_t count = job->from->triangle_count;
  orb_parallel_for(ctx, count, GRAIN, sample_body, job);
  int unsettled = 0;
  for (int64_t i = 0; i < chunks; i++) {
    unsettled |= job->sums[i].unsettled;
  }
  if (unsettled && orb_context_check(ctx) == ORB_OK) {
    ORB_TRY(orb_nearest_create(ctx, to->positions, to->triangles, to->triangle_count, &to->tree));
    orb_parallel_for(ctx, count, GRAIN, sample_body, job);
  }
  return orb_context_check(ctx);
}

static orb_status one_way(orb_context *ctx, const surface *from, surface *to, double diagonal, totals *all) {
  int64_t chunks = ((int64_t)from->triangle_count + GRAIN - 1) / GRAIN;
  sample_job job = {ctx,
                    from,
                    to,
                    !from->places,
                    SETTLED * SETTLED * diagonal * diagonal,
                    ORB_NEW(ctx, chunk_sum, chunks),
                    ORB_NEW(ctx, float, from->triangle_count)};
  orb_status status = job.sums && job.angle ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    status = take_samples(&job, to, chunks);
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
                  .vertex_count = supermesh->vertex_count,
                  .places = places};
  orb_inside inside = {0};
  orb_status status = positions && all.bins ? ORB_OK : ORB_E_NO_MEMORY;
  if (status != ORB_OK) {
    goto done;
  }
  ORB_GO(status, orb_transfer_positions(ctx, shape, places, supermesh->vertex_count, positions), done);
  ORB_GO(status, surface_prepare(ctx, &input), done);
  ORB_GO(status, surface_prepare(ctx, &made), done);
  ORB_GO(status,
         orb_inside_make(ctx, mesh, input.twin, supermesh->triangles, supermesh->triangle_count, places, &inside),
         done);
  made.inside = input.inside = &inside;
  ORB_GO(status, one_way(ctx, &made, &input, extent.diagonal, &all), done);
  ORB_GO(status, one_way(ctx, &input, &made, extent.diagonal, &all), done);
  fill_report(&made, &all, out);
done:
  orb_inside_free(ctx, &inside);
  surface_free(ctx, &input);
  surface_free(ctx, &made);
  orb_free(ctx, positions);
  orb_free(ctx, all.bins);
  return status;
}
