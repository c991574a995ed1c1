#include "remesh/placed/rims.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/context.h"
#include "base/grow.h"
#include "base/memory.h"
#include "numeric/predicates.h"
#include "numeric/vec3.h"
#include "remesh/placed/bound.h"
#include "remesh/placed/export.h"
#include "remesh/placed/placed_net.h"
#include "remesh/placed/refine.h"

/* If a vertex lies this near to the point where a rim crosses one of its edges, as a share of the edge, it moves there:
 * a new vertex beside it would make slivers. */
static const double NEAR = 0.05;
/* A vertex this near to a rim, on the unit sphere, lies on it: rounding of its point explains the distance. */
static const double ON = 1e-12;

enum { REFINEMENTS = 32 }; /* after this many, refinement counts as unable to finish the net */

/* A vertex this near to the opposite edge of its triangle makes a needle, across which nothing can be traced. The edge
 * is flipped. */
static const double FLAT = 1e-7;

enum { NEEDLES = 8 }; /* around one vertex, which are flipped; a guard */

typedef struct rims {
  orb_context *ctx;
  const orb_remesh_job *job;
  orb_net net;
  int32_t old_count;    /* vertices before */
  int32_t *vertex_of;   /* per vertex of the first shape: its net vertex, −1 */
  unsigned char *fixed; /* per old vertex: it must not move */
  int32_t (*edges)[2];  /* of which the rims consist */
  int64_t edge_count, edge_room;
  int failed; /* an edge could not be made */
} rims;

static int is_rim(const orb_remesh_job *job, int32_t h) {
  const int32_t *source = job->shapes[0].mesh.source_triangle;
  return source[h / 3] != ORB_MADE_FILL && source[job->twin[0][h] / 3] == ORB_MADE_FILL;
}

static int64_t count_rims(const orb_remesh_job *job) {
  const orb_mesh *mesh = &job->shapes[0].mesh;
  int64_t count = 0;
  for (int32_t h = 0; mesh->source_triangle && h < 3 * mesh->triangle_count; h++) {
    count += is_rim(job, h);
  }
  return count;
}

int orb_rims_any(const orb_remesh_job *job) {
  const orb_mesh *mesh = &job->shapes[0].mesh;
  int32_t filled = 0;
  for (int32_t t = 0; mesh->source_triangle && t < mesh->triangle_count; t++) {
    filled += mesh->source_triangle[t] == ORB_MADE_FILL;
  }
  return filled > 0 && filled < mesh->triangle_count; /* the surface is in one piece, so the two parts meet */
}

/* Only adaptive moves vertices of its own; the other methods keep those of the shapes. */
static void fix_vertices(rims *r) {
  const orb_remesh_job *job = r->job;
  const orb_aligned_shape *shape = &job->shapes[0];
  memset(r->fixed, job->options->method != ORB_REMESH_ADAPTIVE, (size_t)r->old_count);
  for (int32_t l = 0; shape->landmark_vertices && l < job->landmark_count; l++) {
    if (shape->landmark_vertices[l] < 0) {
      continue;
    }
    const double *p = shape->points + 3 * (int64_t)shape->landmark_vertices[l];
    for (int32_t v = 0; v < r->old_count; v++) {
      r->fixed[v] |= memcmp(orb_net_point(&r->net, v), p, 3 * sizeof *p) == 0;
    }
  }
}

static int can_move(const rims *r, int32_t v) {
  return v < r->old_count && !r->fixed[v];
}

/* Moves a vertex of the triangle at p there, if one is nearer than `reach` and may move. Rims lie where the surface has
 * edges on both shapes, so the method often has a vertex beside one. −1: none. */
static int32_t take_near(rims *r, const double p[3], double reach, int32_t *near) {
  const orb_sphere_view view = orb_net_view(&r->net);
  *near = orb_walk(&view, p, *near).triangle;
  for (int k = 0; k < 3; k++) {
    const int32_t v = r->net.triangles[3 * (int64_t)*near + k];
    if (can_move(r, v) && orb_distance2(orb_net_point(&r->net, v), p) < reach * reach && orb_net_move(&r->net, v, p)) {
      return v;
    }
  }
  return -1;
}

