/* Mirror landmarks.
 *
 * Many shapes are nearly symmetric, and requests often name the landmarks of one side only. The mirror planes of a
 * shape are found in space: a reflection starts from a principal axis, or else from a direction between them, and is
 * refined by iterative closest points (Besl & McKay 1992, with the plane of least squares in place of the rotation). It
 * is a symmetry if it brings samples of the surface back to the surface. Two planes of different shapes correspond if
 * the landmarks lie alike on their sides. The mirror image of a landmark becomes a mirror landmark if it lies near the
 * surface on both shapes and no landmark is there yet.
 */
#include <math.h>
#include <string.h>

#include "align/map/engine/spread.h"
#include "align/map/engine/surface.h"
#include "align/map/starts/mirror.h"
#include "base/check.h"
#include "base/memory.h"
#include "base/parallel.h"
#include "base/tasks.h"
#include "numeric/dense.h"
#include "numeric/vec3.h"

enum { DIRECTIONS = 13 }; /* three axes, six diagonals between two of them and four between all three */

typedef struct plane {
  double normal[3], offset;
  double residual; /* mean distance of the mirrored samples from the surface, of the diagonal */
} plane;

typedef struct mirror {
  const orb_map_params *params;
  const orb_mesh *mesh;
  orb_nearest *tree;
  double diagonal;
  int32_t count, sample[ORB_MAP_MIRROR_SAMPLES];
  double hit[3 * ORB_MAP_MIRROR_SAMPLES], distance[ORB_MAP_MIRROR_SAMPLES];
  plane trial, planes[ORB_MAP_MIRROR_PLANES];
  int32_t plane_count;
} mirror;

static const double *position(const mirror *m, int32_t vertex) {
  return m->mesh->positions + 3 * (size_t)vertex;
}

static void reflect(const plane *p, const double x[3], double out[3]) {
  double d = 2 * (orb_dot(p->normal, x) - p->offset);
  for (int k = 0; k < 3; k++) {
    out[k] = x[k] - d * p->normal[k];
  }
}

/* The eigenvector of the least eigenvalue of a symmetric matrix. */
static void least_axis(const double a[9], double out[3]) {
  double shifted[9], u[9], s[3], v[9], norm = 0;
  for (int i = 0; i < 9; i++) {
    norm += a[i] * a[i];
  }
  for (int i = 0; i < 9; i++) {
    shifted[i] = a[i] + (i % 4 == 0 ? sqrt(norm) + ORB_TINY : 0);
  }
  orb_svd3(shifted, u, s, v);
  for (int k = 0; k < 3; k++) {
    out[k] = v[3 * k + 2];
  }
}

static void find_hits(void *arg, int64_t begin, int64_t end, int thread) {
  mirror *m = arg;
  (void)thread;
  for (int64_t i = begin; i < end; i++) {
    double image[3];
    orb_place place;
    reflect(&m->trial, position(m, m->sample[i]), image);
    m->distance[i] = sqrt(orb_nearest_query(m->tree, image, INFINITY, &place)) / m->diagonal;
    orb_place_position(m->mesh, &place, m->hit + 3 * i);
  }
}

/* One step of closest points from m->trial. Far samples count less: a posed limb must not rotate the plane. */
static orb_status refine(orb_context *ctx, mirror *m, int32_t samples) {
  plane *p = &m->trial;
  double from[3] = {0, 0, 0}, to[3] = {0, 0, 0}, weight = 0, sum = 0, s[9] = {0};
  orb_parallel_for(ctx, samples, 16, find_hits, m);
  for (int pass = 0; pass < 2; pass++) {
    for (int32_t i = 0; i < samples; i++) {
      const double *x = position(m, m->sample[i]), *y = m->hit + 3 * (size_t)i;
      double d = m->distance[i] / m->params->mirror.symmetric, w = 1 / (1 + d * d);
      if (pass == 0) {
        sum += m->distance[i];
        weight += w;
      }
      for (int k = 0; k < 9; k++) {
        int i0 = k / 3, i1 = k % 3;
        if (pass == 1) {
          s[k] += w * ((x[i0] - from[i0]) * (y[i1] - to[i1]) + (x[i1] - from[i1]) * (y[i0] - to[i0]));
        } else if (k < 3) {
          from[k] += w * x[k];
          to[k] += w * y[k];
        }
      }
    }
    for (int k = 0; k < 3 && pass == 0; k++) {
      from[k] /= weight;
      to[k] /= weight;
    }
  }
  p->residual = sum / samples;
  least_axis(s, p->normal);
  p->offset = 0.5 * (orb_dot(p->normal, from) + orb_dot(p->normal, to));
  return orb_context_check(ctx);
}

