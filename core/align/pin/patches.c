/* Patches: they pin landmarks wherever these lie.
 *
 * A triangulation of the targets is traced on the shape; its paths cut the surface into one disc for each spherical
 * triangle. The vertices of a path are spread along the chord of their base edge, and every other vertex becomes a mean
 * of its neighbours with positive weights. That is Tutte's embedding (1963; Floater 1997) of each disc in the flat
 * triangle of its three targets, all in one linear system; central projection maps the triangles to the sphere. An edge
 * between two vertices of one path would lie on the chord, so it is split first. Weights are cotangents on the given
 * sphere, clamped positive: on it the shape has no thin limbs, which uniform weights would crush.
 */
#include <math.h>
#include <string.h>

#include "align/pin/base.h"
#include "align/pin/base_trace.h"
#include "align/pin/patches.h"
#include "align/pin/relax.h"
#include "base/check.h"
#include "base/memory.h"
#include "base/parallel.h"
#include "numeric/predicates.h"
#include "numeric/vec3.h"

enum { ITERATIONS = 4000 };          /* most steps of conjugate gradients; a guard: the residual ends them earlier */
static const double SETTLED = 1e-30; /* squared norm of the residual, relative to the first, that ends them */
static const double WEIGHT_LEAST = 0.1, WEIGHT_MOST = 10; /* cotangent weights are clamped to this range */

typedef struct patcher {
  orb_context *ctx;
  orb_sheet sheet; /* a copy of the shape that is refined */
  orb_sheet base;
  orb_paths paths;
  int32_t *at;  /* base vertex → sheet vertex */
  double *flat; /* 3 a sheet vertex: in the chord plane of its patch */
  unsigned char *fixed;
  double *weight; /* of each half-edge */
  int64_t *work;
} patcher;

static void patcher_free(patcher *p) {
  orb_sheet_free(p->ctx, &p->sheet);
  orb_sheet_free(p->ctx, &p->base);
  orb_paths_free(p->ctx, &p->paths);
  orb_free(p->ctx, p->at);
  orb_free(p->ctx, p->flat);
  orb_free(p->ctx, p->fixed);
  orb_free(p->ctx, p->weight);
}

/* The triangle whose image contains a direction: exact tests of all triangles, which cannot miss it. */
static int32_t triangle_at(const orb_sheet *s, const double p[3]) {
  const int32_t *tri = s->shape.mesh.triangles;
  const double *x = s->shape.points;
  for (int32_t t = 0; t < s->shape.mesh.triangle_count; t++) {
    const double *a = x + 3 * (size_t)tri[3 * t], *b = x + 3 * (size_t)tri[3 * t + 1],
                 *c = x + 3 * (size_t)tri[3 * t + 2];
    if (orb_orient(a, b, p) >= 0 && orb_orient(b, c, p) >= 0 && orb_orient(c, a, p) >= 0) {
      return t;
    }
  }
  return 0;
}

/* The base vertices on the sheet: the landmarks, and for each further point a new vertex near its direction. */
static orb_status locate_base(patcher *p, const int32_t *landmarks, int32_t count) {
  p->at = ORB_NEW(p->ctx, int32_t, count + ORB_BASE_EXTRA);
  if (!p->at) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t i = 0; i < ORB_BASE_EXTRA; i++) {
    int32_t t = triangle_at(&p->sheet, p->base.shape.points + 3 * (size_t)i);
    ORB_TRY(orb_sheet_split_triangle(p->ctx, &p->sheet, t, (const double[3]){1.0 / 3, 1.0 / 3, 1.0 / 3}, &p->at[i]));
  }
  for (int32_t k = 0; k < count; k++) {
    p->at[ORB_BASE_EXTRA + k] = p->sheet.shape.landmark_vertices[landmarks[k]];
  }
  return ORB_OK;
}

/* Do two vertices belong to one path? chain: of each vertex, the base edge inside whose path it lies, or −2 − b for
 * base vertex b, else −1. */
static int same_path(const patcher *p, const int32_t *chain, int32_t u, int32_t v) {
  const int32_t *corners = p->base.shape.mesh.triangles;
  if (chain[u] == -1 || chain[v] == -1) {
    return 0;
  }
  if (chain[u] >= 0 && chain[v] >= 0) {
    return chain[u] == chain[v];
  }
  if (chain[u] < -1 && chain[v] < -1) {
    return orb_sheet_edge(&p->base, -2 - chain[u], -2 - chain[v]) >= 0;
  }
  int32_t e = chain[u] >= 0 ? chain[u] : chain[v], b = -2 - (chain[u] < -1 ? chain[u] : chain[v]);
  return corners[e] == b || corners[orb_next(e)] == b;
}

