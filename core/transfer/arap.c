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
#include "transfer/graph.h"
#include "transfer/groups.h"
#include "transfer/laplace.h"
#include "transfer/rotation.h"

enum { GRAIN = 2048 };  /* vertices a thread takes at a time; the sums, and so the result, depend on it */
enum { SMOOTHING = 2 }; /* rounds of smoothing the covariances: more suppress slivers and blur the rotations */
/* Of the energy norm of the error, relative to that of the edges: what remains is far below a pixel of any picture. */
static const double TOLERANCE = 1e-5;
/* Radians: a smaller rotation has no axis to unwrap about. */
static const double NO_ROTATION = 1e-9;
/* Length of a blend of unit vectors below which they cancel out, so that its direction would be rounding of floats. */
static const double CANCELLED = 1e-6;
static const double PI = 3.14159265358979323846;

struct orb_arap {
  const double *a;
  double *b; /* rotated back onto a, about the middles */
  int32_t vertex_count;
  orb_edge_graph graph;
  double *rotation; /* per vertex: its rotation vector */
  orb_groups groups;
  double whole[3]; /* rotation vector of b as a whole */
  double middle_a[3], middle_b[3];
};

void orb_arap_destroy(orb_context *ctx, orb_arap *path) {
  if (path) {
    orb_free(ctx, path->b);
    orb_edge_graph_free(ctx, &path->graph);
    orb_free(ctx, path->rotation);
    orb_groups_free(ctx, &path->groups);
    orb_free(ctx, path);
  }
}

/* The middle of the vertices by the weights of a's areas. */
static void middle_of(const double *positions, const int32_t *triangles, int32_t count, double out[3]) {
  double total = 0, sum[3] = {0};
  for (int32_t t = 0; t < count; t++) {
    double area = orb_twice_area(positions, triangles + 3 * (int64_t)t);
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
    double weight = orb_twice_area(path->a, corner);
    for (int k = 0; k < 3; k++) {
      double u[3], w[3];
      orb_sub(path->a + 3 * (int64_t)corner[k], path->middle_a, u);
      orb_sub(b + 3 * (int64_t)corner[k], path->middle_b, w);
      for (int i = 0; i < 9; i++) {
        h[i / 3][i % 3] += weight * u[i / 3] * w[i % 3];
      }
    }
  }
  orb_rotation_vector(h, path->whole);
  for (int32_t v = 0; v < path->vertex_count; v++) {
    double w[3];
    orb_sub(b + 3 * (int64_t)v, path->middle_b, w);
    orb_rotate_by(path->whole, -1, w, path->b + 3 * (int64_t)v);
  }
}

/* The covariance of each vertex's edges, scaled so that large cells do not outweigh small ones; then smoothed. */
static void make_cells(const orb_arap *path, double (*cell)[9], double (*scratch)[9]) {
  for (int32_t v = 0; v < path->vertex_count; v++) {
    double size = 0;
    memset(cell[v], 0, sizeof cell[v]);
    for (int32_t i = path->graph.first[v]; i < path->graph.first[v + 1]; i++) {
      double u[3], w[3];
      orb_sub(path->a + 3 * (int64_t)path->graph.neighbor[i], path->a + 3 * (int64_t)v, u);
      orb_sub(path->b + 3 * (int64_t)path->graph.neighbor[i], path->b + 3 * (int64_t)v, w);
      orb_add_outer(cell[v], u, w, path->graph.weight[i]);
      size += path->graph.weight[i] * orb_length(u) * orb_length(w);
    }
    for (int k = 0; k < 9 && size > 0; k++) {
      cell[v][k] /= size;
    }
  }
  for (int round = 0; round < SMOOTHING; round++) {
    memcpy(scratch, cell, (size_t)path->vertex_count * sizeof *cell);
    for (int32_t v = 0; v < path->vertex_count; v++) {
      double share = 1.0 / (path->graph.first[v + 1] - path->graph.first[v]);
      for (int32_t i = path->graph.first[v]; i < path->graph.first[v + 1]; i++) {
        for (int k = 0; k < 9; k++) {
          cell[v][k] += share * scratch[path->graph.neighbor[i]][k];
        }
      }
    }
  }
}

