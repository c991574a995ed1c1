/* Landmarks become vertices. Several may lie in one triangle or on one edge of the given mesh, so each is located among
 * the pieces of its triangle, by barycentric coordinates in that triangle. These are exact at the corners, and do not
 * depend on whether the triangle is degenerate in space. */
#include <math.h>
#include <string.h>

#include "align/sheet/landmarks.h"
#include "base/check.h"
#include "base/error.h"
#include "base/memory.h"
#include "numeric/predicates.h"
#include "numeric/vec3.h"

/* Of barycentric coordinates. */
static const double SNAP = 2e-7;     /* a landmark this near to an edge or corner counts as on it */
static const double NEGATIVE = 1e-6; /* rounding below zero that is accepted, */
static const double OFF_ONE = 1e-5;  /* and of their sum */

/* Shares of the way of a vertex towards the mean of its ring: the first hardly moves it; each is larger by this factor.
 */
static const double FIRST_WAY = 1e-6, WAY_GROWTH = 4;

/* Vertex `vertex` lies in given triangle `triangle` at `at`. */
typedef struct anchor {
  int32_t vertex, triangle;
  double at[3];
} anchor;

typedef struct inserter {
  orb_sheet *sheet;
  int32_t given_vertices, given_triangles;
  const int32_t *given; /* corners of the given triangles */
  anchor *anchors;
  int32_t anchor_count;
} inserter;

static orb_status bad_place(orb_context *ctx, int32_t landmark, int32_t shape, const char *why) {
  orb_status status = orb_fail(ctx, ORB_E_BAD_LANDMARKS, "Landmark %d on shape %d: %s.", landmark, shape, why);
  orb_error *error = orb_context_error_edit(ctx);
  error->landmark_count = 1;
  error->landmarks[0] = landmark;
  error->shape = shape;
  return status;
}

/* Barycentric coordinates of a vertex of a piece, in given triangle `triangle`. */
static void anchor_of(const inserter *in, int32_t vertex, int32_t triangle, double out[3]) {
  out[0] = out[1] = out[2] = 0;
  for (int k = 0; k < 3; k++) {
    if (in->given[3 * triangle + k] == vertex) {
      out[k] = 1;
      return;
    }
  }
  for (int32_t i = 0; i < in->anchor_count; i++) {
    if (in->anchors[i].vertex == vertex && in->anchors[i].triangle == triangle) {
      memcpy(out, in->anchors[i].at, sizeof in->anchors[i].at);
      return;
    }
  }
  ORB_ASSERT(0 && "a piece of a triangle has only corners that lie in it");
}

/* The coordinates of `at` in piece t; returns the least of them. */
static double in_piece(const inserter *in, int32_t t, int32_t triangle, const double at[3], double out[3]) {
  double c[3][3];
  for (int k = 0; k < 3; k++) {
    anchor_of(in, in->sheet->shape.mesh.triangles[3 * t + k], triangle, c[k]);
  }
  double n[3], total;
  orb_cross(c[1], c[2], n);
  total = orb_dot(n, c[0]);
  if (!(total > 0)) {
    return -INFINITY;
  }
  double least = INFINITY;
  for (int k = 0; k < 3; k++) {
    orb_cross(c[(k + 1) % 3], c[(k + 2) % 3], n);
    out[k] = orb_dot(n, at) / total;
    least = out[k] < least ? out[k] : least;
  }
  return least;
}

static void remember(inserter *in, int32_t vertex, int32_t triangle, const double at[3]) {
  anchor *a = &in->anchors[in->anchor_count++];
  a->vertex = vertex;
  a->triangle = triangle;
  memcpy(a->at, at, sizeof a->at);
}

/* Is the whole star of a vertex exactly positive? */
static int star_is_positive(const orb_sheet *s, int32_t vertex) {
  int32_t start = s->corner[vertex], h = start;
  do {
    const int32_t *tri = s->shape.mesh.triangles;
    const double *p = s->shape.points;
    if (orb_orient(p + 3 * (size_t)tri[h], p + 3 * (size_t)tri[orb_next(h)], p + 3 * (size_t)tri[orb_prev(h)]) <= 0) {
      return 0;
    }
    h = orb_sheet_swing(s, h);
  } while (h != start);
  return 1;
}

