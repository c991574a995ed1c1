/* As-rigid-as-possible interpolation, after Alexa, Cohen-Or & Levin 2000 and Sorkine & Alexa 2007, on edges.
 *
 * The rotation of b as a whole against a is removed first (Horn). Each vertex then has the rotation that best maps its
 * edges on a to those on b, as a rotation vector w. Covariances are smoothed over neighbours, which takes influence
 * from slivers, and vectors are unwrapped from neighbour to neighbour, so that a limb may rotate by more than half a
 * circle. At t an edge should be
 *
 *   d(t) = (1 − t) exp(t w) e_a + t exp((t − 1) w) e_b,
 *
 * a's edge rotated forth blended with b's rotated back: both ends are exact, and where b is a rotated a nothing
 * shrinks. Positions are the least-squares solution of p_i − p_j = d_ij, weighted by the area at the edge over its
 * squared length (a positive stand-in for cotangents): a graph Laplacian, solved by conjugate gradients from a linear
 * blend. Sums run over fixed chunks, so that the result does not depend on the number of threads. */
#include "transfer/arap.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "base/parallel.h"
#include "numeric/vec3.h"
#include "transfer/coarse.h"
#include "transfer/rotation.h"

enum { GRAIN = 2048 };          /* vertices a thread takes at a time; the sums, and so the result, depend on it */
enum { SMOOTHING = 2 };         /* rounds of smoothing the covariances: more suppress slivers and blur the rotations */
enum { MAX_ITERATIONS = 3000 }; /* of conjugate gradients, so that they end in any case */
static const double TOLERANCE = 1e-5; /* of the relative residual; the error that remains is far below a pixel */
static const double PI = 3.14159265358979323846;

struct orb_arap {
  const double *a;
  double *b; /* rotated back onto a, about the middles */
  int32_t vertex_count;
  int32_t *first, *neighbor; /* of vertex v: neighbor[first[v]] … neighbor[first[v + 1] − 1] */
  double *weight;            /* per neighbour entry; symmetric */
  double *diagonal;          /* per vertex: the sum of its weights */
  double *rotation;          /* per vertex: its rotation vector */
  orb_coarse coarse;
  double whole[3]; /* rotation vector of b as a whole */
  double middle_a[3], middle_b[3];
};

/* The vector v rotated by t·w (Rodrigues). */
static void rotate_by(const double w[3], double t, const double v[3], double out[3]) {
  double angle = orb_length(w) * t, axis[3] = {w[0], w[1], w[2]}, cross[3];
  if (!(orb_normalize(axis) > 1e-12)) {
    memcpy(out, v, 3 * sizeof *out);
    return;
  }
  double s = sin(angle), c = cos(angle), along = orb_dot(axis, v) * (1 - c);
  orb_cross(axis, v, cross);
  for (int k = 0; k < 3; k++) {
    out[k] = c * v[k] + s * cross[k] + along * axis[k];
  }
}

static void rotation_vector(double h[3][3], double out[3]) {
  double q[4];
  orb_rotation_fit(h, q);
  double sine = sqrt(q[1] * q[1] + q[2] * q[2] + q[3] * q[3]), angle = 2 * atan2(sine, q[0]);
  for (int k = 0; k < 3; k++) {
    out[k] = sine > 1e-15 ? angle * q[k + 1] / sine : 0;
  }
}

void orb_arap_destroy(orb_context *ctx, orb_arap *path) {
  if (path) {
    orb_free(ctx, path->b);
    orb_free(ctx, path->first);
    orb_free(ctx, path->neighbor);
    orb_free(ctx, path->weight);
    orb_free(ctx, path->diagonal);
    orb_free(ctx, path->rotation);
    orb_coarse_free(ctx, &path->coarse);
    orb_free(ctx, path);
  }
}

