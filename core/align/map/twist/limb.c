/* Rings around a limb.
 *
 * A limb is a part of the surface that is a disc, with a pole or a smaller disc at its end. Its height is the harmonic
 * function that is 1 at the end and 0 at the rim (cotangent Laplacian, Pinkall & Polthier 1993, with weights clamped
 * from below so that there is no other extremum). The level curves of the height are closed and run once around the
 * end. The conjugate of the height grows along a level curve by the flux across it; both together are polar coordinates
 * of the limb. So a rotation along the rings, by one angle or by an angle that varies from ring to ring, is a
 * one-to-one map of the limb, whatever its shape.
 */
#include "align/map/twist/limb.h"

#include <math.h>
#include <string.h>

#include "align/map/twist/patch.h"
#include "base/check.h"
#include "base/memory.h"
#include "numeric/vec3.h"

enum { CHECK_EVERY = 64 };         /* steps between checks for cancellation */
static const double MARGIN = 1e-9; /* of the heights of a triangle: a ring this far from a corner crosses two edges */

typedef struct link_of {
  int32_t a, b;
  double weight;
} link_of;

static double cotangent(const orb_map_surface *s, int32_t h) {
  const double *o = s->x + 3 * (size_t)s->triangles[orb_prev(h)];
  double u[3], w[3], n[3];
  orb_sub(s->x + 3 * (size_t)s->triangles[h], o, u);
  orb_sub(s->x + 3 * (size_t)s->triangles[orb_next(h)], o, w);
  orb_cross(u, w, n);
  return orb_dot(u, w) / (orb_length(n) + ORB_TINY);
}

/* The vertices of the limb, numbered from 2 on; 0 represents all vertices outside, 1 the end. */
typedef struct system_of {
  int32_t count, links;
  int32_t *number; /* by vertex of the surface */
  link_of *link;
  double *diagonal;
} system_of;

static void system_free(orb_context *ctx, system_of *s) {
  orb_free(ctx, s->number);
  orb_free(ctx, s->link);
  orb_free(ctx, s->diagonal);
}

static orb_status system_create(orb_context *ctx, const orb_map_params *params, const orb_map_surface *b,
                                const unsigned char *inside, system_of *s) {
  const double least = params->twist.least_weight;
  s->count = 2;
  s->number = ORB_NEW(ctx, int32_t, b->vertex_count);
  for (int32_t v = 0; s->number && v < b->vertex_count; v++) {
    s->number[v] = inside[v] == ORB_PATCH_END ? 1 : inside[v] ? s->count++ : 0;
  }
  for (int32_t h = 0; s->number && h < 3 * b->triangle_count; h++) {
    s->links += h < b->twin[h] && (s->number[b->triangles[h]] > 1 || s->number[b->triangles[orb_next(h)]] > 1);
  }
  s->link = ORB_NEW(ctx, link_of, s->links);
  s->diagonal = ORB_NEW0(ctx, double, s->count);
  if (!s->number || !s->link || !s->diagonal) {
    return ORB_E_NO_MEMORY;
  }
  link_of *link = s->link;
  for (int32_t h = 0; h < 3 * b->triangle_count; h++) {
    int32_t g = b->twin[h], u = s->number[b->triangles[h]], w = s->number[b->triangles[orb_next(h)]];
    if (h < g && (u > 1 || w > 1)) {
      double weight = 0.5 * (cotangent(b, h) + cotangent(b, g));
      *link = (link_of){u, w, fmin(fmax(weight, least), 1 / least)};
      s->diagonal[u] += link->weight;
      s->diagonal[w] += link->weight;
      link++;
    }
  }
  return ORB_OK;
}

/* The flow out of each vertex; 0 at the two fixed ones. */
static void apply(const system_of *s, const double *u, double *out) {
  memset(out, 0, (size_t)s->count * sizeof *out);
  for (int32_t i = 0; i < s->links; i++) {
    const link_of *l = &s->link[i];
    double flow = l->weight * (u[l->a] - u[l->b]);
    out[l->a] += flow;
    out[l->b] -= flow;
  }
  out[0] = out[1] = 0;
}