/* Splits the edges beside a path that join two of its vertices. */
static orb_status split_chords(patcher *p) {
  orb_sheet *s = &p->sheet;
  orb_status status = ORB_OK;
  int32_t vertices = s->shape.mesh.vertex_count, half_edges = 3 * s->shape.mesh.triangle_count;
  int32_t *chain = ORB_NEW(p->ctx, int32_t, vertices);
  if (!chain) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t v = 0; v < vertices; v++) {
    chain[v] = -1;
  }
  for (int32_t h = 0; h < half_edges; h++) {
    if (p->paths.path[h] >= 0) {
      chain[s->shape.mesh.triangles[h]] = p->paths.path[h];
    }
  }
  for (int32_t b = 0; b < p->base.shape.mesh.vertex_count; b++) {
    chain[p->at[b]] = -2 - b;
  }
  for (int32_t h = 0; h < half_edges; h++) {
    int32_t u = s->shape.mesh.triangles[h], v = s->shape.mesh.triangles[orb_next(h)], m;
    if (u < vertices && v < vertices && p->paths.path[h] < 0 && same_path(p, chain, u, v)) {
      ORB_GO(status, orb_paths_split(p->ctx, s, &p->paths, h, &m), end);
    }
  }
end:
  orb_free(p->ctx, chain);
  return status;
}

/* The next vertex of a path beyond half-edge h. */
static int32_t path_on(const patcher *p, int32_t h) {
  const orb_sheet *s = &p->sheet;
  int32_t back = s->twin[h], g = orb_sheet_swing(s, back);
  while (g != back && p->paths.path[g] != p->paths.path[h]) {
    g = orb_sheet_swing(s, g);
  }
  return g;
}

/* Spreads the path of base half-edge b along its chord: half by its lengths on the old sphere, half evenly. */
static int spread_path(patcher *p, int32_t b) {
  const orb_sheet *s = &p->sheet;
  const int32_t *corners = p->base.shape.mesh.triangles, *tri = s->shape.mesh.triangles;
  int32_t from = corners[b], to = corners[orb_next(b)], start = s->corner[p->at[from]], h = start, limit = 0;
  const double *a = p->base.shape.points + 3 * (size_t)from, *c = p->base.shape.points + 3 * (size_t)to;
  while (p->paths.path[h] != b) {
    h = orb_sheet_swing(s, h);
    if (h == start) {
      return 0;
    }
  }
  double total = 0, sum = 0;
  int32_t edges = 0;
  for (int pass = 0; pass < 2; pass++) {
    for (int32_t g = h;; g = path_on(p, g)) {
      int32_t u = tri[g], v = tri[orb_next(g)];
      double length = sqrt(orb_distance2(s->shape.points + 3 * (size_t)u, s->shape.points + 3 * (size_t)v));
      if (pass == 0) {
        total += length;
        edges++;
      } else {
        sum += 0.5 * length / (total + ORB_TINY) + 0.5 / edges;
      }
      if (v == p->at[to]) {
        break;
      }
      if (pass == 1) {
        for (int k = 0; k < 3; k++) {
          p->flat[3 * (size_t)v + (size_t)k] = (1 - sum) * a[k] + sum * c[k];
        }
        p->fixed[v] = 1;
      }
      if (++limit > 2 * s->shape.mesh.vertex_count + 2) {
        return 0;
      }
    }
  }
  return 1;
}

static double cotangent(const double *apex, const double *a, const double *b) {
  double u[3], v[3], n[3];
  orb_sub(a, apex, u);
  orb_sub(b, apex, v);
  orb_cross(u, v, n);
  return orb_dot(u, v) / (orb_length(n) + ORB_TINY);
}