static orb_status insert_vertices(rims *r) {
  const orb_aligned_shape *shape = &r->job->shapes[0];
  int32_t near = 0;
  for (int32_t h = 0; h < 3 * shape->mesh.triangle_count; h++) {
    int32_t a = shape->mesh.triangles[h], b = shape->mesh.triangles[orb_next(h)];
    if (!is_rim(r->job, h)) {
      continue;
    }
    const double length = sqrt(orb_distance2(shape->points + 3 * (int64_t)a, shape->points + 3 * (int64_t)b));
    for (int end = 0; end < 2; end++) {
      int32_t at = end ? b : a;
      if (r->vertex_of[at] < 0) {
        const double *p = shape->points + 3 * (int64_t)at;
        int32_t v = take_near(r, p, NEAR * length, &near);
        v = v >= 0 ? v : orb_net_insert(&r->net, p, &near);
        r->vertex_of[at] = v;
        if (v < r->old_count) {
          r->fixed[v] = 1;
        }
      }
    }
  }
  return orb_context_check(r->ctx);
}

/* The distance of p from the great circle through a and b. */
static double off_circle(const double p[3], const double a[3], const double b[3]) {
  double n[3];
  orb_cross(a, b, n);
  orb_normalize(n);
  return fabs(orb_dot(n, p));
}

/* May the edge of h be flipped? Several points of a straight edge lie on one arc but for rounding, so that the
 * triangles between them are positive, but not clearly. */
static int can_flip(const orb_net *net, int32_t h) {
  const int32_t g = net->twin[h], c = net->triangles[orb_prev(h)], d = net->triangles[orb_prev(g)];
  const double *a = orb_net_point(net, net->triangles[h]), *b = orb_net_point(net, net->triangles[g]);
  return orb_net_can_flip(net, h) ||
         (c != d && orb_orient(orb_net_point(net, c), orb_net_point(net, d), b) > 0 &&
          orb_orient(orb_net_point(net, d), orb_net_point(net, c), a) > 0 && orb_net_edge(net, c, d) < 0);
}

/* Flips the edges on which rim vertices lie but for rounding. Such a needle is flat on the sphere, but where the rim of
 * another shape has a corner, it is not flat there. */
static void flip_needles(rims *r) {
  orb_net *net = &r->net;
  const int32_t vertices = r->job->shapes[0].mesh.vertex_count;
  for (int32_t i = 0; i < vertices; i++) {
    const int32_t v = r->vertex_of[i];
    for (int flips = 0, flipped = v >= 0; flipped && flips < NEEDLES; flips++) {
      int32_t first = net->out[v], h = first;
      flipped = 0;
      do {
        const int32_t across = orb_next(h);
        const double *p = orb_net_point(net, net->triangles[across]);
        const double *q = orb_net_point(net, net->triangles[orb_next(across)]);
        if (off_circle(orb_net_point(net, v), p, q) < FLAT && can_flip(net, across)) {
          orb_net_flip(net, across);
          flipped = 1;
        }
        h = net->twin[orb_prev(h)];
      } while (h != first && !flipped);
    }
  }
}

/* Where the arcs from v to w and from p to q meet. */
static void meet(const double v[3], const double w[3], const double p[3], const double q[3], double out[3]) {
  double first[3], second[3], toward[3];
  orb_cross(v, w, first);
  orb_cross(p, q, second);
  orb_cross(first, second, out);
  for (int k = 0; k < 3; k++) {
    toward[k] = p[k] + q[k];
  }
  if (orb_dot(out, toward) < 0) {
    for (int k = 0; k < 3; k++) {
      out[k] = -out[k];
    }
  }
  orb_normalize(out);
}

/* A vertex of the crossed edge that lies on the arc but for rounding, and nearer than w, moves onto it: where the two
 * are parallel, they meet anywhere. −1: there is none. */