static double twice_area(const double *positions, const int32_t corner[3]) {
  double u[3], w[3], n[3];
  orb_sub(positions + 3 * (int64_t)corner[1], positions + 3 * (int64_t)corner[0], u);
  orb_sub(positions + 3 * (int64_t)corner[2], positions + 3 * (int64_t)corner[0], w);
  orb_cross(u, w, n);
  return orb_length(n);
}

static double total_area(const double *positions, const int32_t *triangles, int32_t count) {
  double sum = 0;
  for (int32_t t = 0; t < count; t++) {
    sum += twice_area(positions, triangles + 3 * (int64_t)t);
  }
  return sum;
}

/* Neighbours of a closed triangle list, each once: the vertex that follows v in each triangle of v. Half the weight of
 * an edge comes from each of its triangles, that is from each of its half-edges. */
static orb_status make_graph(orb_context *ctx, orb_arap *path, const int32_t *triangles, int32_t triangle_count) {
  int32_t n = path->vertex_count;
  int64_t corners = 3 * (int64_t)triangle_count;
  path->first = ORB_NEW0(ctx, int32_t, (int64_t)n + 1);
  path->neighbor = ORB_NEW(ctx, int32_t, corners);
  path->weight = ORB_NEW0(ctx, double, corners);
  path->diagonal = ORB_NEW0(ctx, double, n);
  if (!path->first || !path->neighbor || !path->weight || !path->diagonal) {
    return ORB_E_NO_MEMORY;
  }
  for (int64_t h = 0; h < corners; h++) {
    path->first[triangles[h] + 1]++;
  }
  for (int32_t v = 0; v < n; v++) {
    path->first[v + 1] += path->first[v];
  }
  for (int64_t h = 0; h < corners; h++) { /* diagonal counts the entries so far */
    int32_t v = triangles[h], next = triangles[h % 3 == 2 ? h - 2 : h + 1];
    path->neighbor[path->first[v] + (int32_t)path->diagonal[v]] = next;
    path->diagonal[v] += 1;
  }
  return ORB_OK;
}

static int32_t entry_of(const orb_arap *path, int32_t v, int32_t neighbor) {
  for (int32_t i = path->first[v]; i < path->first[v + 1]; i++) {
    if (path->neighbor[i] == neighbor) {
      return i;
    }
  }
  ORB_ASSERT(!"the triangles are closed");
  return -1;
}

static void make_weights(orb_arap *path, const int32_t *triangles, int32_t triangle_count) {
  double area_a = total_area(path->a, triangles, triangle_count);
  double area_b = total_area(path->b, triangles, triangle_count);
  double scale = area_a > 0 && area_b > 0 ? area_a / area_b : 1, floor = 1e-9 * area_a;
  for (int64_t h = 0; h < 3 * (int64_t)triangle_count; h++) {
    const int32_t *corner = triangles + 3 * (h / 3);
    int32_t v = triangles[h], next = triangles[h % 3 == 2 ? h - 2 : h + 1];
    double area = twice_area(path->a, corner) + scale * twice_area(path->b, corner);
    double length2 = orb_distance2(path->a + 3 * (int64_t)v, path->a + 3 * (int64_t)next) +
                     scale * orb_distance2(path->b + 3 * (int64_t)v, path->b + 3 * (int64_t)next);
    double weight = (area + floor / triangle_count) / (length2 + 1e-3 * area_a / triangle_count);
    path->weight[entry_of(path, v, next)] += weight;
    path->weight[entry_of(path, next, v)] += weight;
  }
  for (int32_t v = 0; v < path->vertex_count; v++) {
    path->diagonal[v] = 0;
    for (int32_t i = path->first[v]; i < path->first[v + 1]; i++) {
      path->diagonal[v] += path->weight[i];
    }
  }
}

/* The middle of the vertices by the weights of a's areas. */
static void middle_of(const double *positions, const int32_t *triangles, int32_t count, double out[3]) {
  double total = 0, sum[3] = {0};
  for (int32_t t = 0; t < count; t++) {
    double area = twice_area(positions, triangles + 3 * (int64_t)t);
    for (int k = 0; k < 3; k++) {
      const double *p = positions + 3 * (int64_t)triangles[3 * (int64_t)t + k];
      for (int c = 0; c < 3; c++) {
        sum[c] += area / 3 * p[c];
      }
    }
    total += area;
  }
  for (int c = 0; c < 3; c++) {
    out[c] = total > 0 ? sum[c] / total : positions[c];
  }
}

