/* Thins out a net before anything is proved: half-edge collapses that are accepted by a quadric alone (Garland &
 * Heckbert 1997). Without it, vertices that the tolerance does not need would be carried through the start, which
 * splits and flips edges between all vertices of all shapes, and then removed by collapses that are each proved.
 *
 * Vertices are visited in order of their numbers, in sweeps with a rising threshold: nearly the order of cost, without
 * a heap. A vertex moves onto the neighbour that lies nearest to the planes of both on all shapes. The guess of the
 * deviation is the root of the mean squared distance to the planes that have come together. */
#include "remesh/adaptive/thin.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "mesh/normals.h"
#include "numeric/predicates.h"
#include "numeric/vec3.h"
#include "remesh/adaptive/quadric.h"

enum { RING_MAX = 14 }; /* vertices with more neighbours stay, and no collapse makes one */
/* Thresholds of the sweeps, in units of the squared limit: more sweeps come nearer to the order of cost. */
static const double SWEEP[] = {0.01, 0.1, 0.4, 1, 1, 1};
/* A triangle may get thinner until its quality is LEAST_QUALITY, and tilt until its facing is LEAST_FACING (form.h
 * defines both): lower values leave needles and inverted triangles to the start, higher ones more triangles. */
static const double LEAST_QUALITY = 0.02, LEAST_FACING = 0.2;

typedef struct thinner {
  orb_net *net;
  int32_t shapes;
  double *const *position, *const *normal; /* per shape, 3 a net vertex */
  orb_quadric *quadric;                    /* per net vertex, one per shape */
  const unsigned char *fixed;              /* per net vertex: it stays */
  double *least; /* per net vertex: no target that is allowed costs less, until its ring changes */
} thinner;

static const double *position(const thinner *t, int32_t s, int32_t v) {
  return t->position[s] + 3 * (int64_t)v;
}

/* The half-edges that leave u, counter-clockwise; returns how many, 0 if too many. */
static int ring_of(const orb_net *net, int32_t u, int32_t edge[RING_MAX]) {
  int n = 0;
  int32_t first = net->out[u], h = first;
  do {
    if (n == RING_MAX) {
      return 0;
    }
    edge[n++] = h;
    h = net->twin[orb_prev(h)];
  } while (h != first);
  return n;
}

/* The mean squared distance to the planes of u and v, in weights of u, if u moves onto v. */
static double cost_of(const thinner *t, int32_t u, int32_t v) {
  double cost = 0, sum = 0;
  for (int32_t s = 0; s < t->shapes; s++) {
    const orb_quadric *own = &t->quadric[(int64_t)u * t->shapes + s], *other = &t->quadric[(int64_t)v * t->shapes + s];
    const double *x = position(t, s, v);
    cost += orb_quadric_at(own, x) + orb_quadric_at(other, x);
    sum += own->a[0] + own->a[3] + own->a[5]; /* the weights */
  }
  return sum > 0 ? cost / sum : INFINITY;
}

/* The least squared quality and signed squared facing of triangles, over all shapes. */
typedef struct form {
  double quality2, facing2;
} form;

/* Takes triangle (v, a, b) in. */
static void take_form(const thinner *t, int32_t v, int32_t a, int32_t b, form *least) {
  for (int32_t s = 0; s < t->shapes; s++) {
    const double *p = position(t, s, v), *q = position(t, s, a), *r = position(t, s, b), *normal = t->normal[s];
    double pq[3], pr[3], n[3], ground[3];
    orb_sub(q, p, pq);
    orb_sub(r, p, pr);
    orb_cross(pq, pr, n);
    for (int k = 0; k < 3; k++) {
      ground[k] = normal[3 * (int64_t)v + k] + normal[3 * (int64_t)a + k] + normal[3 * (int64_t)b + k];
    }
    double area2 = orb_dot(n, n), edges = orb_dot(pq, pq) + orb_dot(pr, pr) + orb_distance2(q, r);
    double along = orb_dot(n, ground);
    double quality2 = edges > 0 ? 12 * area2 / (edges * edges) : 0;
    double facing2 = area2 > 0 ? along * fabs(along) / (9 * area2) : 0;
    least->quality2 = quality2 < least->quality2 ? quality2 : least->quality2;
    least->facing2 = facing2 < least->facing2 ? facing2 : least->facing2;
  }
}

/* Whether the fan of v over the ring may replace the star of u: no triangle is thinner, or tilted farther from the
 * shape's normals, than both the threshold and the worst triangle of the star. */
static int forms_allow(const thinner *t, int32_t u, int32_t v, const int32_t *edge, int n) {
  const int32_t *corner = t->net->triangles;
  form after = {1, 1}, before = {1, 1};
  for (int i = 0; i < n; i++) {
    int32_t a = corner[orb_next(edge[i])], b = corner[orb_prev(edge[i])];
    if (a != v && b != v) {
      take_form(t, v, a, b, &after);
    }
  }
  if (after.quality2 >= LEAST_QUALITY * LEAST_QUALITY && after.facing2 >= LEAST_FACING * LEAST_FACING) {
    return 1;
  }
  for (int i = 0; i < n; i++) {
    take_form(t, u, corner[orb_next(edge[i])], corner[orb_prev(edge[i])], &before);
  }
  return after.quality2 >= fmin(before.quality2, LEAST_QUALITY * LEAST_QUALITY) &&
         after.facing2 >= fmin(before.facing2, LEAST_FACING * LEAST_FACING);
}