static int32_t straighten(rims *r, const int32_t ends[2], const double *from, const double *to) {
  double n[3];
  orb_cross(from, to, n);
  orb_normalize(n);
  for (int k = 0; k < 2; k++) {
    const double *p = orb_net_point(&r->net, ends[k]), off = orb_dot(n, p);
    double on[3];
    if (fabs(off) >= FLAT || !can_move(r, ends[k]) || orb_dot(p, to) < orb_dot(from, to)) {
      continue;
    }
    for (int c = 0; c < 3; c++) {
      on[c] = p[c] - off * n[c];
    }
    orb_normalize(on);
    if (orb_net_move(&r->net, ends[k], on)) {
      r->fixed[ends[k]] = 1;
      return ends[k];
    }
  }
  return -1;
}

/* The vertex at which the arc to w leaves the star of v: one on the arc, or one made where the arc crosses the star's
 * boundary; v itself after a flip. −1: rounding allows none. Needs room for one vertex. */
static int32_t step(rims *r, int32_t v, int32_t w) {
  orb_net *net = &r->net;
  const double *from = orb_net_point(net, v), *to = orb_net_point(net, w);
  int32_t first = net->out[v], h = first, crossed = -1;
  do {
    int32_t p = net->triangles[orb_next(h)], q = net->triangles[orb_prev(h)];
    int left = orb_orient(from, orb_net_point(net, p), to), right = orb_orient(from, to, orb_net_point(net, q));
    if (left == 0 && orb_dot(orb_net_point(net, p), to) > orb_dot(from, to)) {
      return p; /* towards w, as it is nearer */
    }
    if (left > 0 && right > 0) {
      crossed = orb_next(h);
    }
    h = net->twin[orb_prev(h)];
  } while (h != first);
  if (crossed < 0) {
    return -1;
  }
  int32_t ends[2] = {net->triangles[crossed], net->triangles[orb_next(crossed)]};
  if (off_circle(from, orb_net_point(net, ends[0]), orb_net_point(net, ends[1])) < FLAT && can_flip(net, crossed)) {
    orb_net_flip(net, crossed);
    return v;
  }
  const int32_t straight = straighten(r, ends, from, to);
  if (straight >= 0) {
    return straight;
  }
  double x[3], length = sqrt(orb_distance2(orb_net_point(net, ends[0]), orb_net_point(net, ends[1])));
  meet(from, to, orb_net_point(net, ends[0]), orb_net_point(net, ends[1]), x);
  for (int k = 0; k < 2; k++) {
    if (orb_distance2(orb_net_point(net, ends[k]), x) < ON * ON) {
      return ends[k];
    }
    if (can_move(r, ends[k]) && sqrt(orb_distance2(orb_net_point(net, ends[k]), x)) < NEAR * length &&
        orb_net_move(net, ends[k], x)) {
      r->fixed[ends[k]] = 1;
      return ends[k];
    }
  }
  return orb_net_split_edge(net, crossed, x);
}

static orb_status add_edge(rims *r, int32_t v, int32_t w) {
  if (r->edge_count == r->edge_room) {
    r->edge_room = 2 * r->edge_room + 256;
    if (!orb_regrow(r->ctx, &r->edges, (size_t)r->edge_room, sizeof *r->edges)) {
      return ORB_E_NO_MEMORY;
    }
  }
  r->edges[r->edge_count][0] = v;
  r->edges[r->edge_count++][1] = w;
  return ORB_OK;
}

/* Makes the arc from v to w a chain of edges. */
static orb_status trace(rims *r, int32_t v, int32_t w) {
  for (int64_t steps = 0; v != w; steps++) {
    ORB_TRY(orb_net_reserve(r->ctx, &r->net, 1));
    int32_t next = orb_net_edge(&r->net, v, w) >= 0 ? w : steps > r->net.triangle_count ? -1 : step(r, v, w);
    if (next < 0) {
      r->failed = 1;
      return ORB_OK;
    }
    if (next != v) {
      ORB_TRY(add_edge(r, v, next));
    }
    v = next;
  }
  return orb_context_check(r->ctx);
}

/* A rim that was traced later may have changed the edges of another one. */
static int are_edges(const rims *r) {
  int all = 1;
  for (int64_t i = 0; i < r->edge_count && all; i++) {
    all = orb_net_edge(&r->net, r->edges[i][0], r->edges[i][1]) >= 0;
  }
  return all;
}

