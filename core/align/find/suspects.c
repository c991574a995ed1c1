/* A registration in space, as rigid as possible, that follows the composed map at first and then lets go of it
 * (elastic/elastic.h). Where a landmark pulls the map out of place, the surface slides back. How far the registration
 * takes a landmark of one shape from its place on the other one is its drift. A landmark with a long drift in both
 * directions may be misplaced, and the drift ends near the right place.
 *
 * A landmark's share of the distortion is that of the map's triangles nearer to it than to any other landmark.
 *
 * Rejected: aligning coarse copies without each of the landmarks. The energies of two such maps differ by more than a
 * misplaced landmark costs: without one of 21 true landmarks, 2.26 fell to 1.69 or rose to 3.70. It also took 0.6 s for
 * each landmark. */
#include "align/find/suspects.h"

#include <math.h>
#include <string.h>

#include "align/find/params.h"
#include "align/map/engine/params.h"
#include "align/sheet/copy.h"
#include "base/check.h"
#include "base/context.h"
#include "base/memory.h"
#include "base/tasks.h"
#include "elastic/carry.h"
#include "elastic/elastic.h"
#include "numeric/vec3.h"
#include "orbmorph/locate.h"

enum { LANDMARKS_LEAST = 4 }; /* of the alignment; fewer name no suspects */
/* Least drift of a suspect, in both directions. Chosen on dog and giraffe of tests/samples alone: their true landmarks
 * drift by 0.04 at most in the direction in which they drift less; four, each moved by 0.15, drift by 0.12 or more. */
static const double DRIFT_LEAST = 0.08;

/* A shape of the pair: its copy, scaled to the area 4π around its middle. */
typedef struct side {
  const orb_mesh *mesh; /* as given */
  const orb_aligned_shape *aligned;
  orb_coarse_copy copy;
  double scale, middle[3], diagonal;
  int32_t *to;   /* the vertex of the other copy, for each vertex of this one */
  double *image; /* where the map takes it, in the other one's scaled space; 3 per vertex */
} side;

static void side_free(orb_context *ctx, side *s) {
  orb_coarse_copy_free(ctx, &s->copy);
  orb_free(ctx, s->to);
  orb_free(ctx, s->image);
}

static void scale_point(const side *s, const double x[3], double out[3]) {
  for (int k = 0; k < 3; k++) {
    out[k] = (x[k] - s->middle[k]) * s->scale;
  }
}

static orb_status side_create(orb_context *ctx, const orb_mesh *mesh, const orb_aligned_shape *aligned, side *out) {
  orb_extent extent;
  orb_mesh_extent(mesh, &extent);
  *out = (side){.mesh = mesh, .aligned = aligned, .diagonal = extent.diagonal};
  out->scale = extent.area > 0 ? sqrt(4 * M_PI / extent.area) : 1;
  for (int k = 0; k < 3; k++) {
    out->middle[k] = 0.5 * (extent.min[k] + extent.max[k]);
  }
  ORB_TRY(orb_coarse_copy_create(ctx, mesh, ORB_FIND_COARSE, &out->copy));
  out->to = ORB_NEW(ctx, int32_t, out->copy.mesh.vertex_count);
  for (int32_t v = 0; v < out->copy.mesh.vertex_count; v++) {
    double *x = out->copy.mesh.positions + 3 * (size_t)v;
    scale_point(out, x, x);
  }
  out->image = ORB_NEW(ctx, double, 3 * (size_t)out->copy.mesh.vertex_count);
  return out->to && out->image ? ORB_OK : ORB_E_NO_MEMORY;
}

/* The map of the alignment, between vertices of the copies. */
static orb_status read_map(orb_context *ctx, side *from, const side *to) {
  const orb_mesh *mesh = &to->aligned->mesh, *coarse = &to->copy.mesh;
  orb_locator *locator = NULL;
  orb_nearest *tree = NULL;
  orb_status status;
  ORB_GO(status,
         orb_locator_create(ctx, to->aligned->points, mesh->vertex_count, mesh->triangles, mesh->triangle_count, NULL,
                            &locator),
         end);
  ORB_GO(status, orb_nearest_create(ctx, coarse->positions, coarse->triangles, coarse->triangle_count, &tree), end);
  for (int32_t v = 0; v < from->copy.mesh.vertex_count; v++) {
    orb_place place;
    double x[3];
    orb_locate(locator, from->aligned->points + 3 * (size_t)from->copy.vertex[v], -1, &place);
    orb_place_position(mesh, &place, x);
    scale_point(to, x, x);
    memcpy(from->image + 3 * (size_t)v, x, sizeof x);
    orb_nearest_query(tree, x, INFINITY, &place);
    int most = place.at[1] > place.at[0] ? 1 : 0;
    most = place.at[2] > place.at[most] ? 2 : most;
    from->to[v] = coarse->triangles[3 * (size_t)place.triangle + (size_t)most];
  }
end:
  orb_nearest_destroy(ctx, tree);
  orb_locator_destroy(ctx, locator);
  return status;
}

