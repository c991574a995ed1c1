/* How far a reconstructed shape is from its input.
 *
 * Both surfaces are sampled (face centres, edge midpoints, vertices), and each sample's nearest point on the other is
 * found; the greatest distance of both ways is the sampled Hausdorff distance. The mean square is integrated by the
 * rule of seven points that is exact for cubics (1/20 per corner, 2/15 per midpoint, 9/20 the centre), with equal
 * weight for both surfaces. Supermesh vertices lie on the input by construction: their distance is 0. Normals are those
 * of the flat triangles, compared at the face centres and their nearest points.
 *
 * Where the distance has a proved bound, the samples only serve the means and the percentile, for which a few thousand
 * suffice. At most ENOUGH of each kind are taken: the items are divided into that many runs of equal length, and a hash
 * of a run's number picks one item of it. A mean is then taken over the area that the samples of a kind stand for. The
 * bound also limits each search.
 *
 * Many samples need no search. A supermesh triangle whose corners have their places in one triangle of the input lies
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

enum { GRAIN = 256 }; /* samples a thread takes at a time; the sums, and so the result, depend on it */
/* Samples of a kind on a surface with a proved bound. A different choice of as many changes the rms and the mean angle
 * by about 2 %. */
enum { ENOUGH = 4096 };
enum { AREA_GRAIN = 4096 }; /* triangles; the mean area depends on it */
enum { BINS = 18000 };      /* of the histogram of angles: a hundredth of a degree each */
static const double DEGREE = 180 / 3.14159265358979323846;
static const double SETTLED = 1e-12; /* relative to the diagonal: places in slivers are rounded to some 5e-13 */
/* Relative to the square of SETTLED: a search for a nearer triangle would not change the result. */
static const double EXACT = 1e-6;
/* Relative: more than the rounding of a distance, so that a search within the bound finds the nearest place. */
static const double BOUND_MARGIN = 1e-6;

typedef enum kind { CENTRES, MIDDLES, VERTICES, KINDS } kind;
static const double SHARE[KINDS] = {9.0 / 20, 3 * 2.0 / 15, 3 * 1.0 / 20}; /* of the kinds in a mean */

typedef struct surface {
  const double *positions;
  const int32_t *triangles;
  int32_t triangle_count, vertex_count;
  orb_nearest *tree;
  const orb_place *places;  /* of the supermesh's vertices on the input; NULL: this is the input */
  const orb_inside *inside; /* which triangles of the supermesh lie in which of the input */
} surface;

typedef struct chunk_sum {
  double worst2;                      /* greatest squared distance */
  double area[KINDS], squares[KINDS]; /* Σ area, Σ area · d², over the areas that the samples stand for */
  int unsettled;                      /* a sample needs the tree, and there is none yet */
} chunk_sum;

/* A point of triangle `triangle` with its coordinates there. */
typedef struct sample {
  double p[3], at[3];
  int32_t triangle;
} sample;

/* One way: from the samples of a surface to the other surface. */
typedef struct sample_job {
  orb_context *ctx;
  const surface *from;
  surface *to;
  int64_t items[KINDS], take[KINDS]; /* how many there are (middles: half-edges), and how many are sampled */
  double bound2;                     /* no squared distance is greater; INFINITY: none is proved */
  double settled2;                   /* squared distances up to this are rounding */
  chunk_sum *sums;                   /* per chunk of GRAIN samples */
  double *angle, *weight;            /* per centre: degrees between the normals, −1: none; the area it stands for */
  orb_status status;                 /* of building the tree of `to` */
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

/* The nearest place on the other surface, from *known: a place at a squared distance, or triangle −1. */
static double search(const sample_job *job, const double p[3], double distance2, orb_place *known) {
  if (known->triangle < 0 || distance2 > job->bound2) {
    distance2 = orb_nearest_query(job->to->tree, p, job->bound2, known);
    return known->triangle >= 0 ? distance2 : orb_nearest_query(job->to->tree, p, INFINITY, known);
  }
  return orb_nearest_query_from(job->to->tree, p, known, distance2, known);
}

/* Adds a sample that stands for an area. *near: in, the place found for the previous sample; out, for this one. */
static void add_sample(const sample_job *job, const sample *s, kind of, double area, orb_place *near, chunk_sum *sum) {
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
    distance2 = search(job, s->p, distance2, &known);
  }
  *near = known;
  sum->worst2 = distance2 > sum->worst2 ? distance2 : sum->worst2;
  sum->area[of] += area;
  sum->squares[of] += area * distance2;
}