/* The principal axes first, then the diagonals between two and between three of them. */
static void start_planes(const mirror *m, plane out[DIRECTIONS]) {
  static const signed char way[DIRECTIONS][3] = {{1, 0, 0},  {0, 1, 0},  {0, 0, 1},  {1, 1, 0},  {1, -1, 0},
                                                 {1, 0, 1},  {1, 0, -1}, {0, 1, 1},  {0, 1, -1}, {1, 1, 1},
                                                 {1, 1, -1}, {1, -1, 1}, {1, -1, -1}};
  double centre[3] = {0, 0, 0}, c[9] = {0}, u[9], s[3], v[9];
  for (int32_t i = 0; i < 3 * m->count; i++) {
    centre[i % 3] += position(m, m->sample[i / 3])[i % 3] / m->count;
  }
  for (int32_t i = 0; i < m->count; i++) {
    const double *x = position(m, m->sample[i]);
    for (int k = 0; k < 9; k++) {
      c[k] += (x[k / 3] - centre[k / 3]) * (x[k % 3] - centre[k % 3]);
    }
  }
  orb_svd3(c, u, s, v);
  for (int i = 0; i < DIRECTIONS; i++) {
    for (int k = 0; k < 3; k++) {
      out[i].normal[k] = way[i][0] * v[3 * k] + way[i][1] * v[3 * k + 1] + way[i][2] * v[3 * k + 2];
    }
    orb_normalize(out[i].normal);
    out[i].offset = orb_dot(out[i].normal, centre);
    out[i].residual = INFINITY;
  }
}

static orb_status try_plane(orb_context *ctx, mirror *m, const plane *start) {
  const orb_map_params *p = m->params;
  int32_t few = m->count < p->mirror.few_samples ? m->count : p->mirror.few_samples;
  double last = INFINITY;
  m->trial = *start;
  for (int step = 0; step < p->mirror.first_steps; step++) {
    ORB_TRY(refine(ctx, m, few));
  }
  for (int step = 0; step < p->mirror.steps && m->trial.residual <= p->mirror.hopeless &&
                     fabs(last - m->trial.residual) > p->mirror.settled;
       step++) {
    last = m->trial.residual;
    ORB_TRY(refine(ctx, m, m->count));
  }
  int good = m->trial.residual <= p->mirror.symmetric && m->plane_count < ORB_MAP_MIRROR_PLANES;
  for (int32_t j = 0; j < m->plane_count && good; j++) {
    good = fabs(orb_dot(m->planes[j].normal, m->trial.normal)) < p->mirror.same;
  }
  if (good) {
    m->planes[m->plane_count++] = m->trial;
  }
  return ORB_OK;
}

/* Finds the planes of shape s; tries the diagonals only if no axis leads to a plane. */
static orb_status find_planes(orb_context *ctx, void *arg, int32_t s) {
  mirror *m = (mirror *)arg + s;
  const orb_mesh *mesh = m->mesh;
  orb_extent extent;
  plane start[DIRECTIONS];
  orb_mesh_extent(mesh, &extent);
  m->diagonal = extent.diagonal > 0 ? extent.diagonal : 1;
  m->count = mesh->vertex_count < ORB_MAP_MIRROR_SAMPLES ? mesh->vertex_count : ORB_MAP_MIRROR_SAMPLES;
  ORB_TRY(orb_nearest_create(ctx, mesh->positions, mesh->triangles, mesh->triangle_count, &m->tree));
  ORB_TRY(orb_map_spread(ctx, mesh->positions, mesh->vertex_count, m->count, m->sample));
  start_planes(m, start);
  for (int i = 0; i < DIRECTIONS && (i < 3 || m->plane_count == 0); i++) {
    ORB_TRY(try_plane(ctx, m, &start[i]));
  }
  return ORB_OK;
}