static int is_among(const orb_net *net, const int32_t *edge, int n, int32_t v) {
  for (int i = 0; i < n; i++) {
    if (net->triangles[orb_next(edge[i])] == v) {
      return 1;
    }
  }
  return 0;
}

/* Whether u may move onto the end of edge[at]: the surface stays simple and every triangle positive. */
static int is_allowed(const thinner *t, int32_t u, const int32_t *edge, int n, int at) {
  const orb_net *net = t->net;
  int32_t v = net->triangles[orb_next(edge[at])], other[RING_MAX];
  int m = ring_of(net, v, other), shared = 0;
  if (m == 0 || m + n - 4 > RING_MAX) {
    return 0;
  }
  for (int i = 0; i < m; i++) {
    shared += is_among(net, edge, n, net->triangles[orb_next(other[i])]);
  }
  if (shared != 2) {
    return 0;
  }
  for (int i = 0; i < n; i++) {
    int32_t a = net->triangles[orb_next(edge[i])], b = net->triangles[orb_prev(edge[i])];
    if (a == v || b == v) {
      continue;
    }
    if (!orb_net_clearly_positive(net, v, a, b)) {
      return 0;
    }
  }
  return forms_allow(t, u, v, edge, n);
}

/* Moves u onto the cheapest neighbour, if that costs at most `most` and is allowed. */
static void try_vertex(thinner *t, int32_t u, double most) {
  orb_net *net = t->net;
  int32_t edge[RING_MAX];
  int n = ring_of(net, u, edge), at = -1;
  t->least[u] = INFINITY;
  for (int i = 0; i < n; i++) {
    double cost = cost_of(t, u, net->triangles[orb_next(edge[i])]);
    if (cost < t->least[u]) {
      t->least[u] = cost;
      at = i;
    }
  }
  if (!(t->least[u] <= most)) {
    return;
  }
  t->least[u] = INFINITY;
  if (!is_allowed(t, u, edge, n, at)) {
    return;
  }
  int32_t v = net->triangles[orb_next(edge[at])];
  for (int i = 0; i < n; i++) {
    t->least[net->triangles[orb_next(edge[i])]] = 0;
  }
  orb_net_collapse(net, edge[at]);
  for (int32_t s = 0; s < t->shapes; s++) {
    orb_quadric_add(&t->quadric[(int64_t)v * t->shapes + s], &t->quadric[(int64_t)u * t->shapes + s]);
  }
}

static void sweep(thinner *t, double most) {
  for (int32_t u = 0; u < t->net->vertex_count; u++) {
    if (t->net->out[u] >= 0 && !t->fixed[u] && t->least[u] <= most) {
      try_vertex(t, u, most);
    }
  }
}

static void add_planes(const thinner *t) {
  const orb_net *net = t->net;
  for (int64_t f = 0; f < net->triangle_count; f++) {
    const int32_t *c = net->triangles + 3 * f;
    for (int32_t s = 0; s < t->shapes; s++) {
      orb_quadric plane;
      memset(&plane, 0, sizeof plane);
      orb_quadric_add_plane(&plane, position(t, s, c[0]), position(t, s, c[1]), position(t, s, c[2]));
      for (int k = 0; k < 3; k++) {
        orb_quadric_add(&t->quadric[(int64_t)c[k] * t->shapes + s], &plane);
      }
    }
  }
}

/* Thins a net on which `shapes` shapes are linear. position, normal: per shape, 3 a net vertex, the position divided by
 * the shape's diagonal and the unit normal; fixed: per net vertex. The guess of how far the net deviates from the
 * shapes stays within the limit (relative, squared); nothing is proved. */
static orb_status thin(orb_context *ctx, orb_net *net, int32_t shapes, double *const *position, double *const *normal,
                       const unsigned char *fixed, double limit2) {
  thinner t = {net,
               shapes,
               position,
               normal,
               ORB_NEW0(ctx, orb_quadric, (int64_t)net->vertex_count * shapes),
               fixed,
               ORB_NEW0(ctx, double, net->vertex_count)};
  orb_status status = t.quadric && t.least ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    add_planes(&t);
  }
  for (size_t i = 0; i < sizeof SWEEP / sizeof *SWEEP && status == ORB_OK; i++) {
    sweep(&t, SWEEP[i] * limit2);
    status = orb_context_check(ctx);
  }
  orb_free(ctx, t.quadric);
  orb_free(ctx, t.least);
  return status;
}