/* One item of each of `take` runs; *run: how many items it stands for. */
static int64_t pick(int64_t i, int64_t take, int64_t items, double *run) {
  int64_t begin = i * items / take, end = (i + 1) * items / take;
  uint64_t mixed = ((uint64_t)i + 1) * 0x9e3779b97f4a7c15u; /* multiplicative hashing: 2⁶⁴ over the golden ratio */
  *run = (double)(end - begin);
  return begin + (int64_t)((mixed >> 32) % (uint64_t)(end - begin));
}

static void sample_centre(const sample_job *job, int64_t i, orb_place *near, chunk_sum *sum) {
  const surface *from = job->from;
  double run, here[3], there[3], cross[3];
  int64_t t = pick(i, job->take[CENTRES], job->items[CENTRES], &run);
  sample centre = {.at = {1.0 / 3, 1.0 / 3, 1.0 / 3}, .triangle = (int32_t)t};
  for (int k = 0; k < 3; k++) {
    const double *p = corner_of(from, 3 * t + k);
    for (int c = 0; c < 3; c++) {
      centre.p[c] += p[c] / 3;
    }
  }
  double area = run * triangle_normal(from, t, here);
  add_sample(job, &centre, CENTRES, area, near, sum);
  job->angle[i] = -1;
  job->weight[i] = area;
  if (near->triangle >= 0 && area > 0 && triangle_normal(job->to, near->triangle, there) > 0) {
    orb_cross(here, there, cross);
    job->angle[i] = atan2(orb_length(cross), orb_dot(here, there)) * DEGREE;
  }
}

/* Stands for the half-edge's triangle. Where all are taken, each edge is sampled once. */
static void sample_middle(const sample_job *job, int64_t i, orb_place *near, chunk_sum *sum) {
  const surface *from = job->from;
  double run, normal[3];
  int64_t h = pick(i, job->take[MIDDLES], job->items[MIDDLES], &run);
  int32_t next = orb_next((int32_t)h);
  if (job->take[MIDDLES] == job->items[MIDDLES] && from->triangles[h] > from->triangles[next]) {
    return;
  }
  const double *a = corner_of(from, h), *b = corner_of(from, next);
  sample middle = {.triangle = (int32_t)(h / 3)};
  middle.at[h % 3] = middle.at[next % 3] = 0.5;
  for (int c = 0; c < 3; c++) {
    middle.p[c] = 0.5 * (a[c] + b[c]);
  }
  add_sample(job, &middle, MIDDLES, run * triangle_normal(from, h / 3, normal), near, sum);
}

/* Of the input only: stands for the triangles around the vertex. */
static void sample_vertex(const sample_job *job, int64_t i, orb_place *near, chunk_sum *sum) {
  const surface *from = job->from;
  double run, area = 0, normal[3];
  int64_t v = pick(i, job->take[VERTICES], job->items[VERTICES], &run);
  const int32_t *first = from->inside->ring_first, *ring = from->inside->ring + first[v];
  int32_t size = first[v + 1] - first[v];
  if (size == 0) {
    return;
  }
  for (int32_t k = 0; k < size; k++) {
    area += triangle_normal(from, ring[k] / 3, normal);
  }
  sample corner = {.triangle = ring[0] / 3};
  memcpy(corner.p, from->positions + 3 * v, sizeof corner.p);
  corner.at[ring[0] % 3] = 1;
  add_sample(job, &corner, VERTICES, run * area, near, sum);
}

static void sample_body(void *arg, int64_t begin, int64_t end, int thread) {
  sample_job *job = arg;
  (void)thread;
  chunk_sum sum = {0};
  if (orb_context_check(job->ctx) == ORB_OK) {
    orb_place near = {.triangle = -1};
    int64_t middles = job->take[CENTRES], vertices = middles + job->take[MIDDLES];
    for (int64_t i = begin; i < end && !sum.unsettled; i++) {
      if (i < middles) {
        sample_centre(job, i, &near, &sum);
      } else if (i < vertices) {
        sample_middle(job, i - middles, &near, &sum);
      } else {
        sample_vertex(job, i - vertices, &near, &sum);
      }
    }
  }
  job->sums[begin / GRAIN] = sum;
}

