/* Gathers a level from the surface, and measures its flips and its energy. */
#include "align/map/engine/level.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/loops.h"
#include "base/memory.h"
#include "numeric/predicates.h"
#include "numeric/vec3.h"

/* Of the mean edge: added to the mean edge of each triangle, so that the slack of a point is above 0. */
static const double MEAN_SHARE = 1e-3;
enum { LOCATE_SLICE = 8192, LOCATE_GRAIN = 256 }; /* vertices between checks for cancellation, and of one task */
enum {
  PART_LEAST = 500, /* vertices of a part: two alignments of docs/bench-first-answer.md take a tenth more processor time
                       with 350, and coarse levels of 1,000 vertices are not shared with 700 */
  PARTS_MOST = 64   /* as many as threads. Parts depend on the level alone, so that results do not depend on threads */
};

void orb_map_level_free(orb_context *ctx, orb_map_level *l) {
  orb_free(ctx, l->vertex);
  orb_free(ctx, l->start);
  orb_free(ctx, l->spoke);
  orb_free(ctx, l->triangle);
  orb_free(ctx, l->place);
  orb_free(ctx, l->y);
  orb_free(ctx, l->pull);
  orb_free(ctx, l->pinned);
  orb_free(ctx, l->group_start);
  orb_free(ctx, l->by_group);
  memset(l, 0, sizeof *l);
}

static orb_status reserve(orb_context *ctx, orb_map_level *l) {
  size_t n = (size_t)l->count;
  l->vertex = ORB_NEW(ctx, int32_t, n);
  l->start = ORB_NEW(ctx, int32_t, n + 1);
  l->spoke = ORB_NEW(ctx, orb_map_spoke, 3 * (size_t)l->triangle_count);
  l->triangle = ORB_NEW(ctx, int32_t, 3 * (size_t)l->triangle_count);
  l->place = ORB_NEW0(ctx, orb_place, n);
  l->y = ORB_NEW0(ctx, double, 15 * n);
  l->pull = ORB_NEW0(ctx, double, n);
  l->pinned = ORB_NEW0(ctx, unsigned char, n);
  l->by_group = ORB_NEW(ctx, int32_t, n);
  if (!l->vertex || !l->start || !l->spoke || !l->triangle || !l->place || !l->y || !l->pull || !l->pinned ||
      !l->by_group) {
    return ORB_E_NO_MEMORY;
  }
  l->n = l->y + 3 * n;
  l->x = l->y + 6 * n;
  l->target = l->y + 9 * n;
  l->area = l->y + 12 * n;
  l->moved = l->y + 13 * n;
  l->density = l->y + 14 * n;
  for (size_t i = 0; i < n; i++) {
    l->moved[i] = INFINITY;
  }
  return ORB_OK;
}

/* Cotangents and area of a triangle from its edge lengths. Where the edges are nearly collinear, all three lengths grow
 * until the longest has the slack (intrinsic mollification). */
static void shape_of(const double length[3], double slack, double cot[3], double *area) {
  double l[3], least = INFINITY;
  for (int k = 0; k < 3; k++) {
    least = fmin(least, length[(k + 1) % 3] + length[(k + 2) % 3] - length[k]);
  }
  for (int k = 0; k < 3; k++) {
    l[k] = length[k] + (least < slack ? slack - least : 0);
  }
  double s = 0.5 * (l[0] + l[1] + l[2]), a2 = s * (s - l[0]) * (s - l[1]) * (s - l[2]);
  *area = sqrt(a2 > 0 ? a2 : 0) + ORB_TINY;
  for (int k = 0; k < 3; k++) {
    double b = l[(k + 1) % 3], c = l[(k + 2) % 3];
    cot[k] = (b * b + c * c - l[k] * l[k]) / (4 * *area);
  }
}

/* Areas are those of the level's own triangles; their sum stays as it is without mollification. */
static void fill_triangles(orb_map_level *l, const double *position, double *shape) {
  double mean = 0, raw = 0, total = 0;
  for (int pass = 0; pass < 2; pass++) {
    for (int32_t t = 0; t < l->triangle_count; t++) {
      const double *p[3];
      double length[3], e[3], f[3], n[3], sum = 0;
      for (int k = 0; k < 3; k++) {
        p[k] = position + 3 * (size_t)l->vertex[l->triangle[3 * (size_t)t + (size_t)k]];
      }
      for (int k = 0; k < 3; k++) {
        length[k] = sqrt(orb_distance2(p[(k + 1) % 3], p[(k + 2) % 3]));
        sum += length[k];
      }
      if (pass == 0) {
        orb_sub(p[1], p[0], e);
        orb_sub(p[2], p[0], f);
        orb_cross(e, f, n);
        raw += 0.5 * orb_length(n);
        mean += sum / (3.0 * l->triangle_count);
      } else {
        double *out = shape + 4 * (size_t)t;
        shape_of(length, l->params->star.mollify * (sum / 3 + MEAN_SHARE * mean), out, out + 3);
        total += out[3];
      }
    }
  }
  for (int32_t t = 0; t < l->triangle_count; t++) {
    shape[4 * (size_t)t + 3] *= total > 0 ? raw / total : 1;
  }
}

