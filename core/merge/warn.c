/* Both warnings mark triangles; connected marked triangles are a part. */
#include "merge/warn.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/context.h"
#include "base/forest.h"
#include "base/memory.h"
#include "numeric/vec3.h"

static const double STRETCHED = 20, AREA_MOST = 0.01; /* share of the area that may be stretched */
static const double KEPT_LEAST = 0.5;                 /* of a patch's area, halfway */
enum { PATCHES = 200 };

typedef struct marking {
  const orb_warn_pair *pair;
  double *area[2];       /* of each triangle */
  double whole[2];       /* of all triangles */
  unsigned char *marked; /* of each triangle */
  int32_t *part;         /* of each vertex: a forest */
  int32_t *number;       /* of each root: of its part */
} marking;

static void marking_free(orb_context *ctx, marking *m) {
  orb_free(ctx, m->area[0]);
  orb_free(ctx, m->area[1]);
  orb_free(ctx, m->marked);
  orb_free(ctx, m->part);
  orb_free(ctx, m->number);
}

static const double *corner(const orb_warn_pair *pair, int s, int32_t t, int k) {
  return pair->position[s] + 3 * (size_t)pair->triangles[3 * (size_t)t + (size_t)k];
}

/* The first fundamental form of a triangle on a shape: the products of the edges from its first corner. */
static void metric(const orb_warn_pair *pair, int s, int32_t t, double out[3]) {
  double u[3], v[3];
  orb_sub(corner(pair, s, t, 1), corner(pair, s, t, 0), u);
  orb_sub(corner(pair, s, t, 2), corner(pair, s, t, 0), v);
  out[0] = orb_dot(u, u);
  out[1] = orb_dot(u, v);
  out[2] = orb_dot(v, v);
}

static double determinant(const double g[3]) {
  return fmax(g[0] * g[2] - g[1] * g[1], 0);
}

static orb_status marking_create(orb_context *ctx, const orb_warn_pair *pair, marking *m) {
  size_t n = (size_t)pair->triangle_count, v = (size_t)pair->vertex_count;
  *m = (marking){.pair = pair};
  m->marked = ORB_NEW0(ctx, unsigned char, n);
  m->part = ORB_NEW(ctx, int32_t, v);
  m->number = ORB_NEW(ctx, int32_t, v);
  for (int s = 0; s < 2; s++) {
    m->area[s] = ORB_NEW(ctx, double, n);
    for (int32_t t = 0; m->area[s] && t < pair->triangle_count; t++) {
      double g[3];
      metric(pair, s, t, g);
      m->area[s][t] = 0.5 * sqrt(determinant(g));
      m->whole[s] += m->area[s][t];
    }
  }
  return m->marked && m->part && m->number && m->area[0] && m->area[1] ? ORB_OK : ORB_E_NO_MEMORY;
}

static double share_on(const marking *m, int s, const double marked) {
  return m->whole[s] > 0 ? marked / m->whole[s] : 0;
}

static void join_parts(const marking *m) {
  for (int32_t v = 0; v < m->pair->vertex_count; v++) {
    m->part[v] = v;
    m->number[v] = -1;
  }
  for (int32_t t = 0; t < m->pair->triangle_count; t++) {
    const int32_t *v = m->pair->triangles + 3 * (size_t)t;
    for (int k = 1; m->marked[t] && k < 3; k++) {
      orb_forest_join(m->part, v[0], v[k]);
    }
  }
}

/* Puts the parts of the largest shares into out, and gives each its number by its root. share: 2 per vertex, 0. */
static void choose_parts(const marking *m, double *share, orb_warning *out) {
  double sum[2] = {0, 0};
  for (int32_t t = 0; t < m->pair->triangle_count; t++) {
    for (int s = 0; m->marked[t] && s < 2; s++) {
      share[2 * (size_t)orb_forest_root(m->part, m->pair->triangles[3 * (size_t)t]) + (size_t)s] += m->area[s][t];
      sum[s] += m->area[s][t];
    }
  }
  out->share = fmax(share_on(m, 0, sum[0]), share_on(m, 1, sum[1]));
  out->part_count = 0;
  while (out->part_count < ORB_WARNING_PARTS) {
    int32_t best = -1;
    double most = 0;
    for (int32_t v = 0; v < m->pair->vertex_count; v++) {
      double here = fmax(share_on(m, 0, share[2 * (size_t)v]), share_on(m, 1, share[2 * (size_t)v + 1]));
      if (here > most && m->number[v] < 0) {
        most = here;
        best = v;
      }
    }
    if (best < 0) {
      return;
    }
    m->number[best] = out->part_count;
    out->parts[out->part_count++].share = most;
  }
}