/* Removes the rotation of b as a whole from b. */
static void remove_whole(orb_arap *path, const double *b, const int32_t *triangles, int32_t triangle_count) {
  double h[3][3] = {{0}};
  middle_of(path->a, triangles, triangle_count, path->middle_a);
  middle_of(b, triangles, triangle_count, path->middle_b);
  for (int32_t t = 0; t < triangle_count; t++) {
    const int32_t *corner = triangles + 3 * (int64_t)t;
    double weight = twice_area(path->a, corner);
    for (int k = 0; k < 3; k++) {
      double u[3], w[3];
      orb_sub(path->a + 3 * (int64_t)corner[k], path->middle_a, u);
      orb_sub(b + 3 * (int64_t)corner[k], path->middle_b, w);
      for (int i = 0; i < 9; i++) {
        h[i / 3][i % 3] += weight * u[i / 3] * w[i % 3];
      }
    }
  }
  rotation_vector(h, path->whole);
  for (int32_t v = 0; v < path->vertex_count; v++) {
    double w[3];
    orb_sub(b + 3 * (int64_t)v, path->middle_b, w);
    rotate_by(path->whole, -1, w, path->b + 3 * (int64_t)v);
  }
}

/* The covariance of each vertex's edges, scaled so that large cells do not outweigh small ones; then smoothed. */
static void make_cells(const orb_arap *path, double (*cell)[9], double (*scratch)[9]) {
  for (int32_t v = 0; v < path->vertex_count; v++) {
    double size = 0;
    memset(cell[v], 0, sizeof cell[v]);
    for (int32_t i = path->first[v]; i < path->first[v + 1]; i++) {
      double u[3], w[3];
      orb_sub(path->a + 3 * (int64_t)path->neighbor[i], path->a + 3 * (int64_t)v, u);
      orb_sub(path->b + 3 * (int64_t)path->neighbor[i], path->b + 3 * (int64_t)v, w);
      orb_add_outer(cell[v], u, w, path->weight[i]);
      size += path->weight[i] * orb_length(u) * orb_length(w);
    }
    for (int k = 0; k < 9 && size > 0; k++) {
      cell[v][k] /= size;
    }
  }
  for (int round = 0; round < SMOOTHING; round++) {
    memcpy(scratch, cell, (size_t)path->vertex_count * sizeof *cell);
    for (int32_t v = 0; v < path->vertex_count; v++) {
      double share = 1.0 / (path->first[v + 1] - path->first[v]);
      for (int32_t i = path->first[v]; i < path->first[v + 1]; i++) {
        for (int k = 0; k < 9; k++) {
          cell[v][k] += share * scratch[path->neighbor[i]][k];
        }
      }
    }
  }
}

/* Replaces w by the same rotation one full circle more or less, if that is nearer to `near`. */
static void unwrap(double w[3], const double near[3]) {
  double axis[3] = {w[0], w[1], w[2]}, best[3] = {w[0], w[1], w[2]};
  if (!(orb_normalize(axis) > 1e-9)) {
    return;
  }
  for (int circles = -1; circles <= 1; circles += 2) {
    double other[3];
    for (int c = 0; c < 3; c++) {
      other[c] = w[c] + circles * 2 * PI * axis[c];
    }
    if (orb_distance2(other, near) < orb_distance2(best, near)) {
      memcpy(best, other, sizeof best);
    }
  }
  memcpy(w, best, sizeof best);
}