static double off_plane(const mirror *m, const plane *p, int32_t vertex) {
  return (orb_dot(p->normal, position(m, vertex)) - p->offset) / m->diagonal;
}

/* The planes of the two shapes from which the signed distances of the landmarks correlate most. */
static int match_planes(const mirror m[2], const int32_t *const landmarks[2], int32_t count, const plane *out[2]) {
  double best = m[0].params->mirror.alike;
  int found = 0;
  for (int32_t i = 0; i < m[0].plane_count; i++) {
    for (int32_t j = 0; j < m[1].plane_count; j++) {
      double ab = 0, aa = 0, bb = 0;
      for (int32_t k = 0; k < count; k++) {
        double a = off_plane(&m[0], &m[0].planes[i], landmarks[0][k]);
        double b = off_plane(&m[1], &m[1].planes[j], landmarks[1][k]);
        ab += a * b;
        aa += a * a;
        bb += b * b;
      }
      if (fabs(ab) > best * sqrt(aa * bb)) {
        best = fabs(ab) / sqrt(aa * bb);
        out[0] = &m[0].planes[i];
        out[1] = &m[1].planes[j];
        found = 1;
      }
    }
  }
  return found;
}

/* Is one of these vertices at x? */
static int is_taken(const mirror *m, const double x[3], const int32_t *vertices, int32_t count) {
  double limit = m->params->mirror.taken * m->diagonal;
  for (int32_t i = 0; i < count; i++) {
    if (orb_distance2(position(m, vertices[i]), x) < limit * limit) {
      return 1;
    }
  }
  return 0;
}

/* The vertex at a landmark's mirror image; −1: there is none, or the landmark is its own mirror image. */
static int32_t image_of(const mirror *m, const plane *p, int32_t landmark) {
  orb_place place;
  double image[3];
  reflect(p, position(m, landmark), image);
  double d = sqrt(orb_nearest_query(m->tree, image, INFINITY, &place));
  if (fabs(off_plane(m, p, landmark)) < m->params->mirror.middle || d > m->params->mirror.off_surface * m->diagonal) {
    return -1;
  }
  return orb_map_nearest_corner(m->mesh->triangles, &place);
}

orb_status orb_map_mirror_landmarks(orb_context *ctx, const orb_map_params *params, const orb_mesh *const meshes[2],
                                    const int32_t *const landmarks[2], int32_t count, int32_t *const images[2],
                                    int32_t *image_count) {
  orb_status status = ORB_OK;
  mirror *m = ORB_NEW0(ctx, mirror, 2);
  const plane *planes[2];
  int32_t n = *image_count = 0;
  if (!m) {
    return ORB_E_NO_MEMORY;
  }
  for (int s = 0; s < 2; s++) {
    m[s].params = params;
    m[s].mesh = meshes[s];
  }
  ORB_GO(status, orb_tasks_run(ctx, 2, find_planes, m), done);
  if (!match_planes(m, landmarks, count, planes)) {
    goto done;
  }
  for (int32_t i = 0; i < count; i++) {
    int good = 1;
    for (int s = 0; s < 2 && good; s++) {
      int32_t v = images[s][n] = image_of(&m[s], planes[s], landmarks[s][i]);
      good = v >= 0 && !is_taken(&m[s], position(&m[s], v), landmarks[s], count) &&
             !is_taken(&m[s], position(&m[s], v), images[s], n);
    }
    n += good;
  }
  *image_count = n;
done:
  orb_nearest_destroy(ctx, m[0].tree);
  orb_nearest_destroy(ctx, m[1].tree);
  orb_free(ctx, m);
  return status;
}