/* Finds where the registration of one side to the other takes the landmarks: the nearest places on the given mesh. at:
 * the landmarks' positions on `from`, scaled. */
static orb_status carry_landmarks(orb_context *ctx, const side *from, const side *to, const double *at, int32_t count,
                                  orb_place *out) {
  const orb_rough_map map = {from->to, to->to};
  size_t n = (size_t)from->copy.mesh.vertex_count;
  orb_elastic_pose pose = {ORB_NEW(ctx, double, 3 * n), ORB_NEW(ctx, double, 9 * n)};
  orb_elastic_pose carried = {ORB_NEW(ctx, double, 3 * (size_t)count), NULL};
  orb_nearest *tree = NULL;
  orb_status status = pose.position && pose.rotation && carried.position ? ORB_OK : ORB_E_NO_MEMORY;
  double bend;
  if (status != ORB_OK) {
    goto end;
  }
  ORB_GO(status, orb_elastic_register(ctx, &from->copy.mesh, &to->copy.mesh, NULL, &map, NULL, &pose, &bend), end);
  ORB_GO(status, orb_elastic_carry(ctx, &from->copy.mesh, &pose, at, count, &carried), end);
  ORB_GO(status, orb_nearest_create(ctx, to->mesh->positions, to->mesh->triangles, to->mesh->triangle_count, &tree),
         end);
  for (int32_t i = 0; i < count; i++) {
    double x[3];
    for (int k = 0; k < 3; k++) {
      x[k] = carried.position[3 * i + k] / to->scale + to->middle[k];
    }
    orb_nearest_query(tree, x, INFINITY, &out[i]);
  }
end:
  orb_nearest_destroy(ctx, tree);
  orb_free(ctx, pose.position);
  orb_free(ctx, pose.rotation);
  orb_free(ctx, carried.position);
  return status;
}

/* The drift of each landmark from one side to the other, relative to the diagonal, and where it ends. */
static orb_status drifts(orb_context *ctx, const side sides[2], int from, const orb_landmark *landmarks, int32_t shape,
                         int32_t count, orb_place *end, double *drift) {
  const side *a = &sides[from], *b = &sides[1 - from];
  double *at = ORB_NEW(ctx, double, 3 * (size_t)count);
  if (!at) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t i = 0; i < count; i++) {
    double x[3];
    orb_place_position(a->mesh, &landmarks[i].at[from ? shape : 0], x);
    scale_point(a, x, at + 3 * i);
  }
  orb_status status = carry_landmarks(ctx, a, b, at, count, end);
  orb_free(ctx, at);
  for (int32_t i = 0; i < count && status == ORB_OK; i++) {
    double x[3], y[3];
    orb_place_position(b->mesh, &end[i], x);
    orb_place_position(b->mesh, &landmarks[i].at[from ? 0 : shape], y);
    drift[i] = sqrt(orb_distance2(x, y)) / b->diagonal;
  }
  return status;
}

/* (σ₁² + σ₂²)/4 · (1 + 1/(σ₁σ₂)²) − 1 of the map of a triangle of the copy, capped, times its area. */
static double excess_of(const side *a, const int32_t *v, double cap) {
  double g[2][3];
  for (int k = 0; k < 2; k++) {
    const double *x = k ? a->image : a->copy.mesh.positions;
    double p[3], q[3];
    orb_sub(x + 3 * (size_t)v[1], x + 3 * (size_t)v[0], p);
    orb_sub(x + 3 * (size_t)v[2], x + 3 * (size_t)v[0], q);
    g[k][0] = orb_dot(p, p);
    g[k][1] = orb_dot(p, q);
    g[k][2] = orb_dot(q, q);
  }
  double from = g[0][0] * g[0][2] - g[0][1] * g[0][1], to = g[1][0] * g[1][2] - g[1][1] * g[1][1];
  if (!(from > 0)) {
    return 0;
  }
  double trace = (g[0][2] * g[1][0] - 2 * g[0][1] * g[1][1] + g[0][0] * g[1][2]) / from;
  double energy = to > 0 ? fmin(cap, 0.25 * trace * (1 + from / to)) : cap;
  return fmax(0, energy - 1) * 0.5 * sqrt(from);
}

/* The share of the distortion around each landmark: of the triangles that are nearer to it than to the others. */
static orb_status measure_shares(orb_context *ctx, const side *a, const orb_landmark *landmarks, int32_t count,
                                 double cap, double *share) {
  double all = 0, *at = ORB_NEW(ctx, double, 3 * (size_t)count);
  if (!at) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t i = 0; i < count; i++) {
    double x[3];
    orb_place_position(a->mesh, &landmarks[i].at[0], x);
    scale_point(a, x, at + 3 * (size_t)i);
    share[i] = 0;
  }
  for (int32_t t = 0; t < a->copy.mesh.triangle_count; t++) {
    const int32_t *v = a->copy.mesh.triangles + 3 * (size_t)t;
    double excess = excess_of(a, v, cap), middle[3] = {0}, least = INFINITY;
    int32_t nearest = 0;
    for (int k = 0; k < 9; k++) {
      middle[k % 3] += a->copy.mesh.positions[3 * (size_t)v[k / 3] + (size_t)(k % 3)] / 3;
    }
    for (int32_t i = 0; i < count; i++) {
      double d = orb_distance2(middle, at + 3 * (size_t)i);
      nearest = d < least ? i : nearest;
      least = fmin(least, d);
    }
    share[nearest] += excess;
    all += excess;
  }
  for (int32_t i = 0; i < count; i++) {
    share[i] = all > 0 ? share[i] / all : 0;
  }
  orb_free(ctx, at);
  return ORB_OK;
}