static orb_status make_rotations(orb_context *ctx, orb_arap *path) {
  int32_t n = path->vertex_count, root = 0, head = 0, tail = 0;
  double(*cell)[9] = orb_alloc(ctx, (size_t)n, sizeof *cell);
  double(*scratch)[9] = orb_alloc(ctx, (size_t)n, sizeof *scratch);
  int32_t *queue = ORB_NEW(ctx, int32_t, n);
  unsigned char *seen = ORB_NEW0(ctx, unsigned char, n);
  orb_status status = cell && scratch && queue && seen ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    make_cells(path, cell, scratch);
    for (int32_t v = 0; v < n; v++) {
      double h[3][3];
      memcpy(h, cell[v], sizeof h);
      rotation_vector(h, path->rotation + 3 * (int64_t)v);
      if (orb_length(path->rotation + 3 * (int64_t)v) < orb_length(path->rotation + 3 * (int64_t)root)) {
        root = v;
      }
    }
    queue[tail++] = root;
    seen[root] = 1;
    while (head < tail) {
      int32_t v = queue[head++];
      for (int32_t i = path->first[v]; i < path->first[v + 1]; i++) {
        int32_t w = path->neighbor[i];
        if (!seen[w]) {
          seen[w] = 1;
          unwrap(path->rotation + 3 * (int64_t)w, path->rotation + 3 * (int64_t)v);
          queue[tail++] = w;
        }
      }
    }
  }
  orb_free(ctx, cell);
  orb_free(ctx, scratch);
  orb_free(ctx, queue);
  orb_free(ctx, seen);
  return status;
}

orb_status orb_arap_create(orb_context *ctx, const double *a, const double *b, int32_t vertex_count,
                           const int32_t *triangles, int32_t triangle_count, orb_arap **out) {
  orb_status status = ORB_E_NO_MEMORY;
  orb_arap *path = ORB_NEW0(ctx, orb_arap, 1);
  if (!path) {
    return ORB_E_NO_MEMORY;
  }
  path->a = a;
  path->vertex_count = vertex_count;
  path->b = ORB_NEW(ctx, double, 3 * (int64_t)vertex_count);
  path->rotation = ORB_NEW(ctx, double, 3 * (int64_t)vertex_count);
  if (path->b && path->rotation) {
    remove_whole(path, b, triangles, triangle_count);
    status = make_graph(ctx, path, triangles, triangle_count);
  }
  if (status == ORB_OK) {
    make_weights(path, triangles, triangle_count);
    status = orb_context_check(ctx);
  }
  if (status == ORB_OK) {
    status = make_rotations(ctx, path);
  }
  if (status == ORB_OK) {
    status = orb_coarse_create(ctx, path->first, path->neighbor, path->weight, vertex_count, &path->coarse);
  }
  if (status != ORB_OK) {
    orb_arap_destroy(ctx, path);
    return status;
  }
  *out = path;
  return ORB_OK;
}

/* Conjugate gradients on three right-hand sides at once, each with its own step lengths. */
typedef struct solver {
  const orb_arap *path;
  double t;
  double *x, *r, *p, *q;
  orb_coarse *coarse; /* its sums are the correction of the present r */
  double (*sums)[6];
  double step[3];
  double beta[3];
} solver;

/* r = Σ w d − L x, the right-hand side less what x already gives; p = 0; sums of w d². */
static void begin_body(void *arg, int64_t begin, int64_t end, int thread) {
  solver *s = arg;
  const orb_arap *path = s->path;
  double sum[6] = {0};
  (void)thread;
  for (int64_t v = begin; v < end; v++) {
    double r[3] = {0};
    for (int32_t i = path->first[v]; i < path->first[v + 1]; i++) {
      int64_t u = path->neighbor[i];
      double rotation[3], edge[3], forth[3], back[3];
      for (int c = 0; c < 3; c++) {
        rotation[c] = 0.5 * (path->rotation[3 * v + c] + path->rotation[3 * u + c]);
      }
      orb_sub(path->a + 3 * v, path->a + 3 * u, edge);
      rotate_by(rotation, s->t, edge, forth);
      orb_sub(path->b + 3 * v, path->b + 3 * u, edge);
      rotate_by(rotation, s->t - 1, edge, back);
      for (int c = 0; c < 3; c++) {
        double wanted = (1 - s->t) * forth[c] + s->t * back[c];
        r[c] += path->weight[i] * (wanted - (s->x[3 * v + c] - s->x[3 * u + c]));
        sum[c] += path->weight[i] * wanted * wanted;
      }
    }
    for (int c = 0; c < 3; c++) {
      s->r[3 * v + c] = r[c];
      s->p[3 * v + c] = 0;
    }
  }
  memcpy(s->sums[begin / GRAIN], sum, sizeof sum);
}