static void fill_spokes(orb_map_level *l, const double *shape) {
  int32_t *at = l->start;
  memset(at, 0, ((size_t)l->count + 1) * sizeof *at);
  for (int32_t h = 0; h < 3 * l->triangle_count; h++) {
    at[l->triangle[h] + 1]++;
  }
  for (int32_t v = 0; v < l->count; v++) {
    at[v + 1] += at[v];
    l->area[v] = 0;
  }
  for (int32_t t = l->triangle_count - 1; t >= 0; t--) {
    const double *cot = shape + 4 * (size_t)t;
    const int32_t *v = l->triangle + 3 * (size_t)t;
    for (int k = 0; k < 3; k++) {
      int i = (k + 1) % 3, j = (k + 2) % 3;
      l->spoke[--at[v[k] + 1]] = (orb_map_spoke){v[i], v[j], cot[k], cot[i], cot[j], cot[3]};
      l->area[v[k]] += cot[3] / 3;
    }
  }
  /* at[v + 1] now is the start of v: shift back. */
  for (int32_t v = 0; v < l->count; v++) {
    at[v] = at[v + 1];
  }
  at[l->count] = 3 * l->triangle_count;
  for (int32_t v = 0; v < l->count; v++) {
    for (int32_t i = at[v]; i + 1 < at[v + 1]; i++) {
      for (int32_t j = i + 1; j < at[v + 1]; j++) {
        if (l->spoke[j].q == l->spoke[i].r) {
          orb_map_spoke other = l->spoke[i + 1];
          l->spoke[i + 1] = l->spoke[j];
          l->spoke[j] = other;
          break;
        }
      }
    }
  }
}

/* Greedy colours, so that neighbours never move at once. Vertices that get no colour do not move. */
static void choose_colours(orb_map_level *l, signed char *colour) {
  for (int32_t v = 0; v < l->count; v++) {
    uint64_t used = 0;
    for (int32_t i = l->start[v]; i < l->start[v + 1]; i++) {
      const int32_t q = l->spoke[i].q, c = q < v ? colour[q] : -1;
      used |= c >= 0 ? (uint64_t)1 << c : 0;
    }
    colour[v] = -1;
    if (!l->pinned[v] && ~used) {
      colour[v] = (signed char)__builtin_ctzll(~used);
      l->colours = colour[v] + 1 > l->colours ? colour[v] + 1 : l->colours;
    }
  }
}

/* The corner table numbers vertices along a curve that fills the surface, so ranges of numbers are parts of it. The
 * border is what keeps the rest of the parts apart, and all vertices with many spokes, which sweeps step one by one. */
static void choose_parts(orb_map_level *l, int32_t *part) {
  for (l->parts = 1; l->parts < PARTS_MOST && l->count / (2 * l->parts) >= PART_LEAST;) {
    l->parts *= 2;
  }
  for (int32_t v = 0; v < l->count; v++) {
    const int32_t own = (int32_t)((int64_t)v * l->parts / l->count);
    int is_border = l->start[v + 1] - l->start[v] > ORB_MAP_STEP_RING_MAX;
    for (int32_t i = l->start[v]; i < l->start[v + 1] && !is_border; i++) {
      const int32_t q = l->spoke[i].q;
      is_border = q < v && part[q] != own && part[q] != l->parts;
    }
    part[v] = is_border ? l->parts : own;
  }
}