static int64_t samples_of(const sample_job *job) {
  return job->take[CENTRES] + job->take[MIDDLES] + job->take[VERTICES];
}

static int64_t chunks_of(const sample_job *job) {
  return (samples_of(job) + GRAIN - 1) / GRAIN;
}

static int is_unsettled(const sample_job *job) {
  int unsettled = 0;
  for (int64_t i = 0; i < chunks_of(job); i++) {
    unsettled |= job->sums[i].unsettled;
  }
  return unsettled;
}

static orb_status job_open(orb_context *ctx, const surface *from, surface *to, const orb_shape_report *report,
                           sample_job *out) {
  int proved = !isnan(report->hausdorff);
  double bound = report->hausdorff * (1 + BOUND_MARGIN), settled = SETTLED * report->diagonal;
  *out = (sample_job){
      .ctx = ctx,
      .from = from,
      .to = to,
      .items = {from->triangle_count, 3 * (int64_t)from->triangle_count, from->places ? 0 : from->vertex_count},
      .bound2 = proved ? bound * bound : INFINITY,
      .settled2 = settled * settled};
  for (int k = 0; k < KINDS; k++) {
    out->take[k] = proved && out->items[k] > ENOUGH ? ENOUGH : out->items[k];
  }
  out->sums = ORB_NEW0(ctx, chunk_sum, chunks_of(out));
  out->angle = ORB_NEW(ctx, double, out->take[CENTRES]);
  out->weight = ORB_NEW(ctx, double, out->take[CENTRES]);
  return out->sums && out->angle && out->weight ? ORB_OK : ORB_E_NO_MEMORY;
}

static void job_close(sample_job *job) {
  orb_free(job->ctx, job->sums);
  orb_free(job->ctx, job->angle);
  orb_free(job->ctx, job->weight);
}

static void build_body(void *arg, int64_t begin, int64_t end, int thread) {
  sample_job *jobs = arg;
  (void)thread;
  for (int64_t i = begin; i < end; i++) {
    surface *to = jobs[i].to;
    jobs[i].status = is_unsettled(&jobs[i])
                         ? orb_nearest_create(jobs[i].ctx, to->positions, to->triangles, to->triangle_count, &to->tree)
                         : ORB_OK;
  }
}

/* Takes the samples of both ways; if some need a tree, builds it and takes all of that way again. */
static orb_status take_samples(orb_context *ctx, sample_job jobs[2]) {
  for (int way = 0; way < 2; way++) {
    orb_parallel_for(ctx, samples_of(&jobs[way]), GRAIN, sample_body, &jobs[way]);
  }
  ORB_TRY(orb_context_check(ctx));
  orb_parallel_for(ctx, 2, 1, build_body, jobs);
  for (int way = 0; way < 2; way++) {
    ORB_TRY(jobs[way].status);
    if (jobs[way].to->tree) {
      orb_parallel_for(ctx, samples_of(&jobs[way]), GRAIN, sample_body, &jobs[way]);
    }
  }
  return orb_context_check(ctx);
}

/* The sums of both ways. */
typedef struct totals {
  double worst2, mean2; /* of the distance */
  double angle_sum, angle_weight;
  double *bins; /* BINS weights */
} totals;