/* q = L p, and the sums of p·q. */
static void multiply_body(void *arg, int64_t begin, int64_t end, int thread) {
  solver *s = arg;
  const orb_arap *path = s->path;
  double sum[6] = {0};
  (void)thread;
  for (int64_t v = begin; v < end; v++) {
    double q[3];
    for (int c = 0; c < 3; c++) {
      q[c] = path->diagonal[v] * s->p[3 * v + c];
    }
    for (int32_t i = path->first[v]; i < path->first[v + 1]; i++) {
      const double *p = s->p + 3 * (int64_t)path->neighbor[i];
      for (int c = 0; c < 3; c++) {
        q[c] -= path->weight[i] * p[c];
      }
    }
    for (int c = 0; c < 3; c++) {
      s->q[3 * v + c] = q[c];
      sum[c] += q[c] * s->p[3 * v + c];
    }
  }
  memcpy(s->sums[begin / GRAIN], sum, sizeof sum);
}

/* x += step p, r −= step q. */
static void step_body(void *arg, int64_t begin, int64_t end, int thread) {
  solver *s = arg;
  (void)thread;
  for (int64_t v = begin; v < end; v++) {
    for (int c = 0; c < 3; c++) {
      s->x[3 * v + c] += s->step[c] * s->p[3 * v + c];
      s->r[3 * v + c] -= s->step[c] * s->q[3 * v + c];
    }
  }
}

/* q = the preconditioned r: by the diagonal, and the groups' correction; the sums of r·q. */
static void precondition_body(void *arg, int64_t begin, int64_t end, int thread) {
  solver *s = arg;
  double sum[6] = {0};
  (void)thread;
  for (int64_t v = begin; v < end; v++) {
    const double *shift = s->coarse->sums + 3 * (int64_t)s->coarse->group[v];
    for (int c = 0; c < 3; c++) {
      s->q[3 * v + c] = s->r[3 * v + c] / s->path->diagonal[v] + shift[c];
      sum[c] += s->q[3 * v + c] * s->r[3 * v + c];
    }
  }
  memcpy(s->sums[begin / GRAIN], sum, sizeof sum);
}

/* p = q + beta p. */
static void direction_body(void *arg, int64_t begin, int64_t end, int thread) {
  solver *s = arg;
  (void)thread;
  for (int64_t v = begin; v < end; v++) {
    for (int c = 0; c < 3; c++) {
      s->p[3 * v + c] = s->q[3 * v + c] + s->beta[c] * s->p[3 * v + c];
    }
  }
}

static void run(orb_context *ctx, solver *s, orb_loop_fn body, double sums[6]) {
  int64_t chunks = ((int64_t)s->path->vertex_count + GRAIN - 1) / GRAIN;
  orb_parallel_for(ctx, s->path->vertex_count, GRAIN, body, s);
  for (int c = 0; c < 6 && sums; c++) {
    sums[c] = 0;
    for (int64_t i = 0; i < chunks; i++) {
      sums[c] += s->sums[i][c];
    }
  }
}