/* Conjugate gradients with the diagonal as preconditioner (Hestenes & Stiefel 1952). work: four arrays, one double for
 * each vertex; the first receives the solution. */
static orb_status solve(orb_context *ctx, const orb_map_params *params, const system_of *s, double *work) {
  size_t n = (size_t)s->count;
  double *u = work, *r = work + n, *p = work + 2 * n, *q = work + 3 * n, rho = 0;
  memset(work, 0, 4 * n * sizeof *work);
  u[1] = 1;
  apply(s, u, r);
  for (size_t v = 2; v < n; v++) {
    r[v] = -r[v];
    p[v] = r[v] / s->diagonal[v];
    rho += r[v] * p[v];
  }
  double settled = params->twist.solve_settled, enough = settled * settled * rho;
  for (int step = 0; step < params->twist.solve_steps && rho > enough; step++) {
    double pq = 0, next = 0;
    apply(s, p, q);
    for (size_t v = 2; v < n; v++) {
      pq += p[v] * q[v];
    }
    for (size_t v = 2; v < n; v++) {
      u[v] += rho / pq * p[v];
      r[v] -= rho / pq * q[v];
      next += r[v] * r[v] / s->diagonal[v];
    }
    for (size_t v = 2; v < n; v++) {
      p[v] = r[v] / s->diagonal[v] + next / rho * p[v];
    }
    rho = next;
    if (step % CHECK_EVERY == 0) {
      ORB_TRY(orb_context_check(ctx));
    }
  }
  return ORB_OK;
}

orb_status orb_map_limb_heights(orb_context *ctx, const orb_map_params *params, const orb_map_surface *b,
                                const unsigned char *inside, double *height) {
  system_of s = {0};
  double *work = NULL;
  orb_status status;
  ORB_GO(status, system_create(ctx, params, b, inside, &s), done);
  work = ORB_NEW(ctx, double, 4 * (size_t)s.count);
  if (!work) {
    status = ORB_E_NO_MEMORY;
    goto done;
  }
  ORB_GO(status, solve(ctx, params, &s, work), done);
  for (int32_t v = 0; v < b->vertex_count; v++) {
    height[v] = work[s.number[v]];
  }
done:
  orb_free(ctx, work);
  system_free(ctx, &s);
  return status;
}

/* Where a ring leaves a triangle. */
typedef struct crossing {
  int32_t half_edge; /* of the triangle that it leaves */
  double at;         /* share of the way to the half-edge's end */
} crossing;

/* Where the ring at `level`, with the pole on its left, leaves triangle t: where the height along the triangle's rim
 * rises from below the level to it. 0: the ring does not cross t. */
static int leave(const orb_map_surface *b, const double *height, int32_t t, double level, crossing *out) {
  for (int k = 0; k < 3; k++) {
    int32_t h = 3 * t + k;
    double from = height[b->triangles[h]], to = height[b->triangles[orb_next(h)]];
    if (from < level && to >= level) {
      *out = (crossing){h, (level - from) / (to - from)};
      return 1;
    }
  }
  return 0;
}

static void crossing_position(const orb_map_surface *b, const crossing *c, double y[3]) {
  const double *p = b->x + 3 * (size_t)b->triangles[c->half_edge];
  const double *q = b->x + 3 * (size_t)b->triangles[orb_next(c->half_edge)];
  for (int k = 0; k < 3; k++) {
    y[k] = p[k] + c->at * (q[k] - p[k]);
  }
}

