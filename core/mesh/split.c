/* Splitting edges of more than two faces.
 *
 * The faces around such an edge, in order of their angle, enclose wedges of the body and wedges of the space around it.
 * Two neighbours whose normals face away from each other bound a wedge of the body. Such pairs stay joined, and what
 * was one edge becomes one for each pair; a face without a partner is open there. Then every fan of faces around a
 * vertex gets a vertex of its own, which takes bodies apart that touch along edges. Nothing moves: copies lie where
 * the original lies (Guéziec et al. 2001, "Cutting and stitching": cut at singular edges, then join what fits).
 *
 * Where a face has no partner, as an inner wall or a fin, the flattest pairs stay joined: an outer surface is flatter
 * there than its corner with the wall.
 *
 * Where a body touches itself along one edge only, the wedges of the body lead to the same fan at both ends, and the
 * two copies of the edge would have the same ends. There the wedges of the space are paired instead: one of the two
 * pairings parts the fan of each end.
 */
#include "mesh/split.h"

#include <math.h>

#include "base/check.h"
#include "base/context.h"
#include "base/memory.h"
#include "mesh/edit.h"
#include "mesh/refuse.h"
#include "mesh/sort.h"
#include "numeric/vec3.h"

/* If the faces at one edge do not all pair up, the flattest pairs are sought among this many at most, in cubic time. */
enum { FEW = 8 };

/* The half-edges of one crowded edge. */
typedef struct ring {
  uint64_t *order; /* scratch: angle in the upper half, number within the ring in the lower */
  int32_t *half_edge, *stack;
  int32_t count;
} ring;

static int runs_up(const orb_mesh *mesh, int32_t h) {
  return mesh->triangles[h] < mesh->triangles[orb_next(h)];
}

/* Two unit vectors that are perpendicular to d and to each other; zeros if d has no direction. */
static void frame_of(const double d[3], double u[3], double v[3]) {
  double a[3] = {fabs(d[0]), fabs(d[1]), fabs(d[2])}, axis[3] = {0, 0, 0}, length;
  axis[a[0] <= a[1] && a[0] <= a[2] ? 0 : a[1] <= a[2] ? 1 : 2] = 1;
  orb_cross(d, axis, u);
  length = orb_length(u);
  for (int k = 0; k < 3; k++) {
    u[k] = length > 0 ? u[k] / length : 0;
  }
  orb_cross(d, u, v);
  length = orb_length(v);
  for (int k = 0; k < 3; k++) {
    v[k] = length > 0 ? v[k] / length : 0;
  }
}

/* Orders the half-edges of a ring by the angles of their faces around the edge, from its lower vertex to its higher. */
static void order_ring(const orb_mesh *mesh, ring *r) {
  const double two_pi = 6.283185307179586;
  double d[3], u[3], v[3], x[3];
  int32_t h = r->half_edge[0], low = runs_up(mesh, h) ? h : orb_next(h), high = runs_up(mesh, h) ? orb_next(h) : h;
  const double *p = mesh->positions + 3 * (size_t)mesh->triangles[low];
  orb_sub(mesh->positions + 3 * (size_t)mesh->triangles[high], p, d);
  frame_of(d, u, v);
  for (int32_t i = 0; i < r->count; i++) {
    orb_sub(mesh->positions + 3 * (size_t)mesh->triangles[orb_prev(r->half_edge[i])], p, x);
    double angle = atan2(orb_dot(x, v), orb_dot(x, u)) / two_pi + 0.5; /* 0 to 1 */
    uint32_t step = angle > 0 ? (uint32_t)(angle * 4294967295.0) : 0;  /* NaN: 0 */
    r->order[i] = (uint64_t)step << 32 | (uint32_t)i;
  }
  orb_sort_u64(r->order, r->count);
}

static void join(orb_surface *s, int32_t g, int32_t h) {
  s->twin[g] = h;
  s->twin[h] = g;
}

/* Half-edge i of the order. */
static int32_t ordered(const ring *r, int32_t i) {
  return r->half_edge[(uint32_t)r->order[i]];
}

/* Joins the pairs whose wedge is nearest to half a turn, the flattest first. */
static void pair_flattest(orb_surface *s, const ring *r, int around) {
  const int64_t half = INT64_C(1) << 31;
  for (;;) {
    int64_t least = INT64_MAX;
    int32_t begin = -1, end = -1;
    for (int32_t i = 0; i < r->count; i++) {
      for (int32_t k = 0; k < r->count; k++) {
        int32_t g = ordered(r, i), h = ordered(r, k);
        if (s->twin[g] < 0 && s->twin[h] < 0 && runs_up(s->mesh, g) == around && runs_up(s->mesh, h) != around) {
          int64_t wedge = (uint32_t)((r->order[k] >> 32) - (r->order[i] >> 32));
          int64_t bent = wedge > half ? wedge - half : half - wedge;
          if (bent < least) {
            least = bent;
            begin = g;
            end = h;
          }
        }
      }
    }
    if (begin < 0) {
      return;
    }
    join(s, begin, end);
  }
}

