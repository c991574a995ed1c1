/* Samples both surfaces and asks each sample for its nearest point on the other one. A distance counts for the triangle
 * of the template that the sample or its nearest point lies on. */
#include "merge/coarse.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/loops.h"
#include "base/memory.h"
#include "merge/torn.h"
#include "numeric/vec3.h"

enum { GRAIN = 256 };             /* samples or triangles a thread takes at a time */
enum { CENTRE = 3, OF_FACE = 4 }; /* samples of a template's triangle: the middles of its edges, and its centre */

typedef struct coarse_job {
  const orb_mesh *input;
  const orb_supermesh *supermesh;
  const double *positions; /* of the supermesh's vertices on the input */
  const orb_nearest *on_input, *on_made;
  double *worst2;   /* per triangle of the supermesh: the greatest squared distance */
  int32_t *nearest; /* per sample of the input, its vertices and then its centres: the triangle it counts for */
  double *far2;     /* and its squared distance */
} coarse_job;

static const double *made_corner(const coarse_job *job, int64_t t, int k) {
  return job->positions + 3 * (int64_t)job->supermesh->triangles[3 * t + k];
}

/* Distances from the template to the input. */
static void made_body(void *arg, int64_t begin, int64_t end, int thread) {
  coarse_job *job = arg;
  (void)thread;
  for (int64_t t = begin; t < end; t++) {
    for (int i = 0; i < OF_FACE; i++) {
      double p[3];
      orb_place place;
      for (int c = 0; c < 3; c++) {
        double a = made_corner(job, t, i % 3)[c], b = made_corner(job, t, (i + 1) % 3)[c];
        p[c] = i == CENTRE ? (a + b + made_corner(job, t, 2)[c]) / 3 : 0.5 * (a + b);
      }
      job->worst2[t] = fmax(job->worst2[t], orb_nearest_query(job->on_input, p, INFINITY, &place));
    }
  }
}

/* Distances from the input to the template. */
static void input_body(void *arg, int64_t begin, int64_t end, int thread) {
  coarse_job *job = arg;
  const orb_mesh *input = job->input;
  (void)thread;
  for (int64_t i = begin; i < end; i++) {
    double centre[3] = {0};
    const double *p = i < input->vertex_count ? input->positions + 3 * i : centre;
    for (int k = 0; i >= input->vertex_count && k < 3; k++) {
      const double *x = input->positions + 3 * (int64_t)input->triangles[3 * (i - input->vertex_count) + k];
      for (int c = 0; c < 3; c++) {
        centre[c] += x[c] / 3;
      }
    }
    orb_place place;
    job->far2[i] = orb_nearest_query(job->on_made, p, INFINITY, &place);
    job->nearest[i] = place.triangle;
  }
}

static double area_of(const coarse_job *job, int64_t t) {
  return orb_triangle_area(made_corner(job, t, 0), made_corner(job, t, 1), made_corner(job, t, 2));
}

/* Keeps the list sorted by falling error. */
static void list_triangle(orb_coarse *out, int32_t triangle, double error) {
  int32_t at = out->listed;
  if (at == ORB_COARSE_LISTED && !(error > out->errors[at - 1])) {
    return;
  }
  at = at == ORB_COARSE_LISTED ? at - 1 : out->listed++;
  for (; at > 0 && error > out->errors[at - 1]; at--) {
    out->errors[at] = out->errors[at - 1];
    out->triangles[at] = out->triangles[at - 1];
  }
  out->errors[at] = error;
  out->triangles[at] = triangle;
}

static void judge(const coarse_job *job, const int32_t *number, double limit, orb_coarse *out) {
  double whole = 0, coarse = 0;
  for (int64_t t = 0; t < job->supermesh->triangle_count; t++) {
    double area = area_of(job, t);
    whole += area;
    if (job->worst2[t] > limit * limit) {
      coarse += area;
      out->count++;
      if (number && number[t] >= 0) {
        list_triangle(out, number[t], sqrt(job->worst2[t]));
      }
    }
  }
  out->share = whole > 0 ? coarse / whole : 0;
}

static orb_status measure(orb_context *ctx, coarse_job *job) {
  int64_t samples = (int64_t)job->input->vertex_count + job->input->triangle_count;
  ORB_TRY(orb_sliced_for(ctx, job->supermesh->triangle_count, GRAIN, made_body, job));
  ORB_TRY(orb_sliced_for(ctx, samples, GRAIN, input_body, job));
  for (int64_t i = 0; i < samples; i++) {
    int32_t t = job->nearest[i];
    if (t >= 0) {
      job->worst2[t] = fmax(job->worst2[t], job->far2[i]);
    }
  }
  return ORB_OK;
}

static orb_status measure_shape(orb_context *ctx, const orb_merge_result *merged, int32_t s, const orb_mesh *repaired,
                                double limit, orb_coarse *out) {
  const orb_supermesh *supermesh = &merged->supermesh;
  const orb_mesh *input = &merged->alignment.shapes[s].mesh;
  int64_t samples = (int64_t)input->vertex_count + input->triangle_count;
  orb_nearest *on_input = NULL, *on_made = NULL;
  double *positions = ORB_NEW(ctx, double, 3 * (int64_t)supermesh->vertex_count);
  double *worst2 = ORB_NEW0(ctx, double, supermesh->triangle_count);
  int32_t *nearest = ORB_NEW(ctx, int32_t, samples);
  double *far2 = ORB_NEW(ctx, double, samples);
  orb_status status = positions && worst2 && nearest && far2 ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    ORB_GO(status,
           orb_transfer_positions(ctx, &merged->alignment.shapes[s],
                                  supermesh->places + (int64_t)s * supermesh->vertex_count, supermesh->vertex_count,
                                  positions),
           done);
    double moved;
    orb_torn_close(repaired, supermesh, positions, &moved);
    ORB_GO(status, orb_nearest_create(ctx, input->positions, input->triangles, input->triangle_count, &on_input), done);
    ORB_GO(status, orb_nearest_create(ctx, positions, supermesh->triangles, supermesh->triangle_count, &on_made), done);
    coarse_job job = {input, supermesh, positions, on_input, on_made, worst2, nearest, far2};
    ORB_GO(status, measure(ctx, &job), done);
    judge(&job, repaired->source_triangle, limit, out);
  }
done:
  orb_nearest_destroy(ctx, on_input);
  orb_nearest_destroy(ctx, on_made);
  orb_free(ctx, positions);
  orb_free(ctx, worst2);
  orb_free(ctx, nearest);
  orb_free(ctx, far2);
  return status;
}

orb_status orb_report_coarse(orb_context *ctx, const orb_mesh *repaired, double tolerance, orb_merge_result *out) {
  int32_t shape_count = out->supermesh.shape_count;
  out->coarse = ORB_NEW0(ctx, orb_coarse, shape_count);
  if (!out->coarse) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t s = 1; s < shape_count; s++) {
    double limit = tolerance * out->shapes[s].diagonal;
    if (!(out->shapes[s].hausdorff <= limit)) {
      ORB_TRY(measure_shape(ctx, out, s, repaired, limit, &out->coarse[s]));
    }
  }
  return ORB_OK;
}