static void add_way(const sample_job *job, totals *all) {
  double area[KINDS] = {0}, squares[KINDS] = {0};
  for (int64_t i = 0; i < chunks_of(job); i++) {
    const chunk_sum *sum = &job->sums[i];
    all->worst2 = fmax(all->worst2, sum->worst2);
    for (int k = 0; k < KINDS; k++) {
      area[k] += sum->area[k];
      squares[k] += sum->squares[k];
    }
  }
  for (int k = 0; k < KINDS; k++) {
    all->mean2 += area[k] > 0 ? 0.5 * SHARE[k] * squares[k] / area[k] : 0;
  }
  for (int64_t i = 0; i < job->take[CENTRES]; i++) {
    if (job->angle[i] >= 0) {
      double weight = job->weight[i] / area[CENTRES];
      int bin = (int)(job->angle[i] * 100);
      all->bins[bin < BINS ? bin : BINS - 1] += weight;
      all->angle_sum += weight * job->angle[i];
      all->angle_weight += weight;
    }
  }
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

/* Smallest and mean area of triangles. */
typedef struct area_job {
  const surface *of;
  double (*least_and_sum)[2]; /* per chunk */
} area_job;

static void area_body(void *arg, int64_t begin, int64_t end, int thread) {
  area_job *job = arg;
  double least = INFINITY, sum = 0, normal[3];
  (void)thread;
  for (int64_t t = begin; t < end; t++) {
    double area = triangle_normal(job->of, t, normal);
    least = area < least ? area : least;
    sum += area;
  }
  job->least_and_sum[begin / AREA_GRAIN][0] = least;
  job->least_and_sum[begin / AREA_GRAIN][1] = sum;
}

static orb_status find_area_ratio(orb_context *ctx, const surface *made, double *out) {
  int64_t chunks = ((int64_t)made->triangle_count + AREA_GRAIN - 1) / AREA_GRAIN;
  area_job job = {made, orb_alloc(ctx, (size_t)chunks, sizeof *job.least_and_sum)};
  if (!job.least_and_sum) {
    return ORB_E_NO_MEMORY;
  }
  orb_parallel_for(ctx, made->triangle_count, AREA_GRAIN, area_body, &job);
  double least = INFINITY, total = 0;
  for (int64_t i = 0; i < chunks; i++) {
    least = fmin(least, job.least_and_sum[i][0]);
    total += job.least_and_sum[i][1];
  }
  *out = total > 0 ? least * made->triangle_count / total : 0;
  orb_free(ctx, job.least_and_sum);
  return orb_context_check(ctx);
}

static orb_status measure(orb_context *ctx, surface *made, surface *input, totals *all, orb_shape_report *out) {
  sample_job jobs[2] = {{0}};
  orb_status status = ORB_OK;
  jobs[0].ctx = jobs[1].ctx = ctx;
  ORB_GO(status, job_open(ctx, made, input, out, &jobs[0]), done);
  ORB_GO(status, job_open(ctx, input, made, out, &jobs[1]), done);
  ORB_GO(status, take_samples(ctx, jobs), done);
  add_way(&jobs[0], all);
  add_way(&jobs[1], all);
  out->hausdorff_sampled = sqrt(all->worst2);
  out->rms = sqrt(all->mean2);
  out->normal_mean = all->angle_weight > 0 ? all->angle_sum / all->angle_weight : 0;
  out->normal_p99 = all->angle_weight > 0 ? percentile_99(all) : 0;
  ORB_GO(status, find_area_ratio(ctx, made, &out->min_area_ratio), done);
done:
  job_close(&jobs[0]);
  job_close(&jobs[1]);
  return status;
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
  orb_inside inside = {0};
  surface input = {.positions = mesh->positions,
                   .triangles = mesh->triangles,
                   .triangle_count = mesh->triangle_count,
                   .vertex_count = mesh->vertex_count,
                   .inside = &inside};
  surface made = {.positions = positions,
                  .triangles = supermesh->triangles,
                  .triangle_count = supermesh->triangle_count,
                  .vertex_count = supermesh->vertex_count,
                  .places = places,
                  .inside = &inside};
  orb_status status = positions && all.bins ? ORB_OK : ORB_E_NO_MEMORY;
  if (status != ORB_OK) {
    goto done;
  }
  ORB_GO(status, orb_transfer_positions(ctx, shape, places, supermesh->vertex_count, positions), done);
  ORB_GO(status, orb_inside_make(ctx, mesh, supermesh->triangles, supermesh->triangle_count, places, &inside), done);
  ORB_GO(status, measure(ctx, &made, &input, &all, out), done);
done:
  orb_inside_free(ctx, &inside);
  orb_nearest_destroy(ctx, input.tree);
  orb_nearest_destroy(ctx, made.tree);
  orb_free(ctx, positions);
  orb_free(ctx, all.bins);
  return status;
}