/* Joins the half-edges of a ring in pairs that bound wedges of the body, or of the space around it, and leaves the
 * others open. A face whose half-edge runs up has the body on the side of smaller angles. */
static void pair_ring(orb_surface *s, ring *r, int around) {
  int32_t depth = 0, up = 0;
  order_ring(s->mesh, r);
  for (int32_t i = 0; i < r->count; i++) {
    s->twin[r->half_edge[i]] = ORB_OPEN;
    up += runs_up(s->mesh, r->half_edge[i]);
  }
  if (2 * up != r->count && r->count <= FEW) {
    pair_flattest(s, r, around);
    return;
  }
  for (int32_t i = 0; i < 2 * r->count;
       i++) { /* twice around: a wedge may contain the angle at which the order begins */
    int32_t h = ordered(r, i % r->count);
    if (s->twin[h] >= 0) {
      continue;
    }
    if (runs_up(s->mesh, h) == around) { /* begins a wedge */
      if (i < r->count) {
        r->stack[depth++] = h;
      }
    } else if (depth > 0) {
      join(s, r->stack[--depth], h);
    }
  }
}

/* Pairs the half-edges of all crowded edges. An edge from a vertex to itself has no pairs. */
static orb_status pair_all(orb_surface *s, int around) {
  const orb_mesh *mesh = s->mesh;
  int64_t crowded = 0;
  for (int32_t h = 0; h < 3 * mesh->triangle_count; h++) {
    crowded += s->twin[h] == ORB_CROWDED;
  }
  uint64_t *entry = ORB_NEW(s->ctx, uint64_t, crowded);
  int32_t *start = ORB_NEW0(s->ctx, int32_t, (size_t)mesh->vertex_count + 2);
  ring r = {.order = ORB_NEW(s->ctx, uint64_t, crowded),
            .half_edge = ORB_NEW(s->ctx, int32_t, crowded),
            .stack = ORB_NEW(s->ctx, int32_t, crowded)};
  orb_status status = r.order && r.half_edge && r.stack ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    status = orb_refuse_sort_edges(s, ORB_CROWDED, entry, start);
  }
  for (int64_t i = 0; i < crowded && status == ORB_OK; i += r.count) {
    int32_t first = (int32_t)(uint32_t)entry[i];
    int32_t a = mesh->triangles[first], b = mesh->triangles[orb_next(first)];
    r.count = 0;
    do {
      r.half_edge[r.count] = (int32_t)(uint32_t)entry[i + r.count];
      r.count++;
      if (i + r.count == crowded) {
        break;
      }
      int32_t next = (int32_t)(uint32_t)entry[i + r.count];
      int32_t c = mesh->triangles[next], d = mesh->triangles[orb_next(next)];
      if (!((a == c && b == d) || (a == d && b == c))) {
        break;
      }
    } while (1);
    pair_ring(s, &r, around);
    status = orb_context_check(s->ctx);
  }
  orb_free(s->ctx, entry);
  orb_free(s->ctx, start);
  orb_free(s->ctx, r.order);
  orb_free(s->ctx, r.half_edge);
  orb_free(s->ctx, r.stack);
  return status;
}

/* Orients each piece consistently; pieces end at crowded edges. */
static orb_status face_alike(orb_surface *s) {
  int64_t count = 0;
  ORB_TRY(orb_surface_pieces(s));
  if (s->conflict >= 0) {
    return orb_refuse_facing(s);
  }
  if (s->edges.same_way == 0) {
    return ORB_OK;
  }
  for (int32_t t = 0; t < s->mesh->triangle_count; t++) {
    if (s->reversed[t]) {
      orb_mesh_reverse_face(s->mesh, t);
      count++;
    }
  }
  orb_mesh_note(s->mesh, "reorient", count);
  return orb_surface_rematch(s);
}

orb_status orb_surface_split(orb_surface *s, int64_t *count) {
  int64_t before = s->edges.crowded;
  ORB_TRY(face_alike(s));
  for (int around = 0; around < 2 && s->edges.crowded > 0; around++) {
    orb_fans fans;
    ORB_TRY(pair_all(s, around));
    ORB_TRY(orb_surface_pieces(s));
    ORB_TRY(orb_surface_fans(s, 1, &fans));
    orb_mesh_note(s->mesh, "split-vertices", fans.pinched);
    ORB_TRY(orb_surface_rematch(s));
  }
  *count = before - s->edges.crowded;
  return ORB_OK;
}