/* The slope of the height in a triangle. */
static double slope(const orb_map_surface *b, const double *height, int32_t t) {
  const int32_t *v = b->triangles + 3 * (size_t)t;
  double u[3], w[3], n[3], d[3];
  orb_sub(b->x + 3 * (size_t)v[1], b->x + 3 * (size_t)v[0], u);
  orb_sub(b->x + 3 * (size_t)v[2], b->x + 3 * (size_t)v[0], w);
  orb_cross(u, w, n);
  double du = height[v[1]] - height[v[0]], dw = height[v[2]] - height[v[0]];
  for (int k = 0; k < 3; k++) {
    d[k] = dw * u[k] - du * w[k];
  }
  return orb_length(d) / (orb_length(n) + ORB_TINY);
}

/* The flux across a ring within triangle t, from one crossing to the next. */
static double flux(const orb_map_surface *b, const double *height, int32_t t, const double *from, const double *to) {
  return slope(b, height, t) * sqrt(orb_distance2(from, to));
}

/* The place at `share` of a ring's way through a triangle, from the twin of `in` to `out`. */
static void place_between(const orb_map_surface *b, const crossing *in, const crossing *out, double share,
                          orb_place *place) {
  int32_t g = b->twin[in->half_edge], h = out->half_edge;
  *place = (orb_place){.triangle = h / 3};
  place->at[g % 3] += (1 - share) * in->at; /* the twin runs the other way */
  place->at[orb_next(g) % 3] += (1 - share) * (1 - in->at);
  place->at[h % 3] += share * (1 - out->at);
  place->at[orb_next(h) % 3] += share * out->at;
}

/* The height of the place, moved a little if necessary so that its ring crosses the place's triangle. */
static double level_of(const orb_map_surface *b, const double *height, const orb_place *place) {
  const int32_t *v = b->triangles + 3 * (size_t)place->triangle;
  double level = 0, low = INFINITY, high = -INFINITY;
  for (int k = 0; k < 3; k++) {
    level += place->at[k] * height[v[k]];
    low = fmin(low, height[v[k]]);
    high = fmax(high, height[v[k]]);
  }
  double margin = MARGIN * (high - low);
  return fmin(fmax(level, low + margin), high - margin);
}

/* Follows a ring from the crossing `start`. wanted < 0: returns the flux of the whole ring, and in *last the crossing
 * by which it comes back; else finds the place at that flux from the start. −1: the ring does not close. */
static double follow_ring(const orb_map_surface *b, const double *height, double level, const crossing *start,
                          double wanted, crossing *last, orb_place *place) {
  crossing in = *start;
  double total = 0, from[3], to[3];
  crossing_position(b, &in, from);
  for (int i = 0; i < ORB_MAP_RING_CROSSINGS; i++) {
    crossing out;
    int32_t t = b->twin[in.half_edge] / 3;
    if (!leave(b, height, t, level, &out)) {
      return -1;
    }
    crossing_position(b, &out, to);
    double step = flux(b, height, t, from, to);
    if (wanted >= 0 && (total + step >= wanted || out.half_edge == start->half_edge)) {
      place_between(b, &in, &out, step > 0 ? fmin(1, (wanted - total) / step) : 0, place);
      return wanted;
    }
    total += step;
    if (out.half_edge == start->half_edge) {
      *last = in;
      return total;
    }
    in = out;
    memcpy(from, to, sizeof from);
  }
  return -1;
}

int orb_map_limb_rotate(const orb_map_surface *b, const double *height, double angle, orb_place *place) {
  crossing start, last;
  double level = level_of(b, height, place), y[3], end[3];
  if (!(level > 0) || !leave(b, height, place->triangle, level, &start)) {
    return 0;
  }
  double total = follow_ring(b, height, level, &start, -1, &last, NULL);
  if (!(total > 0)) {
    return 0;
  }
  orb_map_surface_at(b, place, y, NULL, NULL);
  crossing_position(b, &start, end);
  double to_start = flux(b, height, place->triangle, y, end);
  double wanted = fmod(angle / (2 * M_PI) * total - to_start, total);
  orb_place moved;
  if (follow_ring(b, height, level, &start, wanted < 0 ? wanted + total : wanted, &last, &moved) < 0) {
    return 0;
  }
  *place = moved;
  return 1;
}
