#include "embed/common/kernel.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "numeric/frame.h"
#include "numeric/predicates.h"
#include "numeric/vec3.h"

enum { HALVINGS = 50 }; /* of the distance to r_0: 2⁻⁵⁰ is near the spacing of doubles */

/* In chart coordinates: a chart reaches this far at most, which is 84° from r_0. */
static const double CHART_RADIUS = 10;

/* A half-plane of the chart: s·x + t·y + at > 0, (x, y) of unit length. */
typedef struct half_plane {
  double x, y, at;
} half_plane;

typedef struct chart_point {
  double s, t;
} chart_point;

typedef struct chart {
  double origin[3], e1[3], e2[3];
  half_plane *plane;
  chart_point *polygon[2]; /* count + 8 each */
  int32_t count;           /* planes */
  int32_t corners;         /* of polygon[0] */
} chart;

int orb_kernel_contains(const double (*ring)[3], int32_t count, const double p[3]) {
  for (int32_t i = 0; i < count; i++) {
    if (orb_orient(p, ring[i], ring[i + 1 < count ? i + 1 : 0]) <= 0) {
      return 0;
    }
  }
  return 1;
}

void orb_kernel_room_free(orb_context *ctx, orb_kernel_room *room) {
  orb_free(ctx, room->block);
  room->block = NULL;
  room->capacity = 0;
}

static orb_status open_chart(orb_context *ctx, orb_kernel_room *room, const double (*ring)[3], int32_t count,
                             chart *c) {
  if (count > room->capacity) {
    orb_kernel_room_free(ctx, room);
    int32_t capacity = count + count / 2 + 16;
    room->block = ORB_NEW(ctx, double, 3 * (int64_t)capacity + 4 * ((int64_t)capacity + 8));
    if (!room->block) {
      return ORB_E_NO_MEMORY;
    }
    room->capacity = capacity;
  }
  c->plane = (half_plane *)(void *)room->block;
  c->polygon[0] = (chart_point *)(void *)(room->block + 3 * (int64_t)room->capacity);
  c->polygon[1] = c->polygon[0] + room->capacity + 8;
  c->count = count;
  memcpy(c->origin, ring[0], sizeof c->origin);
  orb_tangent_frame(c->origin, c->e1, c->e2);
  return ORB_OK;
}

/* Sets the planes of the edges from differences to r_0; the two edges at r_0 pass through it exactly. Returns the chart
 * radius that holds the ring. */
static double set_planes(chart *c, const double (*ring)[3]) {
  double radius = 0;
  for (int32_t i = 0; i < c->count; i++) {
    double a[3], b[3], x[2], y[2], z[2];
    orb_sub(ring[i], c->origin, a);
    orb_sub(ring[i + 1 < c->count ? i + 1 : 0], c->origin, b);
    x[0] = orb_dot(a, c->e1);
    y[0] = orb_dot(a, c->e2);
    z[0] = 1 + orb_dot(a, c->origin);
    x[1] = orb_dot(b, c->e1);
    y[1] = orb_dot(b, c->e2);
    z[1] = 1 + orb_dot(b, c->origin);
    half_plane h = {.x = y[0] * z[1] - z[0] * y[1], .y = z[0] * x[1] - x[0] * z[1], .at = x[0] * y[1] - y[0] * x[1]};
    double length = sqrt(h.x * h.x + h.y * h.y);
    if (length > 0) {
      h.x /= length;
      h.y /= length;
      h.at /= length;
    }
    c->plane[i] = h;
    double far = sqrt(x[0] * x[0] + y[0] * y[0]);
    radius = fmax(radius, z[0] > 0.1 * far ? far / z[0] : CHART_RADIUS);
  }
  return radius;
}

static double height(const half_plane *h, const chart_point *p) {
  return h->x * p->s + h->y * p->t + h->at;
}