/* The centre and radius of the part on a shape: the mean of its triangles by area, and how far a corner is from it. */
static void enclose(const marking *m, int32_t number, int s, orb_warning_part *out) {
  double sum = 0;
  for (int pass = 0; pass < 2; pass++) {
    for (int32_t t = 0; t < m->pair->triangle_count; t++) {
      if (!m->marked[t] || m->number[orb_forest_root(m->part, m->pair->triangles[3 * (size_t)t])] != number) {
        continue;
      }
      double weight = m->area[s][t] + 1e-12 * m->whole[s]; /* a part may have collapsed to nothing */
      sum += pass == 0 ? weight : 0;
      for (int k = 0; k < 3; k++) {
        const double *x = corner(m->pair, s, t, k);
        for (int c = 0; pass == 0 && c < 3; c++) {
          out->centre[s][c] += weight * x[c] / 3;
        }
        if (pass == 1) {
          out->radius[s] = fmax(out->radius[s], sqrt(orb_distance2(x, out->centre[s])));
        }
      }
    }
    for (int c = 0; pass == 0 && sum > 0 && c < 3; c++) {
      out->centre[s][c] /= sum;
    }
  }
}

/* Lists the largest triangles of a part: replaces the smallest of the list while there is a larger one. */
static void list_triangles(const marking *m, int32_t number, orb_warning_part *out) {
  double size[ORB_WARNING_TRIANGLES];
  for (int32_t t = 0; t < m->pair->triangle_count; t++) {
    const int32_t *v = m->pair->triangles + 3 * (size_t)t;
    if (!m->marked[t] || m->number[orb_forest_root(m->part, v[0])] != number) {
      continue;
    }
    double here = fmax(share_on(m, 0, m->area[0][t]), share_on(m, 1, m->area[1][t]));
    int32_t at = out->triangle_count;
    if (at == ORB_WARNING_TRIANGLES) {
      at = 0;
      for (int32_t i = 1; i < ORB_WARNING_TRIANGLES; i++) {
        at = size[i] < size[at] ? i : at;
      }
      if (here <= size[at]) {
        continue;
      }
    } else {
      out->triangle_count++;
    }
    size[at] = here;
    memcpy(out->triangles + 3 * (size_t)at, v, 3 * sizeof *v);
  }
}

static orb_status write_parts(orb_context *ctx, const marking *m, orb_warning *out) {
  double *share = ORB_NEW0(ctx, double, 2 * (size_t)m->pair->vertex_count);
  if (!share) {
    return ORB_E_NO_MEMORY;
  }
  join_parts(m);
  choose_parts(m, share, out);
  orb_free(ctx, share);
  for (int32_t i = 0; i < out->part_count; i++) {
    enclose(m, i, 0, &out->parts[i]);
    enclose(m, i, 1, &out->parts[i]);
    list_triangles(m, i, &out->parts[i]);
  }
  return ORB_OK;
}

/* The symmetric Dirichlet energy of a triangle's map; ratio: area of the first shape over that of the second. With the
 * metrics G and H, σ₁² + σ₂² = tr(G⁻¹H) and σ₁²σ₂² = det H / det G. */
static double energy(const orb_warn_pair *pair, int32_t t, double ratio) {
  double g[3], h[3];
  metric(pair, 0, t, g);
  metric(pair, 1, t, h);
  double dg = determinant(g), dh = determinant(h);
  if (!(dg > 0 && dh > 0)) {
    return INFINITY;
  }
  double trace = (g[2] * h[0] - 2 * g[1] * h[1] + g[0] * h[2]) / dg;
  return 0.25 * (trace * ratio + trace * dg / (dh * ratio));
}