/* Where rounding has broken a very thin star, moves the new vertex towards its ring's mean. 0: that does not help. */
static int settle(orb_sheet *s, int32_t vertex) {
  if (star_is_positive(s, vertex)) {
    return 1;
  }
  double mean[3] = {0, 0, 0}, *p = s->shape.points + 3 * (size_t)vertex, old[3];
  memcpy(old, p, sizeof old);
  int32_t start = s->corner[vertex], h = start;
  do {
    const double *q = s->shape.points + 3 * (size_t)s->shape.mesh.triangles[orb_next(h)];
    for (int k = 0; k < 3; k++) {
      mean[k] += q[k];
    }
    h = orb_sheet_swing(s, h);
  } while (h != start);
  orb_normalize(mean);
  for (double step = FIRST_WAY; step <= 1; step *= WAY_GROWTH) {
    for (int k = 0; k < 3; k++) {
      p[k] = old[k] + step * (mean[k] - old[k]);
    }
    orb_normalize(p);
    if (star_is_positive(s, vertex)) {
      return 1;
    }
  }
  return 0;
}

/* After an edge split, stores the new vertex's coordinates in the given triangle on one side of the edge. */
static void remember_across(inserter *in, int32_t vertex, int32_t across, const int32_t ends[2], double t) {
  int32_t triangle = in->sheet->shape.parent[across];
  for (int32_t i = 0; i < in->anchor_count; i++) {
    if (in->anchors[i].vertex == vertex && in->anchors[i].triangle == triangle) {
      return;
    }
  }
  double a[3], b[3], at[3];
  anchor_of(in, ends[0], triangle, a);
  anchor_of(in, ends[1], triangle, b);
  for (int k = 0; k < 3; k++) {
    at[k] = (1 - t) * a[k] + t * b[k];
  }
  remember(in, vertex, triangle, at);
}

/* *held 0: the triangle there is too small on the sphere to hold the landmark. */
static orb_status insert_one(orb_context *ctx, inserter *in, int32_t triangle, const double at[3], int32_t *vertex,
                             int *held) {
  orb_sheet *s = in->sheet;
  *held = 1;
  double best = -INFINITY, local[3] = {0, 0, 0}, w[3];
  int32_t piece = -1;
  for (int32_t t = triangle; t < s->shape.mesh.triangle_count;
       t = t < in->given_triangles ? in->given_triangles : t + 1) {
    if (s->shape.parent[t] == triangle) {
      double least = in_piece(in, t, triangle, at, w);
      if (least > best) {
        best = least;
        piece = t;
        memcpy(local, w, sizeof local);
      }
    }
  }
  ORB_ASSERT(piece >= 0);
  int zeros = 0, zero = 0, one = 0;
  for (int k = 0; k < 3; k++) {
    if (local[k] < SNAP) {
      local[k] = 0;
      zeros++;
      zero = k;
    } else {
      one = k;
    }
  }
  double sum = local[0] + local[1] + local[2];
  for (int k = 0; k < 3; k++) {
    local[k] /= sum;
  }
  if (zeros == 2) {
    *vertex = s->shape.mesh.triangles[3 * piece + one];
    return ORB_OK;
  }
  if (zeros == 1) {
    int32_t h = 3 * piece + (zero + 1) % 3;
    int32_t across = s->twin[h] / 3, ends[2] = {s->shape.mesh.triangles[h], s->shape.mesh.triangles[orb_next(h)]};
    double t = local[(zero + 2) % 3];
    ORB_TRY(orb_sheet_split_edge(ctx, s, h, t, vertex));
    remember_across(in, *vertex, piece, ends, t);
    remember_across(in, *vertex, across, ends, t);
  } else {
    ORB_TRY(orb_sheet_split_triangle(ctx, s, piece, local, vertex));
    remember(in, *vertex, triangle, at);
  }
  *held = settle(s, *vertex);
  return ORB_OK;
}

/* Checks the place of a landmark, and cleans its coordinates of rounding. */
static orb_status check_place(orb_context *ctx, const inserter *in, const orb_place *place, int32_t landmark,
                              int32_t shape, double at[3]) {
  if (place->triangle < 0 || place->triangle >= in->given_triangles) {
    return bad_place(ctx, landmark, shape, "its triangle does not exist");
  }
  double sum = 0;
  for (int k = 0; k < 3; k++) {
    at[k] = place->at[k] > 0 ? place->at[k] : 0;
    sum += at[k];
    if (!(place->at[k] >= -NEGATIVE)) {
      return bad_place(ctx, landmark, shape, "a barycentric coordinate is negative");
    }
  }
  if (!(fabs(sum - 1) <= OFF_ONE)) {
    return bad_place(ctx, landmark, shape, "its barycentric coordinates do not add up to 1");
  }
  for (int k = 0; k < 3; k++) {
    at[k] /= sum;
  }
  return ORB_OK;
}