static orb_status fill_groups(orb_context *ctx, orb_map_level *l) {
  orb_status status = ORB_E_NO_MEMORY;
  signed char *colour = ORB_NEW(ctx, signed char, l->count);
  int32_t *part = ORB_NEW(ctx, int32_t, l->count), *start;
  if (!colour || !part) {
    goto done;
  }
  choose_colours(l, colour);
  choose_parts(l, part);
  const size_t groups = (size_t)(l->parts + 1) * (size_t)l->colours;
  start = l->group_start = ORB_NEW0(ctx, int32_t, groups + 1);
  if (!start) {
    goto done;
  }
  for (int32_t v = 0; v < l->count; v++) {
    if (colour[v] >= 0) {
      start[part[v] * l->colours + colour[v] + 1]++;
    }
  }
  for (size_t g = 0; g < groups; g++) {
    start[g + 1] += start[g];
  }
  l->moving = start[groups];
  for (int32_t v = l->count; v-- > 0;) { /* from behind: start[g + 1] falls to where group g begins */
    if (colour[v] >= 0) {
      l->by_group[--start[part[v] * l->colours + colour[v] + 1]] = v;
    }
  }
  for (size_t g = 0; g < groups; g++) {
    start[g] = start[g + 1];
  }
  start[groups] = l->moving;
  status = ORB_OK;
done:
  orb_free(ctx, colour);
  orb_free(ctx, part);
  return status;
}

/* Numbers the live vertices, and lists each live triangle once: at the corner of its lowest vertex. */
static void gather(orb_map_level *l, const orb_corner_table *s, const unsigned char *alive,
                   const unsigned char *pinned) {
  int32_t count = 0, t = 0;
  for (int32_t v = 0; v < s->vertex_count; v++) {
    l->local[v] = alive[v] ? count : -1;
    if (alive[v]) {
      l->pinned[count] = pinned[v];
      l->vertex[count++] = v;
    }
  }
  ORB_ASSERT(count == l->count);
  for (int32_t i = 0; i < l->count; i++) {
    int32_t v = l->vertex[i], first = s->vertex_corner[v], c = first;
    do {
      int32_t q = s->corner[orb_corner_next(c)], r = s->corner[orb_corner_prev(c)];
      if (v < q && v < r) {
        ORB_ASSERT(t < l->triangle_count);
        l->triangle[3 * (size_t)t] = i;
        l->triangle[3 * (size_t)t + 1] = l->local[q];
        l->triangle[3 * (size_t)t + 2] = l->local[r];
        t++;
      }
      c = orb_corner_swing(s, c);
    } while (c != first);
  }
  ORB_ASSERT(t == l->triangle_count);
}

orb_status orb_map_level_create(orb_context *ctx, const orb_map_params *params, const orb_corner_table *s,
                                const unsigned char *alive, const unsigned char *pinned, const double *position,
                                int32_t live, int32_t *local, orb_map_level *out) {
  orb_map_level l = {
      .params = params, .count = live, .triangle_count = 2 * live - 4, .to_mesh = s->to_mesh, .local = local};
  double *shape = NULL;
  orb_status status;
  ORB_GO(status, reserve(ctx, &l), done);
  shape = ORB_NEW(ctx, double, 4 * (size_t)l.triangle_count);
  if (!shape) {
    status = ORB_E_NO_MEMORY;
    goto done;
  }
  gather(&l, s, alive, pinned);
  fill_triangles(&l, position, shape);
  fill_spokes(&l, shape);
  status = fill_groups(ctx, &l);
done:
  orb_free(ctx, shape);
  if (status == ORB_OK) {
    *out = l;
  } else {
    orb_map_level_free(ctx, &l);
  }
  return status;
}

void orb_map_level_refresh(orb_map_level *l, const orb_map_surface *b, int32_t v) {
  orb_map_surface_at(b, &l->place[v], l->y + 3 * (size_t)v, NULL, l->n + 3 * (size_t)v);
  l->density[v] = b->density[l->place[v].triangle];
}

void orb_map_level_locate(orb_map_level *l, const orb_map_surface *b, int32_t v, int32_t hint) {
  orb_locate(b->locator, l->x + 3 * (size_t)v, hint, &l->place[v]);
  orb_map_level_refresh(l, b, v);
}

typedef struct locate_job {
  orb_map_level *level;
  const orb_map_surface *b;
  int fresh;
} locate_job;

static void locate_range(void *arg, int64_t begin, int64_t end, int thread) {
  const locate_job *job = arg;
  orb_map_level *l = job->level;
  (void)thread;
  for (int32_t v = (int32_t)begin; v < end; v++) {
    if (job->fresh) {
      orb_map_level_locate(l, job->b, v, v > begin ? l->place[v - 1].triangle : -1);
    } else if (!l->pinned[v]) {
      orb_map_level_locate(l, job->b, v, l->place[v].triangle);
    }
  }
}

orb_status orb_map_level_locate_all(orb_context *ctx, orb_map_level *l, const orb_map_surface *b, int fresh) {
  locate_job job = {l, b, fresh};
  return orb_sliced_by(ctx, l->count, LOCATE_SLICE, LOCATE_GRAIN, locate_range, &job);
}