/* Cuts the polygon by one plane (Sutherland & Hodgman 1974). */
static void clip(chart *c, const half_plane *plane) {
  const chart_point *in = c->polygon[0];
  chart_point *out = c->polygon[1];
  int32_t n = c->corners, m = 0;
  for (int32_t i = 0; i < n; i++) {
    const chart_point *p = &in[i], *q = &in[i + 1 < n ? i + 1 : 0];
    double hp = height(plane, p), hq = height(plane, q);
    if (hp >= 0) {
      out[m++] = *p;
    }
    if ((hp > 0 && hq < 0) || (hp < 0 && hq > 0)) {
      double f = hp / (hp - hq);
      out[m++] = (chart_point){.s = p->s + f * (q->s - p->s), .t = p->t + f * (q->t - p->t)};
    }
  }
  c->corners = m < c->count + 8 ? m : c->count + 8;
  c->polygon[0] = out;
  c->polygon[1] = (chart_point *)in;
}

static chart_point centroid(const chart *c) {
  const chart_point *p = c->polygon[0];
  double area = 0, s = 0, t = 0, ms = 0, mt = 0;
  for (int32_t i = 0; i < c->corners; i++) {
    ms += (p[i].s - p[0].s) / c->corners;
    mt += (p[i].t - p[0].t) / c->corners;
  }
  for (int32_t i = 1; i + 1 < c->corners; i++) {
    double us = p[i].s - p[0].s, ut = p[i].t - p[0].t, ws = p[i + 1].s - p[0].s, wt = p[i + 1].t - p[0].t;
    double part = us * wt - ut * ws;
    area += part;
    s += part * (us + ws) / 3;
    t += part * (ut + wt) / 3;
  }
  if (area > 0 && isfinite(s / area) && isfinite(t / area)) {
    ms = s / area;
    mt = t / area;
  }
  return (chart_point){.s = p[0].s + ms, .t = p[0].t + mt};
}

/* Maps a point of the chart to the sphere. Returns whether it lies in the kernel. */
static int lift(const chart *c, const double (*ring)[3], chart_point q, double out[3]) {
  for (int k = 0; k < 3; k++) {
    out[k] = c->origin[k] + q.s * c->e1[k] + q.t * c->e2[k];
  }
  orb_normalize(out);
  return orb_kernel_contains(ring, c->count, out);
}

/* Tries q and points between it and r_0: in exact arithmetic all are in the kernel if q is. */
static int lift_towards(const chart *c, const double (*ring)[3], chart_point q, double out[3]) {
  for (int i = 0; i < HALVINGS; i++) {
    if (lift(c, ring, q, out)) {
      return 1;
    }
    q.s *= 0.5;
    q.t *= 0.5;
  }
  return 0;
}

/* Tries points of the wedge at r_0, along its bisector. */
static int search_wedge(const chart *c, const double (*ring)[3], double radius, double out[3]) {
  const half_plane *a = &c->plane[0], *b = &c->plane[c->count - 1];
  chart_point q = {.s = (a->x + b->x), .t = (a->y + b->y)};
  double length = sqrt(q.s * q.s + q.t * q.t);
  if (!(length > 0)) {
    return 0;
  }
  q.s *= radius / length;
  q.t *= radius / length;
  return lift_towards(c, ring, q, out);
}

orb_status orb_kernel_point(orb_context *ctx, orb_kernel_room *room, const double (*ring)[3], int32_t count,
                            double out[3], int *found) {
  chart c;
  ORB_TRY(open_chart(ctx, room, ring, count, &c));
  double radius = 4 * fmin(set_planes(&c, ring), CHART_RADIUS); /* half the side of the square that is clipped */
  c.polygon[0][0] = (chart_point){-radius, -radius};
  c.polygon[0][1] = (chart_point){radius, -radius};
  c.polygon[0][2] = (chart_point){radius, radius};
  c.polygon[0][3] = (chart_point){-radius, radius};
  c.corners = 4;
  for (int32_t i = 0; i < count && c.corners >= 3; i++) {
    clip(&c, &c.plane[i]);
  }
  *found = 0;
  if (c.corners >= 3) {
    chart_point middle = centroid(&c);
    *found = lift_towards(&c, ring, middle, out);
    for (int32_t i = 0; i < c.corners && !*found; i++) { /* between the middle and each corner */
      chart_point q = {.s = 0.5 * (middle.s + c.polygon[0][i].s), .t = 0.5 * (middle.t + c.polygon[0][i].t)};
      *found = lift(&c, ring, q, out);
    }
  }
  if (!*found) {
    *found = search_wedge(&c, ring, radius, out);
  }
  return ORB_OK;
}