static orb_status set_border(patcher *p, int *good) {
  const orb_sheet *s = &p->sheet;
  const int32_t *tri = s->shape.mesh.triangles;
  const double *x = s->shape.points;
  size_t vertices = (size_t)s->shape.mesh.vertex_count, half_edges = 3 * (size_t)s->shape.mesh.triangle_count;
  p->flat = ORB_NEW0(p->ctx, double, 3 * vertices);
  p->fixed = ORB_NEW0(p->ctx, unsigned char, vertices);
  p->weight = ORB_NEW(p->ctx, double, half_edges);
  if (!p->flat || !p->fixed || !p->weight) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t h = 0; h < (int32_t)half_edges; h++) {
    int32_t g = s->twin[h];
    if (h < g) {
      const double *a = x + 3 * (size_t)tri[h], *b = x + 3 * (size_t)tri[g];
      double w =
          0.5 * (cotangent(x + 3 * (size_t)tri[orb_prev(h)], a, b) + cotangent(x + 3 * (size_t)tri[orb_prev(g)], a, b));
      p->weight[h] = p->weight[g] = w > WEIGHT_LEAST ? (w < WEIGHT_MOST ? w : WEIGHT_MOST) : WEIGHT_LEAST;
    }
  }
  for (int32_t b = 0; b < p->base.shape.mesh.vertex_count; b++) {
    memcpy(p->flat + 3 * (size_t)p->at[b], p->base.shape.points + 3 * (size_t)b, 3 * sizeof(double));
    p->fixed[p->at[b]] = 1;
  }
  *good = 1;
  for (int32_t b = 0; *good && b < 3 * p->base.shape.mesh.triangle_count; b++) {
    if (b < p->base.twin[b]) {
      *good = spread_path(p, b);
    }
  }
  return ORB_OK;
}

/* The weighted Laplacian of the free vertices, applied to three columns at once. */
typedef struct laplacian {
  const patcher *p;
  const double *in;
  double *out;
  int border; /* 1: fixed neighbours count too (the right-hand side), 0: they are zero */
} laplacian;

static void apply(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  const laplacian *l = arg;
  const orb_sheet *s = &l->p->sheet;
  const int32_t *tri = s->shape.mesh.triangles;
  for (int64_t v = begin; v < end; v++) {
    double sum[3] = {0, 0, 0}, diagonal = 0;
    double *out = l->out + 3 * v;
    out[0] = out[1] = out[2] = 0;
    if (l->p->fixed[v]) {
      continue;
    }
    int32_t start = s->corner[v], h = start;
    do {
      int32_t u = tri[orb_next(h)];
      double w = l->p->weight[h];
      diagonal += w;
      if (l->p->fixed[u] == l->border) {
        for (int k = 0; k < 3; k++) {
          sum[k] += w * l->in[3 * (size_t)u + (size_t)k];
        }
      }
      h = orb_sheet_swing(s, h);
    } while (h != start);
    for (int k = 0; k < 3; k++) {
      out[k] = l->border ? sum[k] : diagonal * l->in[3 * v + k] - sum[k];
    }
  }
}

static void diagonal_of(const patcher *p, double *out) {
  const orb_sheet *s = &p->sheet;
  for (int32_t v = 0; v < s->shape.mesh.vertex_count; v++) {
    int32_t start = s->corner[v], h = start;
    out[v] = 0;
    do {
      out[v] += p->weight[h];
      h = orb_sheet_swing(s, h);
    } while (h != start);
  }
}

static double dot(const double *a, const double *b, size_t n) {
  double sum = 0;
  for (size_t i = 0; i < n; i++) {
    sum += a[i] * b[i];
  }
  return sum;
}

/* Conjugate gradients with the diagonal as preconditioner. The three columns share the steps, which costs a few
 * iterations and saves two of three passes over the mesh. */
