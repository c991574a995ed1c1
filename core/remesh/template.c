/* The template method: the supermesh is the first shape's own mesh, its vertices and triangles in their order.
 *
 * Alignment may have split triangles of the first shape. The triangles that lie in one triangle of the given mesh form
 * a disc, whose boundary holds exactly three vertices of the given mesh: its corners. With them the given triangulation
 * comes back. Alignment certifies the split one only, so where a triangle of the given one is flipped on the sphere,
 * its corners move until none is (see unflip()). The other shapes are then sampled where the vertices lie. */
#include "remesh/common/job.h"

#include <string.h>

#include "base/check.h"
#include "base/context.h"
#include "base/error.h"
#include "base/memory.h"
#include "numeric/predicates.h"
#include "numeric/vec3.h"
#include "remesh/placed/export.h"
#include "remesh/placed/placed_net.h"

/* Rounds of moving the corners of flipped triangles, which are few and lie next to landmarks within triangles; and the
 * least part of the way to the mean of the neighbours that is tried. */
enum { ROUNDS = 20 };
static const double STEP_LEAST = 0.01;

/* The given mesh of the first shape, rebuilt. */
typedef struct given_mesh {
  int32_t vertex_count, triangle_count;
  int32_t *vertex; /* per given vertex: its vertex on the aligned mesh */
  double *points;
  int32_t *triangles, *twin;
} given_mesh;

static void given_free(orb_context *ctx, given_mesh *given) {
  orb_free(ctx, given->vertex);
  orb_free(ctx, given->points);
  orb_free(ctx, given->triangles);
  orb_free(ctx, given->twin);
}

/* The given triangle that triangle t is part of. A shape that alignment has not made has no parents and is not split.
 */
static int32_t parent_of(const orb_aligned_shape *shape, int32_t t) {
  return shape->parent ? shape->parent[t] : t;
}

/* The next half-edge along the boundary of the disc that h bounds. */
static int32_t next_of_boundary(const orb_aligned_shape *shape, const int32_t *twin, int32_t h) {
  int32_t parent = parent_of(shape, h / 3);
  h = orb_next(h);
  while (parent_of(shape, twin[h] / 3) == parent) {
    h = orb_next(twin[h]);
  }
  return h;
}

/* Numbers the vertices that the aligned mesh has from the given one, in their order. number: −1 for the others. */
static orb_status number_vertices(orb_context *ctx, const orb_aligned_shape *shape, int32_t *number,
                                  given_mesh *given) {
  const orb_mesh *mesh = &shape->mesh;
  given->vertex = ORB_NEW(ctx, int32_t, mesh->vertex_count);
  given->points = ORB_NEW(ctx, double, 3 * (int64_t)mesh->vertex_count);
  if (!given->vertex || !given->points) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t v = 0; v < mesh->vertex_count; v++) {
    number[v] = -1;
    if (!mesh->source || mesh->source[v] >= 0) {
      number[v] = given->vertex_count++;
      given->vertex[number[v]] = v;
      memcpy(given->points + 3 * (int64_t)number[v], shape->points + 3 * (int64_t)v, 3 * sizeof(double));
    }
  }
  return ORB_OK;
}

static orb_status rebuild_triangles(orb_context *ctx, const orb_aligned_shape *shape, const int32_t *twin,
                                    const int32_t *number, given_mesh *given) {
  given->triangle_count = 2 * given->vertex_count - 4;
  given->triangles = ORB_NEW(ctx, int32_t, 3 * (int64_t)given->triangle_count);
  if (!given->triangles) {
    return ORB_E_NO_MEMORY;
  }
  memset(given->triangles, -1, 3 * (size_t)given->triangle_count * sizeof *given->triangles);
  for (int32_t h = 0; h < 3 * shape->mesh.triangle_count; h++) {
    int32_t parent = parent_of(shape, h / 3);
    ORB_ASSERT(parent >= 0 && parent < given->triangle_count);
    if (parent_of(shape, twin[h] / 3) == parent || given->triangles[3 * (int64_t)parent] >= 0) {
      continue;
    }
    int corners = 0;
    for (int32_t at = h;;) {
      int32_t v = number[shape->mesh.triangles[at]];
      if (v >= 0) {
        ORB_ASSERT(corners < 3);
        given->triangles[3 * (int64_t)parent + corners++] = v;
      }
      at = next_of_boundary(shape, twin, at);
      if (at == h) {
        break;
      }
    }
    ORB_ASSERT(corners == 3);
  }
  return ORB_OK;
}

static orb_status rebuild(orb_context *ctx, const orb_remesh_job *job, given_mesh *given) {
  const orb_aligned_shape *shape = &job->shapes[0];
  int32_t *number = ORB_NEW(ctx, int32_t, shape->mesh.vertex_count);
  orb_status status = number ? number_vertices(ctx, shape, number, given) : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    status = rebuild_triangles(ctx, shape, job->twin[0], number, given);
  }
  orb_free(ctx, number);
  if (status != ORB_OK) {
    return status;
  }
  given->twin = ORB_NEW(ctx, int32_t, 3 * (int64_t)given->triangle_count);
  return given->twin ? orb_mesh_twins(ctx, given->triangles, given->triangle_count, given->vertex_count, given->twin)
                     : ORB_E_NO_MEMORY;
}