orb_status orb_warn_stretched(orb_context *ctx, const orb_warn_pair *pair, orb_warning *out) {
  marking m;
  double sum[2] = {0, 0};
  orb_status status = marking_create(ctx, pair, &m);
  double ratio = m.whole[1] > 0 ? m.whole[0] / m.whole[1] : 1;
  for (int32_t t = 0; status == ORB_OK && t < pair->triangle_count; t++) {
    m.marked[t] = energy(pair, t, ratio) > STRETCHED;
    for (int s = 0; m.marked[t] && s < 2; s++) {
      sum[s] += m.area[s][t];
    }
  }
  if (status == ORB_OK && fmax(share_on(&m, 0, sum[0]), share_on(&m, 1, sum[1])) > AREA_MOST) {
    status = write_parts(ctx, &m, out);
  }
  marking_free(ctx, &m);
  return status;
}

/* The patch of each vertex: the nearest of the centres on the first shape, which farthest-point sampling spreads over
 * the used vertices, those of triangles. far: room for a number of each vertex, −1 for one that is not used. */
static orb_status spread_patches(orb_context *ctx, const orb_warn_pair *pair, double *far, int32_t *patch) {
  const double *x = pair->position[0];
  int32_t last = pair->triangles[0];
  for (int32_t i = 0; i < PATCHES; i++) {
    int32_t next = last;
    for (int32_t v = 0; v < pair->vertex_count; v++) {
      double d = far[v] < 0 ? far[v] : orb_distance2(x + 3 * (size_t)v, x + 3 * (size_t)last);
      if (d < far[v]) {
        far[v] = d;
        patch[v] = i;
      }
      next = far[v] > far[next] ? v : next;
    }
    last = next;
    ORB_TRY(orb_context_check(ctx));
  }
  return ORB_OK;
}

static void move(const double matrix[16], const double x[3], double out[3]) {
  for (int k = 0; k < 3; k++) {
    out[k] = matrix[k] * x[0] + matrix[4 + k] * x[1] + matrix[8 + k] * x[2] + matrix[12 + k];
  }
}

/* The area of a triangle on the way from the first moved shape (0) to the second (1). */
static double area_between(const orb_warn_pair *pair, int32_t t, double way) {
  double x[3][3];
  for (int k = 0; k < 3; k++) {
    double p[3], q[3];
    move(pair->move[0], corner(pair, 0, t, k), p);
    move(pair->move[1], corner(pair, 1, t, k), q);
    for (int c = 0; c < 3; c++) {
      x[k][c] = (1 - way) * p[c] + way * q[c];
    }
  }
  return orb_triangle_area(x[0], x[1], x[2]);
}

/* Marks the triangles of thin patches; returns whether there are any. patch: of each vertex. */
static int mark_thin(marking *m, const int32_t *patch) {
  double ends[PATCHES] = {0}, half[PATCHES] = {0};
  int any = 0;
  for (int32_t t = 0; t < m->pair->triangle_count; t++) {
    int32_t i = patch[m->pair->triangles[3 * (size_t)t]];
    ends[i] += 0.5 * (area_between(m->pair, t, 0) + area_between(m->pair, t, 1));
    half[i] += area_between(m->pair, t, 0.5);
  }
  for (int32_t t = 0; t < m->pair->triangle_count; t++) {
    int32_t i = patch[m->pair->triangles[3 * (size_t)t]];
    m->marked[t] = half[i] < KEPT_LEAST * ends[i];
    any |= m->marked[t];
  }
  return any;
}

orb_status orb_warn_thin(orb_context *ctx, const orb_warn_pair *pair, orb_warning *out) {
  marking m;
  double *far = ORB_NEW(ctx, double, pair->vertex_count);
  int32_t *patch = ORB_NEW0(ctx, int32_t, pair->vertex_count);
  orb_status status = marking_create(ctx, pair, &m);
  status = status == ORB_OK && !(far && patch) ? ORB_E_NO_MEMORY : status;
  if (status == ORB_OK && pair->triangle_count > 0) {
    for (int32_t v = 0; v < pair->vertex_count; v++) {
      far[v] = -1;
    }
    for (size_t i = 0; i < 3 * (size_t)pair->triangle_count; i++) {
      far[pair->triangles[i]] = INFINITY;
    }
    status = spread_patches(ctx, pair, far, patch);
    if (status == ORB_OK && mark_thin(&m, patch)) {
      status = write_parts(ctx, &m, out);
    }
  }
  marking_free(ctx, &m);
  orb_free(ctx, far);
  orb_free(ctx, patch);
  return status;
}