/* Positions and normals of the vertices of shape s in new arrays: its own, or those at the places. */
static orb_status take_shape(orb_context *ctx, const orb_remesh_job *job, int32_t s, const orb_place *places,
                             int64_t count, double **position, double **normal) {
  const orb_mesh *mesh = &job->shapes[s].mesh;
  double scale = job->diagonal[s] > 0 ? 1 / job->diagonal[s] : 1;
  double *smooth = ORB_NEW(ctx, double, 3 * (int64_t)mesh->vertex_count);
  *position = ORB_NEW(ctx, double, 3 * count);
  *normal = places ? ORB_NEW(ctx, double, 3 * count) : smooth;
  orb_status status = smooth && *position && *normal ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    status =
        orb_smooth_normals(ctx, mesh->positions, mesh->vertex_count, mesh->triangles, mesh->triangle_count, smooth);
  }
  for (int64_t i = 0; status == ORB_OK && i < 3 * count; i++) {
    if (!places) {
      (*position)[i] = scale * mesh->positions[i];
      continue;
    }
    const orb_place *at = &places[i / 3];
    double x = 0, n = 0;
    for (int k = 0; k < 3; k++) {
      int64_t corner = 3 * (int64_t)mesh->triangles[3 * (int64_t)at->triangle + k] + i % 3;
      x += at->at[k] * mesh->positions[corner];
      n += at->at[k] * smooth[corner];
    }
    (*position)[i] = scale * x;
    (*normal)[i] = n;
  }
  if (places) {
    orb_free(ctx, smooth);
  }
  return status;
}

orb_status orb_adaptive_thin_shape(orb_context *ctx, const orb_remesh_job *job, int32_t s, double limit2,
                                   orb_net *net) {
  const orb_aligned_shape *shape = &job->shapes[s];
  int32_t n = shape->mesh.vertex_count;
  double *position = NULL, *normal = NULL;
  memset(net, 0, sizeof *net);
  unsigned char *fixed = ORB_NEW0(ctx, unsigned char, n);
  orb_status status = fixed ? take_shape(ctx, job, s, NULL, n, &position, &normal) : ORB_E_NO_MEMORY;
  for (int32_t l = 0; status == ORB_OK && shape->landmark_vertices && l < job->landmark_count; l++) {
    if (shape->landmark_vertices[l] >= 0) {
      fixed[shape->landmark_vertices[l]] = 1;
    }
  }
  if (status == ORB_OK) {
    status =
        orb_net_init(ctx, net, shape->points, n, shape->mesh.triangles, shape->mesh.triangle_count, job->twin[s], n);
  }
  if (status == ORB_OK) {
    status = thin(ctx, net, 1, &position, &normal, fixed, limit2);
  }
  orb_free(ctx, position);
  orb_free(ctx, normal);
  orb_free(ctx, fixed);
  return status;
}

/* Marks the net vertices that are landmarks: their place on some shape is the landmark's vertex. */
static void fix_landmarks(const orb_remesh_job *job, const orb_supermesh *overlay, int32_t s, unsigned char *fixed) {
  const orb_aligned_shape *shape = &job->shapes[s];
  for (int32_t v = 0; shape->landmark_vertices && v < overlay->vertex_count; v++) {
    const orb_place *at = &overlay->places[(int64_t)s * overlay->vertex_count + v];
    int corner = at->at[0] == 1 ? 0 : at->at[1] == 1 ? 1 : at->at[2] == 1 ? 2 : -1;
    for (int32_t l = 0; corner >= 0 && l < job->landmark_count; l++) {
      fixed[v] |= shape->mesh.triangles[3 * (int64_t)at->triangle + corner] == shape->landmark_vertices[l];
    }
  }
}

orb_status orb_adaptive_thin_overlay(orb_context *ctx, const orb_remesh_job *job, const orb_supermesh *overlay,
                                     double limit2, orb_net *net) {
  int32_t shapes = job->shape_count;
  double **position = ORB_NEW0(ctx, double *, shapes), **normal = ORB_NEW0(ctx, double *, shapes);
  unsigned char *fixed = ORB_NEW0(ctx, unsigned char, overlay->vertex_count);
  memset(net, 0, sizeof *net);
  orb_status status = position && normal && fixed ? ORB_OK : ORB_E_NO_MEMORY;
  for (int32_t s = 0; s < shapes && status == ORB_OK; s++) {
    status = take_shape(ctx, job, s, overlay->places + (int64_t)s * overlay->vertex_count, overlay->vertex_count,
                        &position[s], &normal[s]);
    fix_landmarks(job, overlay, s, fixed);
  }
  if (status == ORB_OK) {
    status = orb_net_init(ctx, net, overlay->points, overlay->vertex_count, overlay->triangles, overlay->triangle_count,
                          NULL, overlay->vertex_count);
  }
  if (status == ORB_OK) {
    status = thin(ctx, net, shapes, position, normal, fixed, limit2);
  }
  for (int32_t s = 0; s < shapes; s++) {
    if (position) {
      orb_free(ctx, position[s]);
    }
    if (normal) {
      orb_free(ctx, normal[s]);
    }
  }
  orb_free(ctx, position);
  orb_free(ctx, normal);
  orb_free(ctx, fixed);
  return status;
}