orb_status orb_sheet_insert_landmarks(orb_context *ctx, orb_sheet *sheet, const orb_landmark *landmarks,
                                      int32_t landmark_count, int32_t shape_index) {
  orb_mesh *mesh = &sheet->shape.mesh;
  orb_status status = ORB_OK;
  size_t corners = 3 * (size_t)mesh->triangle_count;
  int32_t *given = ORB_NEW(ctx, int32_t, corners);
  inserter in = {.sheet = sheet,
                 .given_vertices = mesh->vertex_count,
                 .given_triangles = mesh->triangle_count,
                 .given = given,
                 .anchors = ORB_NEW(ctx, anchor, 2 * (size_t)landmark_count)};
  int32_t *vertices = ORB_NEW(ctx, int32_t, landmark_count);
  if (!given || !in.anchors || !vertices) {
    status = ORB_E_NO_MEMORY;
    goto end;
  }
  memcpy(given, mesh->triangles, corners * sizeof *given);
  for (int32_t i = 0; i < landmark_count; i++) {
    const orb_place *place = &landmarks[i].at[shape_index];
    double at[3];
    int held;
    ORB_GO(status, check_place(ctx, &in, place, i, shape_index, at), end);
    ORB_GO(status, insert_one(ctx, &in, place->triangle, at, &vertices[i], &held), end);
    if (!held) {
      status = bad_place(ctx, i, shape_index, "the sphere holds its triangle too small to split; move it to a vertex");
      goto end;
    }
  }
  orb_free(ctx, sheet->shape.landmark_vertices);
  sheet->shape.landmark_vertices = vertices;
  sheet->landmark_count = landmark_count;
  vertices = NULL;
end:
  orb_free(ctx, vertices);
  orb_free(ctx, in.anchors);
  orb_free(ctx, given);
  return status;
}

/* The number of shapes on which landmarks i and j share a vertex; *where: the last such shape. */
static int32_t shared(const orb_sheet *sheets, int32_t shape_count, int32_t i, int32_t j, int32_t *where) {
  int32_t same = 0;
  for (int32_t s = 0; s < shape_count; s++) {
    const int32_t *v = sheets[s].shape.landmark_vertices;
    if (v[i] == v[j]) {
      same++;
      *where = s;
    }
  }
  return same;
}

/* Landmarks i and j share a vertex on `shape` but not on every shape: the error names all landmarks that do. */
static orb_status contradiction(orb_context *ctx, const orb_sheet *sheets, int32_t shape_count, int32_t landmark_count,
                                int32_t i, int32_t j, int32_t shape) {
  orb_status status = orb_fail(ctx, ORB_E_BAD_LANDMARKS,
                               "Landmarks %d and %d are at one place on shape %d but not on every shape: move or drop "
                               "one of them.",
                               i, j, shape);
  orb_error *error = orb_context_error_edit(ctx);
  error->shape = shape;
  for (int32_t a = 0; a < landmark_count && error->landmark_count < ORB_ERROR_ITEMS; a++) {
    for (int32_t b = 0; b < landmark_count; b++) {
      int32_t where, same = a == b ? 0 : shared(sheets, shape_count, a, b, &where);
      if (same > 0 && same < shape_count) {
        error->landmarks[error->landmark_count++] = a;
        break;
      }
    }
  }
  return status;
}

orb_status orb_landmarks_distinct(orb_context *ctx, const orb_sheet *sheets, int32_t shape_count,
                                  int32_t landmark_count, int32_t *unique, int32_t *unique_count) {
  int32_t found = 0;
  for (int32_t j = 0; j < landmark_count; j++) {
    int32_t twin_of = -1, where = 0;
    for (int32_t i = 0; i < j; i++) {
      int32_t same = shared(sheets, shape_count, i, j, &where);
      if (same == shape_count) {
        twin_of = i;
      } else if (same > 0) {
        return contradiction(ctx, sheets, shape_count, landmark_count, i, j, where);
      }
    }
    if (twin_of < 0) {
      unique[found++] = j;
    }
  }
  *unique_count = found;
  return ORB_OK;
}

orb_status orb_landmark_points(orb_context *ctx, const orb_sheet *sheets, int32_t shape_count, const int32_t *landmarks,
                               int32_t count, double **out) {
  double *points = ORB_NEW(ctx, double, 3 * (size_t)shape_count * (size_t)count);
  if (!points) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t s = 0; s < shape_count; s++) {
    for (int32_t k = 0; k < count; k++) {
      int32_t v = sheets[s].shape.landmark_vertices[landmarks[k]];
      memcpy(points + 3 * ((size_t)s * (size_t)count + (size_t)k), sheets[s].shape.points + 3 * (size_t)v,
             3 * sizeof *points);
    }
  }
  *out = points;
  return ORB_OK;
}