static orb_status trace_all(rims *r) {
  const orb_mesh *mesh = &r->job->shapes[0].mesh;
  for (int32_t h = 0; h < 3 * mesh->triangle_count && !r->failed; h++) {
    if (is_rim(r->job, h)) {
      ORB_TRY(trace(r, r->vertex_of[mesh->triangles[h]], r->vertex_of[mesh->triangles[orb_next(h)]]));
    }
  }
  r->failed |= !are_edges(r);
  return ORB_OK;
}

static int is_within(const orb_remesh_job *job, const double *bound) {
  for (int32_t s = 0; s < job->shape_count; s++) {
    if (!(bound[s] <= job->options->tolerance * job->diagonal[s] * (1 + ORB_REMESH_ROUNDING))) {
      return 0;
    }
  }
  return 1;
}

/* Computes the places of the net. Where the supermesh was within the tolerance, refines the net, but for the rims,
 * until it is, too; failed if that does not end. */
static orb_status place(rims *r, int keeps_tolerance, double *bound, orb_placed_net *placed) {
  const double limit = orb_remesh_limit(r->job);
  int64_t deviating = keeps_tolerance;
  ORB_TRY(orb_placed_create_on(r->ctx, r->job, &r->net, placed));
  ORB_TRY(orb_placed_keep(r->ctx, placed, (const int32_t(*)[2])r->edges, r->edge_count));
  for (int i = 0; i < REFINEMENTS && deviating > 0 && !placed->gave_up; i++) {
    ORB_TRY(orb_placed_refine(r->ctx, placed, limit * limit, &deviating));
  }
  ORB_TRY(orb_placed_bounds(r->ctx, placed, bound));
  r->failed = keeps_tolerance && !is_within(r->job, bound);
  return ORB_OK;
}

/* Replaces the supermesh by the net. */
static orb_status replace(rims *r, orb_supermesh *out) {
  const int64_t most = r->job->options->max_triangles;
  orb_placed_net placed = {0};
  double *bound = ORB_NEW(r->ctx, double, r->job->shape_count);
  orb_status status = bound ? place(r, is_within(r->job, out->error_bound), bound, &placed) : ORB_E_NO_MEMORY;
  if (status == ORB_OK && !r->failed && (most == 0 || placed.net.triangle_count <= most)) {
    orb_free(r->ctx, out->triangles);
    orb_free(r->ctx, out->points);
    orb_free(r->ctx, out->places);
    out->triangles = NULL;
    out->points = NULL;
    out->places = NULL;
    out->vertex_count = out->triangle_count = 0;
    status = orb_placed_export(r->ctx, &placed, out);
    out->has_rims = 1;
  }
  orb_placed_free(r->ctx, &placed);
  orb_free(r->ctx, bound);
  return status;
}

orb_status orb_rims_add(orb_context *ctx, const orb_remesh_job *job, orb_supermesh *out) {
  const int64_t count = count_rims(job);
  const int32_t vertices = job->shapes[0].mesh.vertex_count;
  if (count == 0) {
    return ORB_OK;
  }
  rims r = {.ctx = ctx, .job = job, .old_count = out->vertex_count};
  orb_status status;
  r.vertex_of = ORB_NEW(ctx, int32_t, vertices);
  r.fixed = ORB_NEW(ctx, unsigned char, out->vertex_count);
  if (!r.vertex_of || !r.fixed) {
    status = ORB_E_NO_MEMORY;
    goto done;
  }
  memset(r.vertex_of, -1, (size_t)vertices * sizeof *r.vertex_of);
  ORB_GO(status,
         orb_net_init(ctx, &r.net, out->points, out->vertex_count, out->triangles, out->triangle_count, NULL,
                      out->vertex_count + 2 * count),
         done);
  fix_vertices(&r);
  ORB_GO(status, insert_vertices(&r), done);
  flip_needles(&r);
  ORB_GO(status, trace_all(&r), done);
  status = r.failed ? ORB_OK : replace(&r, out);
done:
  orb_net_free(ctx, &r.net);
  orb_free(ctx, r.vertex_of);
  orb_free(ctx, r.fixed);
  orb_free(ctx, r.edges);
  return status;
}