static int is_flipped(const orb_net *net, int64_t triangle) {
  const int32_t *t = net->triangles + 3 * triangle;
  return orb_orient(orb_net_point(net, t[0]), orb_net_point(net, t[1]), orb_net_point(net, t[2])) <= 0;
}

static int64_t count_flipped(const orb_net *net) {
  int64_t count = 0;
  for (int64_t t = 0; t < net->triangle_count; t++) {
    count += is_flipped(net, t);
  }
  return count;
}

/* Moves v to the mean direction of its neighbours, or as far towards it as no triangle around v is flipped. */
static void move_inwards(orb_net *net, int32_t v) {
  double mean[3] = {0}, p[3];
  int32_t first = net->out[v], h = first;
  do {
    for (int k = 0; k < 3; k++) {
      mean[k] += orb_net_point(net, net->triangles[orb_next(h)])[k];
    }
    h = net->twin[orb_prev(h)];
  } while (h != first);
  orb_normalize(mean);
  for (double step = 1; step > STEP_LEAST; step /= 2) {
    for (int k = 0; k < 3; k++) {
      p[k] = (1 - step) * orb_net_point(net, v)[k] + step * mean[k];
    }
    orb_normalize(p);
    if (orb_net_move(net, v, p)) {
      return;
    }
  }
}

/* Moves the corners of flipped triangles, but for landmarks, until none is flipped or ROUNDS are over. */
static int64_t unflip(const orb_remesh_job *job, const given_mesh *given, orb_net *net) {
  const int32_t *landmarks = job->shapes[0].landmark_vertices;
  int64_t flipped = count_flipped(net);
  for (int round = 0; round < ROUNDS && flipped > 0; round++) {
    for (int64_t h = 0; h < 3 * (int64_t)net->triangle_count; h++) {
      int32_t v = net->triangles[h];
      int is_landmark = 0;
      for (int32_t l = 0; l < job->landmark_count && is_flipped(net, h / 3); l++) {
        is_landmark |= landmarks[l] == given->vertex[v];
      }
      if (!is_landmark && is_flipped(net, h / 3)) {
        move_inwards(net, v);
      }
    }
    flipped = count_flipped(net);
  }
  return flipped;
}

/* Names the landmarks at and within the triangles that stay flipped. */
static orb_status refuse(orb_context *ctx, const orb_remesh_job *job, const orb_net *net, int64_t flipped) {
  const orb_aligned_shape *shape = &job->shapes[0];
  unsigned char *at = ORB_NEW0(ctx, unsigned char, shape->mesh.vertex_count);
  if (!at) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t h = 0; h < 3 * shape->mesh.triangle_count; h++) {
    at[shape->mesh.triangles[h]] |= (unsigned char)is_flipped(net, parent_of(shape, h / 3));
  }
  orb_status status = orb_fail(ctx, ORB_E_BAD_LANDMARKS,
                               "The landmarks flip %lld %s of the first shape, and the method 'template' splits no "
                               "triangle; move or drop one of the landmarks at them, or use the method 'adaptive'.",
                               (long long)flipped, flipped == 1 ? "triangle" : "triangles");
  orb_error *error = orb_context_error_edit(ctx);
  error->shape = 0;
  for (int32_t l = 0; l < job->landmark_count && error->landmark_count < ORB_ERROR_ITEMS; l++) {
    int32_t v = shape->landmark_vertices[l];
    if (v >= 0 && at[v]) {
      error->landmarks[error->landmark_count++] = l;
    }
  }
  orb_free(ctx, at);
  return status;
}

/* The first shape is its own mesh: each vertex lies exactly at itself, and the distance is 0. */
static void place_first(const orb_remesh_job *job, const given_mesh *given, int32_t *corner_of, orb_supermesh *out) {
  const orb_mesh *mesh = &job->shapes[0].mesh;
  for (int32_t h = 0; h < 3 * mesh->triangle_count; h++) {
    corner_of[mesh->triangles[h]] = h;
  }
  for (int32_t v = 0; v < given->vertex_count; v++) {
    int32_t h = corner_of[given->vertex[v]];
    orb_place place = {.triangle = h / 3};
    place.at[h % 3] = 1;
    out->places[v] = place;
  }
  out->error_bound[0] = 0;
}

orb_status orb_remesh_template(orb_context *ctx, const orb_remesh_job *job, orb_supermesh *out) {
  given_mesh given = {0};
  orb_net net = {0};
  orb_placed_net placed = {0};
  int32_t *corner_of = ORB_NEW(ctx, int32_t, job->shapes[0].mesh.vertex_count);
  orb_status status = corner_of ? rebuild(ctx, job, &given) : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    status = orb_net_init(ctx, &net, given.points, given.vertex_count, given.triangles, given.triangle_count,
                          given.twin, given.vertex_count);
  }
  int64_t flipped = status == ORB_OK ? unflip(job, &given, &net) : 0;
  if (flipped > 0) {
    status = refuse(ctx, job, &net, flipped);
  }
  if (status == ORB_OK) {
    status = orb_placed_create_on(ctx, job, &net, &placed);
  }
  if (status == ORB_OK) {
    status = orb_placed_export(ctx, &placed, out);
  }
  if (status == ORB_OK) {
    place_first(job, &given, corner_of, out);
  }
  orb_placed_free(ctx, &placed);
  orb_net_free(ctx, &net);
  given_free(ctx, &given);
  orb_free(ctx, corner_of);
  return status;
}
