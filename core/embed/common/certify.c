/* The exact certificate of a spherical embedding.
 *
 * Orientation. A triangle's sign is that of det(p, q, r), exactly (numeric/predicates.h).
 *
 * Degree. Positive triangles alone may cover the sphere more than once, so the degree of the map is counted: the number
 * of triangles, with sign, whose cone contains a direction x in general position. The cone of p, q, r with sign σ
 * contains x if and only if det(p, q, x), det(q, r, x) and det(r, p, x) all have the sign σ: by Cramer's rule these are
 * the coordinates of x in p, q, r, times det(p, q, r). If one of the three is zero while the others do not exclude the
 * triangle, x is not in general position (or the triangle is degenerate and passes through x), and the next direction
 * is tried. No rounding enters, so the degree is exact; for a closed list it does not depend on x.
 */
#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/loops.h"
#include "base/memory.h"
#include "numeric/predicates.h"
#include "numeric/vec3.h"
#include "orbmorph/embed.h"

enum {
  GRAIN = 4096,   /* triangles of a chunk */
  DIRECTIONS = 64 /* to try before the degree counts as 0; only coincidence spoils one, unless the map is degenerate */
};
/* A corner whose cosine to x is below this is certainly on the far side: it is well beyond rounding. */
static const double FAR_SIDE = -1e-9;

typedef struct partial {
  int64_t flipped, degenerate, degree, on_edge;
  double least;
} partial;

typedef struct certify_job {
  const double *points;
  const int32_t *triangles;
  double direction[3];
  int only_degree;
  partial *chunk;
} certify_job;

/* +1 or −1 if the triangle covers x with that sign, 0 if not; adds 1 to *on_edge if x is not in general position. */
static int covers(const double *p, const double *q, const double *r, const double x[3], int sign, int64_t *on_edge) {
  if (orb_dot(p, x) < FAR_SIDE && orb_dot(q, x) < FAR_SIDE && orb_dot(r, x) < FAR_SIDE) {
    return 0; /* x·x > 0 needs a corner on the side of x */
  }
  int a = orb_orient(p, q, x), b, c;
  if (sign && a == -sign) {
    return 0;
  }
  b = orb_orient(q, r, x);
  if ((sign && b == -sign) || a * b < 0) {
    return 0;
  }
  c = orb_orient(r, p, x);
  if ((sign && c == -sign) || a * c < 0 || b * c < 0) {
    return 0;
  }
  if (!a || !b || !c || !sign) {
    ++*on_edge;
    return 0;
  }
  return sign;
}

static void certify_range(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  certify_job *job = arg;
  partial out = {.least = INFINITY};
  for (int64_t t = begin; t < end; t++) {
    const int32_t *v = job->triangles + 3 * t;
    const double *p = job->points + 3 * (int64_t)v[0], *q = job->points + 3 * (int64_t)v[1];
    const double *r = job->points + 3 * (int64_t)v[2];
    int sign = orb_orient(p, q, r);
    double det = orb_det(p, q, r);
    out.flipped += sign < 0;
    out.degenerate += sign == 0;
    out.least = det < out.least ? det : out.least;
    out.degree += covers(p, q, r, job->direction, sign, &out.on_edge);
  }
  job->chunk[begin / GRAIN] = out;
}

/* A spiral by the golden angle, offset so that it meets no axis or plane of symmetry of common meshes. */
static void pick_direction(int index, double out[3]) {
  double height = 0.9137 - 1.8 * fmod(0.3819660112501051 * index + 0.1234567, 1.0);
  double angle = 2.399963229728653 * index + 0.7;
  double radius = sqrt(1 - height * height);
  out[0] = radius * cos(angle);
  out[1] = radius * sin(angle);
  out[2] = height;
}

static orb_status run(orb_context *ctx, certify_job *job, int32_t triangle_count, partial *out) {
  int64_t chunks = ((int64_t)triangle_count + GRAIN - 1) / GRAIN;
  ORB_TRY(orb_sliced_for(ctx, triangle_count, GRAIN, certify_range, job));
  *out = (partial){.least = INFINITY};
  for (int64_t i = 0; i < chunks; i++) {
    out->flipped += job->chunk[i].flipped;
    out->degenerate += job->chunk[i].degenerate;
    out->degree += job->chunk[i].degree;
    out->on_edge += job->chunk[i].on_edge;
    out->least = fmin(out->least, job->chunk[i].least);
  }
  return ORB_OK;
}

orb_status orb_certify(orb_context *ctx, const double *points, int32_t vertex_count, const int32_t *triangles,
                       int32_t triangle_count, orb_certificate *out) {
  (void)vertex_count;
  memset(out, 0, sizeof *out);
  certify_job job = {.points = points, .triangles = triangles};
  job.chunk = ORB_NEW(ctx, partial, ((int64_t)triangle_count + GRAIN - 1) / GRAIN);
  if (!job.chunk) {
    return ORB_E_NO_MEMORY;
  }
  orb_status status = ORB_OK;
  partial sum = {.on_edge = 1};
  for (int i = 0; i < DIRECTIONS && sum.on_edge; i++) {
    pick_direction(i, job.direction);
    ORB_GO(status, run(ctx, &job, triangle_count, &sum), done);
  }
  out->flipped = sum.flipped;
  out->degenerate = sum.degenerate;
  out->degree = sum.on_edge ? 0 : (int32_t)sum.degree;
  out->exact = 1;
  out->min_determinant = sum.least;
  out->valid = out->flipped == 0 && out->degenerate == 0 && out->degree == 1;
done:
  orb_free(ctx, job.chunk);
  return status;
}
