/* The triangulation of the targets: an octahedron, rotated so that its corners stay away from the targets, into which
 * the targets are inserted one by one. Edge flips make it nearly Delaunay. Exact orientations alone decide what is
 * allowed, so it is valid for all points; rounding only makes it a little less Delaunay. */
#include "align/pin/base.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "numeric/predicates.h"
#include "numeric/vec3.h"

enum {
  FRAMES = 40, /* rotations of the octahedron that are tried; chosen by trial */
  PASSES = 60  /* of edge flips; a guard against rounding */
};
/* The phases of two vectors grow by these radians from frame to frame and from axis to axis, from a first phase. Any
 * values that spread the frames will do: no multiple of one is near a multiple of 2π. */
static const double FIRST_BY_FRAME = 1.3, FIRST_BY_AXIS = 2.1, FIRST_PHASE = 0.4;
static const double SECOND_BY_FRAME = 2.7, SECOND_BY_AXIS = 1.7;
/* Six times the volume of the tetrahedron of two triangles, of points on the unit sphere: an edge flip that gains less
 * would only follow rounding. */
static const double LEAST_GAIN = 1e-12;

static const int32_t OCTAHEDRON[24] = {0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4, 2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5};

static const double *point_of(const orb_sheet *s, int32_t v) {
  return s->shape.points + 3 * (size_t)v;
}

/* Frame `number` of a fixed sequence of orthonormal frames. */
static void frame_of(int number, double axes[3][3]) {
  for (int k = 0; k < 3; k++) {
    axes[0][k] = sin(FIRST_BY_FRAME * number + FIRST_BY_AXIS * k + FIRST_PHASE);
    axes[1][k] = cos(SECOND_BY_FRAME * number + SECOND_BY_AXIS * k);
  }
  orb_normalize(axes[0]);
  orb_cross(axes[0], axes[1], axes[2]);
  orb_normalize(axes[2]);
  orb_cross(axes[2], axes[0], axes[1]);
}

/* The octahedron whose corners stay farthest from the targets. */
static void place_octahedron(const double *targets, int32_t count, double corner[6][3]) {
  double best = -1;
  for (int number = 0; number < FRAMES; number++) {
    double axes[3][3], nearest = 4;
    frame_of(number, axes);
    for (int32_t i = 0; i < count; i++) {
      for (int k = 0; k < 3; k++) {
        double d = 2 - 2 * fabs(orb_dot(axes[k], targets + 3 * (size_t)i));
        nearest = d < nearest ? d : nearest;
      }
    }
    if (nearest > best) {
      best = nearest;
      for (int k = 0; k < 6; k++) {
        for (int i = 0; i < 3; i++) {
          corner[k][i] = k % 2 ? -axes[k / 2][i] : axes[k / 2][i];
        }
      }
    }
  }
}

static int positive(const orb_sheet *s, int32_t a, int32_t b, int32_t c) {
  return orb_orient(point_of(s, a), point_of(s, b), point_of(s, c)) > 0;
}

/* Replaces the diagonal of the two triangles at half-edge h by the other one. */
static void flip(orb_sheet *s, int32_t h) {
  int32_t *tri = s->shape.mesh.triangles, g = s->twin[h];
  int32_t a = tri[h], b = tri[g], c = tri[orb_prev(h)], d = tri[orb_prev(g)];
  int32_t bc = s->twin[orb_next(h)], ca = s->twin[orb_prev(h)], ad = s->twin[orb_next(g)], db = s->twin[orb_prev(g)];
  int32_t p = h - h % 3, q = g - g % 3;
  int32_t corners[2][3] = {{a, d, c}, {d, b, c}}, far[2][3] = {{ad, q + 2, ca}, {db, bc, p + 1}};
  for (int k = 0; k < 3; k++) {
    tri[p + k] = corners[0][k];
    tri[q + k] = corners[1][k];
    s->twin[p + k] = far[0][k];
    s->twin[q + k] = far[1][k];
    s->twin[far[0][k]] = p + k;
    s->twin[far[1][k]] = q + k;
  }
  s->corner[a] = p;
  s->corner[d] = q;
  s->corner[c] = p + 2;
  s->corner[b] = q + 1;
}