/* Replaces w by the same rotation one full circle more or less, if that is nearer to `near`. */
static void unwrap(double w[3], const double near[3]) {
  double axis[3] = {w[0], w[1], w[2]}, best[3] = {w[0], w[1], w[2]};
  if (!(orb_normalize(axis) > NO_ROTATION)) {
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
      orb_rotation_vector(h, path->rotation + 3 * (int64_t)v);
      if (orb_length(path->rotation + 3 * (int64_t)v) < orb_length(path->rotation + 3 * (int64_t)root)) {
        root = v;
      }
    }
    queue[tail++] = root;
    seen[root] = 1;
    while (head < tail) {
      int32_t v = queue[head++];
      for (int32_t i = path->graph.first[v]; i < path->graph.first[v + 1]; i++) {
        int32_t w = path->graph.neighbor[i];
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
    status = orb_edge_graph_make(ctx, path->a, path->b, vertex_count, triangles, triangle_count, &path->graph);
  }
  if (status == ORB_OK) {
    status = make_rotations(ctx, path);
  }
  if (status == ORB_OK) {
    status = orb_groups_create(ctx, path->graph.first, path->graph.neighbor, path->graph.weight, vertex_count,
                               &path->groups);
  }
  if (status != ORB_OK) {
    orb_arap_destroy(ctx, path);
    return status;
  }
  *out = path;
  return ORB_OK;
}

/* The right-hand side at t. */
typedef struct side_job {
  const orb_arap *path;
  double t;
  const double *x;
  double *r;         /* Σ w d − L x, what x leaves of the right-hand side */
  double (*sums)[3]; /* per chunk: Σ w d² */
} side_job;

static void side_body(void *arg, int64_t begin, int64_t end, int thread) {
  const side_job *s = arg;
  const orb_arap *path = s->path;
  double sum[3] = {0};
  (void)thread;
  for (int64_t v = begin; v < end; v++) {
    double r[3] = {0};
    for (int32_t i = path->graph.first[v]; i < path->graph.first[v + 1]; i++) {
      int64_t u = path->graph.neighbor[i];
      double rotation[3], edge[3], forth[3], back[3];
      for (int c = 0; c < 3; c++) {
        rotation[c] = 0.5 * (path->rotation[3 * v + c] + path->rotation[3 * u + c]);
      }
      orb_sub(path->a + 3 * v, path->a + 3 * u, edge);
      orb_rotate_by(rotation, s->t, edge, forth);
      orb_sub(path->b + 3 * v, path->b + 3 * u, edge);
      orb_rotate_by(rotation, s->t - 1, edge, back);
      for (int c = 0; c < 3; c++) {
        double wanted = (1 - s->t) * forth[c] + s->t * back[c];
        r[c] += path->graph.weight[i] * (wanted - (s->x[3 * v + c] - s->x[3 * u + c]));
        sum[c] += path->graph.weight[i] * wanted * wanted;
      }
    }
    for (int c = 0; c < 3; c++) {
      s->r[3 * v + c] = r[c];
    }
  }
  memcpy(s->sums[begin / GRAIN], sum, sizeof sum);
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
    orb_rotate_by(path->whole, t, moved, p);
    for (int c = 0; c < 3; c++) {
      p[c] += (1 - t) * path->middle_a[c] + t * path->middle_b[c];
    }
  }
}

/* Moves x from the blend to the solution at t. r: scratch, 3 per vertex. */
static orb_status solve_at(orb_context *ctx, orb_arap *path, double t, double *r, double *x) {
  int64_t chunks = ((int64_t)path->vertex_count + GRAIN - 1) / GRAIN;
  side_job side = {path, t, x, r, orb_alloc(ctx, (size_t)chunks, sizeof *side.sums)};
  double sum[3] = {0};
  if (!side.sums) {
    return ORB_E_NO_MEMORY;
  }
  orb_parallel_for(ctx, path->vertex_count, GRAIN, side_body, &side);
  for (int c = 0; c < 3; c++) {
    for (int64_t i = 0; i < chunks; i++) {
      sum[c] += side.sums[i][c];
    }
  }
  orb_free(ctx, side.sums);
  return orb_laplace_solve(ctx, &path->graph, &path->groups, TOLERANCE * TOLERANCE * (sum[0] + sum[1] + sum[2]), r, x);
}

orb_status orb_arap_at(orb_context *ctx, orb_arap *path, double t, double *out) {
  int64_t n = 3 * (int64_t)path->vertex_count;
  double *start = ORB_NEW(ctx, double, n), *r = ORB_NEW(ctx, double, n);
  orb_status status = start && r ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    for (int64_t i = 0; i < n; i++) {
      start[i] = (1 - t) * (path->a[i] - path->middle_a[i % 3]) + t * path->b[i];
    }
    memcpy(out, start, (size_t)n * sizeof *out);
    status = solve_at(ctx, path, t, r, out);
    place_whole(path, t, out, start);
  }
  orb_free(ctx, start);
  orb_free(ctx, r);
  return status;
}

void orb_arap_direction(const orb_arap *path, double t, int32_t v, const float at_a[3], const float at_b[3],
                        float out[3]) {
  double a[3], b[3], unrotated[3], blend[3], forth[3], back[3];
  for (int c = 0; c < 3; c++) {
    a[c] = (double)at_a[c];
    b[c] = (double)at_b[c];
  }
  orb_rotate_by(path->whole, -1, b, unrotated);
  orb_rotate_by(path->rotation + 3 * (int64_t)v, t, a, forth);
  orb_rotate_by(path->rotation + 3 * (int64_t)v, t - 1, unrotated, back);
  for (int c = 0; c < 3; c++) {
    blend[c] = (1 - t) * forth[c] + t * back[c];
  }
  orb_rotate_by(path->whole, t, blend, a);
  if (!(orb_normalize(a) > CANCELLED)) {
    memcpy(out, at_a, 3 * sizeof *out);
    return;
  }
  for (int c = 0; c < 3; c++) {
    out[c] = (float)a[c] + 0.0f;
  }
}