static orb_status solve(patcher *p, int *good) {
  orb_context *ctx = p->ctx;
  size_t vertices = (size_t)p->sheet.shape.mesh.vertex_count, n = 3 * vertices;
  double *block = ORB_NEW0(ctx, double, 5 * n + vertices);
  if (!block) {
    return ORB_E_NO_MEMORY;
  }
  double *x = block, *r = block + n, *z = block + 2 * n, *d = block + 3 * n, *q = block + 4 * n,
         *diagonal = block + 5 * n;
  orb_status status = ORB_OK;
  laplacian l = {.p = p, .in = p->flat, .out = r, .border = 1};
  diagonal_of(p, diagonal);
  orb_parallel_for(ctx, (int64_t)vertices, 2048, apply, &l);
  double first = 0, rho = 0;
  for (int i = 0; i < ITERATIONS && *good; i++) {
    *p->work -= (int64_t)vertices;
    *good = *p->work > 0;
    for (size_t k = 0; k < n; k++) {
      z[k] = r[k] / diagonal[k / 3];
    }
    double now = dot(r, z, n);
    if (i == 0) {
      first = now;
    }
    if (!(now > SETTLED * first)) {
      break;
    }
    for (size_t k = 0; k < n; k++) {
      d[k] = z[k] + (i ? now / rho : 0) * d[k];
    }
    rho = now;
    l = (laplacian){.p = p, .in = d, .out = q, .border = 0};
    orb_parallel_for(ctx, (int64_t)vertices, 2048, apply, &l);
    double step = rho / dot(d, q, n);
    for (size_t k = 0; k < n; k++) {
      x[k] += step * d[k];
      r[k] -= step * q[k];
    }
    if (i % 16 == 0) {
      ORB_GO(status, orb_context_check(ctx), end);
    }
  }
  for (size_t v = 0; v < vertices; v++) {
    if (!p->fixed[v]) {
      memcpy(p->flat + 3 * v, x + 3 * v, 3 * sizeof *x);
    }
  }
end:
  orb_free(ctx, block);
  return status;
}

/* Projects the flat points to the sphere; the targets bit for bit. */
static void project(patcher *p) {
  double *points = p->sheet.shape.points;
  for (int32_t v = 0; v < p->sheet.shape.mesh.vertex_count; v++) {
    memcpy(points + 3 * (size_t)v, p->flat + 3 * (size_t)v, 3 * sizeof *points);
    orb_normalize(points + 3 * (size_t)v);
  }
  for (int32_t b = 0; b < p->base.shape.mesh.vertex_count; b++) {
    memcpy(points + 3 * (size_t)p->at[b], p->base.shape.points + 3 * (size_t)b, 3 * sizeof *points);
  }
}

static orb_status embed(patcher *p, int *held) {
  const orb_mesh *mesh = &p->sheet.shape.mesh;
  orb_certificate certificate;
  *held = 0;
  ORB_TRY(split_chords(p));
  ORB_TRY(set_border(p, held));
  if (!*held) {
    return ORB_OK;
  }
  ORB_TRY(solve(p, held));
  if (!*held) {
    return ORB_OK;
  }
  project(p);
  ORB_TRY(orb_certify(p->ctx, p->sheet.shape.points, mesh->vertex_count, mesh->triangles, mesh->triangle_count,
                      &certificate));
  *held = certificate.valid;
  return ORB_OK;
}

orb_status orb_patch_embed(orb_context *ctx, orb_sheet *sheet, const orb_sheet *base, int32_t *at, orb_paths *paths,
                           int64_t *work, int *held) {
  patcher p = {.ctx = ctx, .sheet = *sheet, .base = *base, .paths = *paths, .at = at, .work = work};
  orb_status status = embed(&p, held);
  *sheet = p.sheet;
  *paths = p.paths;
  orb_free(ctx, p.flat);
  orb_free(ctx, p.fixed);
  orb_free(ctx, p.weight);
  return status;
}

static orb_status build(patcher *p, const orb_sheet *given, const int32_t *landmarks, int32_t count,
                        const double *targets, double growth, int *held) {
  int good = 0;
  *held = 0;
  ORB_TRY(orb_base_triangulate(p->ctx, targets, count, &p->base, &good));
  if (!good) {
    return ORB_OK;
  }
  ORB_TRY(orb_sheet_copy(p->ctx, given, &p->sheet));
  ORB_TRY(locate_base(p, landmarks, count));
  ORB_TRY(orb_base_trace(p->ctx, &p->sheet, &p->base, p->at, &p->paths, orb_pin_limit(given, growth), p->work, &good));
  return good ? embed(p, held) : ORB_OK;
}

orb_status orb_pin_patches(orb_context *ctx, orb_sheet *sheet, const int32_t *landmarks, int32_t count,
                           const double *targets, orb_preset preset, orb_pin_room *room, int *held) {
  patcher p = {.ctx = ctx, .work = &room->work};
  orb_status status = build(&p, sheet, landmarks, count, targets, room->growth, held);
  if (status == ORB_OK && *held) {
    status = orb_pin_slim(ctx, &p.sheet, landmarks, count, preset, &room->work);
  }
  if (status == ORB_OK && *held) {
    orb_sheet_free(ctx, sheet);
    *sheet = p.sheet;
    memset(&p.sheet, 0, sizeof p.sheet);
  }
  patcher_free(&p);
  return status;
}