/* Would the other diagonal lie higher on the convex hull, and would both triangles stay positive? */
static int should_flip(const orb_sheet *s, int32_t h) {
  const int32_t *tri = s->shape.mesh.triangles;
  int32_t g = s->twin[h], a = tri[h], b = tri[g], c = tri[orb_prev(h)], d = tri[orb_prev(g)];
  double u[3], v[3], w[3], n[3];
  orb_sub(point_of(s, b), point_of(s, a), u);
  orb_sub(point_of(s, c), point_of(s, a), v);
  orb_sub(point_of(s, d), point_of(s, a), w);
  orb_cross(u, v, n);
  return orb_dot(n, w) > LEAST_GAIN && positive(s, a, d, c) && positive(s, d, b, c);
}

/* Lawson's edge flips. They end by themselves; the bound on passes only guards against rounding. */
static void improve(orb_sheet *s) {
  int32_t half_edges = 3 * s->shape.mesh.triangle_count;
  for (int pass = 0, flipped = 1; flipped && pass < PASSES; pass++) {
    flipped = 0;
    for (int32_t h = 0; h < half_edges; h++) {
      if (h < s->twin[h] && should_flip(s, h)) {
        flip(s, h);
        flipped = 1;
      }
    }
  }
}

/* Inserts a target into the triangle or on the edge that contains it. */
static orb_status insert(orb_context *ctx, orb_sheet *s, const double target[3], int *good) {
  const int32_t *tri = s->shape.mesh.triangles;
  for (int32_t t = 0; t < s->shape.mesh.triangle_count; t++) {
    int sign[3], zeros = 0, zero = 0, outside = 0;
    for (int k = 0; k < 3; k++) {
      sign[k] = orb_orient(point_of(s, tri[3 * t + k]), point_of(s, tri[3 * t + (k + 1) % 3]), target);
      outside |= sign[k] < 0;
      if (sign[k] == 0) {
        zeros++;
        zero = k;
      }
    }
    if (outside) {
      continue;
    }
    int32_t v;
    if (zeros > 1) {
      break;
    }
    if (zeros == 1) {
      ORB_TRY(orb_sheet_split_edge(ctx, s, 3 * t + zero, 0.5, &v));
    } else {
      ORB_TRY(orb_sheet_split_triangle(ctx, s, t, (const double[3]){1.0 / 3, 1.0 / 3, 1.0 / 3}, &v));
    }
    memcpy(s->shape.points + 3 * (size_t)v, target, 3 * sizeof *target);
    *good = 1;
    return ORB_OK;
  }
  *good = 0;
  return ORB_OK;
}

static int all_positive(const orb_sheet *s) {
  const int32_t *tri = s->shape.mesh.triangles;
  for (int32_t t = 0; t < s->shape.mesh.triangle_count; t++) {
    if (!positive(s, tri[3 * t], tri[3 * t + 1], tri[3 * t + 2])) {
      return 0;
    }
  }
  return 1;
}

orb_status orb_base_triangulate(orb_context *ctx, const double *targets, int32_t count, orb_sheet *out, int *good) {
  double corner[6][3];
  int32_t triangles[24];
  place_octahedron(targets, count, corner);
  memcpy(triangles, OCTAHEDRON, sizeof triangles);
  orb_mesh mesh = {.vertex_count = 6, .triangle_count = 8, .positions = corner[0], .triangles = triangles};
  orb_status status = orb_sheet_create(ctx, &mesh, corner[0], out);
  orb_free(ctx, out->origin); /* after edge flips, triangles do not lie in their parents */
  out->origin = NULL;
  out->given = NULL;
  *good = 1;
  for (int32_t i = 0; status == ORB_OK && *good && i < count; i++) {
    status = insert(ctx, out, targets + 3 * (size_t)i, good);
    if (i % 16 == 15) {
      improve(out);
    }
  }
  if (status == ORB_OK && *good) {
    improve(out);
    *good = all_positive(out);
  }
  if (status != ORB_OK || !*good) {
    orb_sheet_free(ctx, out);
  }
  return status;
}