static orb_status solve(orb_context *ctx, solver *s) {
  double rho[6] = {0}, now[6];
  run(ctx, s, begin_body, now);
  double limit = TOLERANCE * TOLERANCE * (now[0] + now[1] + now[2]);
  for (int iteration = 0; iteration < MAX_ITERATIONS; iteration++) {
    ORB_TRY(orb_context_check(ctx));
    orb_coarse_solve(s->coarse, s->r);
    run(ctx, s, precondition_body, now);
    for (int c = 0; c < 3; c++) {
      s->beta[c] = rho[c] > 0 ? now[c] / rho[c] : 0;
      rho[c] = now[c];
    }
    if (rho[0] <= limit && rho[1] <= limit && rho[2] <= limit) {
      break;
    }
    run(ctx, s, direction_body, NULL);
    run(ctx, s, multiply_body, now);
    for (int c = 0; c < 3; c++) {
      s->step[c] = rho[c] > 0 && now[c] > 0 ? rho[c] / now[c] : 0;
    }
    run(ctx, s, step_body, NULL);
  }
  return ORB_OK;
}

/* Rotates the solution by the whole's share and puts its middle on the straight line between the ends' middles. */
static void place_whole(const orb_arap *path, double t, double *x, const double *start) {
  double shift[3] = {0};
  for (int32_t v = 0; v < path->vertex_count; v++) { /* the solution is known up to a shift: that of the blend */
    for (int c = 0; c < 3; c++) {
      shift[c] += (start[3 * (int64_t)v + c] - x[3 * (int64_t)v + c]) / path->vertex_count;
    }
  }
  for (int32_t v = 0; v < path->vertex_count; v++) {
    double *p = x + 3 * (int64_t)v, moved[3] = {p[0] + shift[0], p[1] + shift[1], p[2] + shift[2]};
    rotate_by(path->whole, t, moved, p);
    for (int c = 0; c < 3; c++) {
      p[c] += (1 - t) * path->middle_a[c] + t * path->middle_b[c];
    }
  }
}

orb_status orb_arap_at(orb_context *ctx, orb_arap *path, double t, double *out) {
  int64_t n = 3 * (int64_t)path->vertex_count, chunks = ((int64_t)path->vertex_count + GRAIN - 1) / GRAIN;
  solver s = {.path = path, .t = t, .x = out, .coarse = &path->coarse};
  double *start = ORB_NEW(ctx, double, n);
  s.r = ORB_NEW(ctx, double, n);
  s.p = ORB_NEW(ctx, double, n);
  s.q = ORB_NEW(ctx, double, n);
  s.sums = orb_alloc(ctx, (size_t)chunks, sizeof *s.sums);
  orb_status status = start && s.r && s.p && s.q && s.sums ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    for (int64_t i = 0; i < n; i++) {
      start[i] = (1 - t) * (path->a[i] - path->middle_a[i % 3]) + t * path->b[i];
    }
    memcpy(out, start, (size_t)n * sizeof *out);
    status = solve(ctx, &s);
    place_whole(path, t, out, start);
  }
  orb_free(ctx, start);
  orb_free(ctx, s.r);
  orb_free(ctx, s.p);
  orb_free(ctx, s.q);
  orb_free(ctx, s.sums);
  return status;
}

void orb_arap_direction(const orb_arap *path, double t, int32_t v, const float at_a[3], const float at_b[3],
                        float out[3]) {
  double a[3], b[3], unrotated[3], blend[3], forth[3], back[3];
  for (int c = 0; c < 3; c++) {
    a[c] = (double)at_a[c];
    b[c] = (double)at_b[c];
  }
  rotate_by(path->whole, -1, b, unrotated);
  rotate_by(path->rotation + 3 * (int64_t)v, t, a, forth);
  rotate_by(path->rotation + 3 * (int64_t)v, t - 1, unrotated, back);
  for (int c = 0; c < 3; c++) {
    blend[c] = (1 - t) * forth[c] + t * back[c];
  }
  rotate_by(path->whole, t, blend, a);
  if (!(orb_normalize(a) > 1e-6)) {
    memcpy(out, at_a, 3 * sizeof *out);
    return;
  }
  for (int c = 0; c < 3; c++) {
    out[c] = (float)a[c] + 0.0f;
  }
}