int32_t orb_map_level_flips(const orb_map_level *l) {
  int32_t flips = 0;
  for (int32_t t = 0; t < l->triangle_count; t++) {
    const int32_t *v = l->triangle + 3 * (size_t)t;
    flips += orb_orient(l->x + 3 * (size_t)v[0], l->x + 3 * (size_t)v[1], l->x + 3 * (size_t)v[2]) <= 0;
  }
  return flips;
}

int32_t orb_map_level_degree(const orb_map_level *l) {
  double area = 0;
  for (int32_t t = 0; t < l->triangle_count; t++) {
    const int32_t *v = l->triangle + 3 * (size_t)t;
    const double *p = l->x + 3 * (size_t)v[0], *q = l->x + 3 * (size_t)v[1], *r = l->x + 3 * (size_t)v[2];
    area += 2 * atan2(orb_det(p, q, r), 1 + orb_dot(p, q) + orb_dot(q, r) + orb_dot(r, p));
  }
  return (int32_t)lround(area / (4 * M_PI));
}

/* Symmetric Dirichlet energy of the triangle of a spoke of v; 1: isometric. */
static double triangle_energy(const orb_map_level *l, int32_t v, const orb_map_spoke *s) {
  const double *y = l->y + 3 * (size_t)v, *q = l->y + 3 * (size_t)s->q, *r = l->y + 3 * (size_t)s->r;
  double u[3], w[3], cross[3], normal[3];
  orb_sub(q, y, u);
  orb_sub(r, y, w);
  orb_cross(u, w, cross);
  for (int k = 0; k < 3; k++) {
    normal[k] =
        l->n[3 * (size_t)v + (size_t)k] + l->n[3 * (size_t)s->q + (size_t)k] + l->n[3 * (size_t)s->r + (size_t)k];
  }
  double signed_area = 0.5 * orb_dot(cross, normal) / (orb_length(normal) + ORB_TINY);
  double dirichlet = 0.5 * (s->cv * orb_distance2(q, r) + s->cq * orb_dot(w, w) + s->cr * orb_dot(u, u));
  double ratio = signed_area > 0 ? s->area / signed_area : INFINITY;
  return dirichlet * (1 + ratio * ratio) / (4 * s->area);
}

int32_t orb_map_level_mark_above(const orb_map_level *l, double limit, unsigned char *mark) {
  int32_t count = 0;
  memset(mark, 0, (size_t)l->count);
  for (int32_t v = 0; v < l->count; v++) {
    for (int32_t i = l->start[v]; i < l->start[v + 1]; i++) {
      const orb_map_spoke *s = &l->spoke[i];
      if (v < s->q && v < s->r && !(triangle_energy(l, v, s) <= limit)) {
        mark[v] = mark[s->q] = mark[s->r] = 1;
        count++;
      }
    }
  }
  return count;
}

void orb_map_level_part_energies(const orb_map_level *l, const int32_t *part, int32_t parts, double *energy) {
  const double cap = l->params->energy.cap;
  memset(energy, 0, (size_t)parts * sizeof *energy);
  for (int32_t v = 0; v < l->count; v++) {
    for (int32_t i = l->start[v]; i < l->start[v + 1]; i++) {
      const orb_map_spoke *s = &l->spoke[i];
      const int32_t one = part[v] > part[s->q] ? part[v] : part[s->q], all = one > part[s->r] ? one : part[s->r];
      if (all < 0 || v > s->q || v > s->r) {
        continue;
      }
      const int flipped = orb_orient(l->x + 3 * (size_t)v, l->x + 3 * (size_t)s->q, l->x + 3 * (size_t)s->r) <= 0;
      energy[all] += flipped ? INFINITY : s->area * fmin(cap, triangle_energy(l, v, s));
    }
  }
}

double orb_map_level_energy(const orb_map_level *l) {
  return orb_map_level_capped_energy(l, l->params->energy.cap);
}

double orb_map_level_capped_energy(const orb_map_level *l, double cap) {
  double energy = 0, weight = 0;
  for (int32_t v = 0; v < l->count; v++) {
    for (int32_t i = l->start[v]; i < l->start[v + 1]; i++) {
      const orb_map_spoke *s = &l->spoke[i];
      if (v > s->q || v > s->r) {
        continue; /* each triangle once */
      }
      const double value = triangle_energy(l, v, s);
      energy += s->area * (value < cap ? value : cap);
      weight += s->area;
    }
  }
  return weight > 0 ? energy / weight : cap;
}