/* Inserts a suspect by falling drift; a full list drops its last one. */
static void add_suspect(orb_alignment *out, const orb_suspect *one) {
  int32_t i = out->suspect_count;
  if (i < ORB_SUSPECTS_MAX) {
    out->suspect_count++;
  } else if (out->suspects[--i].distance >= one->distance) {
    return;
  }
  for (; i > 0 && out->suspects[i - 1].distance < one->distance; i--) {
    out->suspects[i] = out->suspects[i - 1];
  }
  out->suspects[i] = *one;
}

/* What is known of the landmarks between the first shape and another one, in both directions. */
typedef struct inquiry {
  const orb_align_shape *shapes;
  const orb_landmark *landmarks;
  const orb_alignment *alignment;
  int32_t shape; /* the other one */
  side sides[2];
  orb_place *end[2];
  double *drift[2];
} inquiry;

static orb_status open_side(orb_context *ctx, void *arg, int32_t s) {
  inquiry *q = arg;
  const int32_t shape = s ? q->shape : 0;
  return side_create(ctx, q->shapes[shape].mesh, &q->alignment->shapes[shape], &q->sides[s]);
}

static orb_status read_side(orb_context *ctx, void *arg, int32_t s) {
  inquiry *q = arg;
  return read_map(ctx, &q->sides[s], &q->sides[1 - s]);
}

static orb_status drift_from(orb_context *ctx, void *arg, int32_t s) {
  inquiry *q = arg;
  return drifts(ctx, q->sides, s, q->landmarks, q->shape, q->alignment->landmark_count, q->end[s], q->drift[s]);
}

static orb_status judge(orb_context *ctx, const orb_align_shape *shapes, const orb_landmark *landmarks, int32_t shape,
                        double cap, orb_alignment *out) {
  const int32_t count = out->landmark_count;
  inquiry q = {.shapes = shapes,
               .landmarks = landmarks,
               .alignment = out,
               .shape = shape,
               .end = {ORB_NEW(ctx, orb_place, count), ORB_NEW(ctx, orb_place, count)},
               .drift = {ORB_NEW(ctx, double, count), ORB_NEW(ctx, double, count)}};
  double *share = ORB_NEW(ctx, double, count);
  orb_status status = q.end[0] && q.end[1] && q.drift[0] && q.drift[1] && share ? ORB_OK : ORB_E_NO_MEMORY;
  if (status != ORB_OK) {
    goto done;
  }
  ORB_GO(status, orb_tasks_run(ctx, 2, open_side, &q), done);
  ORB_GO(status, orb_tasks_run(ctx, 2, read_side, &q), done);
  ORB_GO(status, orb_tasks_run(ctx, 2, drift_from, &q), done);
  ORB_GO(status, measure_shares(ctx, &q.sides[0], landmarks, count, cap, share), done);
  for (int32_t i = 0; i < count; i++) {
    out->landmark_shares[i] = fmax(out->landmark_shares[i], share[i]);
    if (fmin(q.drift[0][i], q.drift[1][i]) >= DRIFT_LEAST) {
      add_suspect(out, &(orb_suspect){i, shape, share[i], q.end[0][i], q.drift[0][i]});
    }
  }
done:
  for (int k = 0; k < 2; k++) {
    side_free(ctx, &q.sides[k]);
    orb_free(ctx, q.end[k]);
    orb_free(ctx, q.drift[k]);
  }
  orb_free(ctx, share);
  return status;
}

orb_status orb_align_suspects(orb_context *ctx, const orb_align_shape *shapes, const orb_landmark *landmarks,
                              const orb_align_options *options, orb_alignment *out) {
  const orb_map_params params = orb_map_params_of(options->preset);
  if (!(out->energy > params.energy.good) || out->landmark_count < LANDMARKS_LEAST) { /* also NaN: no composed map */
    return ORB_OK;
  }
  out->suspects = ORB_NEW0(ctx, orb_suspect, ORB_SUSPECTS_MAX);
  out->landmark_shares = ORB_NEW0(ctx, double, out->landmark_count);
  orb_status status = out->suspects && out->landmark_shares ? ORB_OK : ORB_E_NO_MEMORY;
  for (int32_t s = 1; s < out->shape_count && status == ORB_OK; s++) {
    status = judge(ctx, shapes, landmarks, s, params.energy.cap, out);
  }
  return status;
}
