/* Finds twisted limbs, and undoes a twist.
 *
 * A map can be nearly isometric and yet carry the end of a limb to the limb's other side: a twist by half a turn that
 * is spread over a tube costs little energy, no landmark at the tip forbids it, and descent does not undo it, since it
 * is a minimum. Halfway through the morph the tube then collapses. Around every vertex of the fixed shape the map
 * rotates space; where that rotation is far from the one of the whole shape, a limb may be twisted. Such a part is
 * grown towards its root and cut into rings (limb.c). The rotation of each ring against the ring before it, around the
 * axis between their centres, is summed up from the root. If the sum is a twist, each ring is rotated back by the sum
 * up to it. A limb that is only posed differently has no such sum.
 */
#include "align/map/twist/twist.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "align/map/twist/limb.h"
#include "base/check.h"
#include "base/memory.h"
#include "numeric/rotation.h"
#include "numeric/vec3.h"

static const double GROWTH_VERTICES = 1e4; /* vertices of a surface for which params.twist.growth counts rings */
static const double NOT_PARALLEL = 0.7;    /* cosine: an axis at a greater angle is far from parallel to the limb's */

typedef struct twist_run {
  orb_context *ctx;
  const orb_map_params *params;
  const orb_map_surface *b;
  const orb_map_image *map;
  double *back;    /* where each vertex of the surface comes from, 3 each */
  double *height;  /* in the current limb */
  double *rotated; /* angle of every vertex's surroundings against the whole */
  int32_t *part;   /* representative of each vertex's part; union-find */
  int32_t *corner; /* a half-edge out of each vertex */
  int32_t *rim;    /* vertices at which a dilation starts */
  int32_t rim_count;
  unsigned char *held, *inside, *next, *taken; /* taken: in or next to an earlier limb */
} twist_run;

/* A ring of a limb. */
typedef struct band {
  double height, from[3], to[3], rotation[9];
} band;

static int32_t find_part(int32_t *part, int32_t v) {
  while (part[v] != v) {
    v = part[v] = part[part[v]];
  }
  return v;
}

/* Joins neighbours whose flags both have this value. */
static void join_parts(twist_run *run, const unsigned char *flag, int value) {
  const orb_map_surface *b = run->b;
  for (int32_t v = 0; v < b->vertex_count; v++) {
    run->part[v] = v;
  }
  for (int32_t h = 0; h < 3 * b->triangle_count; h++) {
    int32_t v = b->triangles[h], u = b->triangles[orb_next(h)];
    if (flag[v] == value && flag[u] == value) {
      int32_t p = find_part(run->part, v), q = find_part(run->part, u);
      run->part[p > q ? p : q] = p > q ? q : p;
    }
  }
  for (int32_t v = 0; v < b->vertex_count; v++) {
    run->part[v] = find_part(run->part, v);
  }
}

/* The share of the surface in triangles with all corners inside. */
static double share_inside(const twist_run *run) {
  const orb_map_surface *b = run->b;
  double area = 0;
  for (int32_t t = 0; t < b->triangle_count; t++) {
    const int32_t *v = b->triangles + 3 * (size_t)t;
    if (run->inside[v[0]] && run->inside[v[1]] && run->inside[v[2]]) {
      area += orb_triangle_area_at(b->x, v);
    }
  }
  return area / (4 * M_PI);
}

/* Parts of the outside that the inside separates from the greatest one become inside. */
static orb_status fill_holes(twist_run *run) {
  int32_t n = run->b->vertex_count, most = -1, *count = ORB_NEW0(run->ctx, int32_t, n);
  if (!count) {
    return ORB_E_NO_MEMORY;
  }
  join_parts(run, run->inside, 0);
  for (int32_t v = 0; v < n; v++) {
    if (!run->inside[v]) {
      count[run->part[v]]++;
      most = most < 0 || count[run->part[v]] > count[most] ? run->part[v] : most;
    }
  }
  for (int32_t v = 0; v < n; v++) {
    run->inside[v] = run->inside[v] || run->part[v] != most;
  }
  orb_free(run->ctx, count);
  return ORB_OK;
}

/* The half-edge out of the same vertex that comes next. */
static int32_t swing(const orb_map_surface *b, int32_t h) {
  return b->twin[orb_prev(h)];
}

/* The vertices inside with a neighbour outside: the first rim. */
static void find_rim(twist_run *run) {
  const orb_map_surface *b = run->b;
  memcpy(run->next, run->inside, (size_t)b->vertex_count);
  run->rim_count = 0;
  for (int32_t h = 0; h < 3 * b->triangle_count; h++) {
    int32_t v = b->triangles[h];
    if (run->next[v] == 1 && !run->next[b->triangles[orb_next(h)]]) {
      run->next[v] = 2;
      run->rim[run->rim_count++] = v;
    }
  }
  memcpy(run->next, run->inside, (size_t)b->vertex_count);
}

/* Adds the ring of vertices around the rim to run->next, and makes it the new rim. Returns its length. *blocked: the
 * ring contains a held vertex or one of another limb. */
static double dilate(twist_run *run, int *blocked) {
  const orb_map_surface *b = run->b;
  double length = 0;
  int32_t old = run->rim_count, count = old;
  *blocked = 0;
  for (int32_t i = 0; i < old; i++) {
    int32_t first = run->corner[run->rim[i]], h = first;
    do {
      int32_t u = b->triangles[orb_next(h)];
      if (!run->next[u]) {
        run->next[u] = 1;
        run->rim[count++] = u;
        *blocked |= run->held[u] || run->taken[u];
      }
      h = swing(b, h);
    } while (h != first);
  }
  run->rim_count = count - old;
  memmove(run->rim, run->rim + old, (size_t)run->rim_count * sizeof *run->rim);
  for (int32_t i = 0; i < run->rim_count; i++) {
    int32_t first = run->corner[run->rim[i]], h = first;
    do {
      int32_t u = b->triangles[orb_next(h)];
      if (run->next[u] && !run->next[b->triangles[orb_prev(h)]]) {
        length += sqrt(orb_distance2(b->x + 3 * (size_t)run->rim[i], b->x + 3 * (size_t)u));
      }
      h = swing(b, h);
    } while (h != first);
  }
  return length;
}

/* Grows the part towards its root: until the rings widen, or a held vertex or another limb is in the way. */
static orb_status grow(twist_run *run) {
  const orb_map_surface *b = run->b;
  double narrowest = INFINITY;
  int rings = (int)(run->params->twist.growth * sqrt(fmax(1, b->vertex_count / GROWTH_VERTICES)));
  find_rim(run);
  for (int i = 0; i < rings && run->rim_count > 0; i++) {
    int blocked;
    double length = dilate(run, &blocked);
    narrowest = fmin(narrowest, length);
    if (blocked || length > run->params->twist.wider * narrowest) {
      break;
    }
    for (int32_t k = 0; k < run->rim_count; k++) {
      run->inside[run->rim[k]] = 1;
    }
    ORB_TRY(orb_context_check(run->ctx));
  }
  return fill_holes(run);
}

/* The pole: the only held vertex inside, else the vertex deepest inside. −1: several are held. */
static int32_t find_pole(twist_run *run) {
  const orb_map_surface *b = run->b;
  int32_t pole = -1;
  for (int32_t v = 0; v < b->vertex_count; v++) {
    if (run->inside[v] && run->held[v]) {
      if (pole >= 0) {
        return -1;
      }
      pole = v;
    }
  }
  memcpy(run->next, run->inside, (size_t)b->vertex_count);
  for (int32_t left = 1; left > 0 && !(pole >= 0 && run->held[pole]);) { /* peel it, rim by rim */
    left = 0;
    for (int32_t h = 0; h < 3 * b->triangle_count; h++) {
      if (run->next[b->triangles[h]] == 1 && !run->next[b->triangles[orb_next(h)]]) {
        run->next[b->triangles[h]] = 2;
      }
    }
    for (int32_t v = 0; v < b->vertex_count; v++) {
      pole = run->next[v] && !left ? v : pole;
      left += run->next[v] == 1;
      run->next[v] = run->next[v] == 1;
    }
  }
  return pole;
}

typedef struct ranked {
  double height;
  int32_t vertex;
} ranked;

static int by_height(const void *a, const void *b) {
  const ranked *x = a, *y = b;
  return x->height != y->height ? (x->height > y->height) - (x->height < y->height)
                                : (x->vertex > y->vertex) - (x->vertex < y->vertex);
}

/* The centres of a band's vertices on both shapes, and the rotation between them. */
static int fit_band(const twist_run *run, const ranked *list, int32_t count, band *out) {
  double h[9] = {0};
  memset(out, 0, sizeof *out);
  for (int32_t i = 0; i < count; i++) {
    const double *y = run->b->x + 3 * (size_t)list[i].vertex, *x = run->back + 3 * (size_t)list[i].vertex;
    out->height += list[i].height / count;
    for (int k = 0; k < 3; k++) {
      out->from[k] += x[k] / count;
      out->to[k] += y[k] / count;
    }
  }
  for (int32_t i = 0; i < count; i++) {
    double x[3], y[3];
    orb_sub(run->back + 3 * (size_t)list[i].vertex, out->from, x);
    orb_sub(run->b->x + 3 * (size_t)list[i].vertex, out->to, y);
    orb_add_outer(h, y, x, 1);
  }
  return orb_nearest_rotation(h, out->rotation);
}

/* The angle by which one band is rotated against another, around the axis between them. */
static double rotation_between(const band *low, const band *high) {
  double axis[3], e[3], f[3], d[9], cosine = 0, sine = 0;
  const double any[3] = {1, 0, 0}, other[3] = {0, 1, 0};
  orb_sub(high->to, low->to, axis);
  if (!(orb_normalize(axis) > 0)) {
    return 0;
  }
  orb_cross(axis, fabs(axis[0]) < NOT_PARALLEL ? any : other, e);
  orb_normalize(e);
  orb_cross(axis, e, f);
  for (int k = 0; k < 9; k++) {
    d[k] = orb_dot(high->rotation + 3 * (k / 3), low->rotation + 3 * (k % 3));
  }
  for (int k = 0; k < 9; k++) {
    cosine += d[k] * (e[k / 3] * e[k % 3] + f[k / 3] * f[k % 3]);
    sine += d[k] * (f[k / 3] * e[k % 3] - e[k / 3] * f[k % 3]);
  }
  return atan2(sine, cosine);
}

/* The twist from the rim to each band; none where there are too few vertices. */
static orb_status measure_twist(twist_run *run, orb_map_twist *out) {
  const orb_map_surface *b = run->b;
  int32_t n = 0, rim = 0;
  int blocked;
  band low, high;
  ranked *list = ORB_NEW(run->ctx, ranked, b->vertex_count);
  if (!list) {
    return ORB_E_NO_MEMORY;
  }
  find_rim(run);
  (void)dilate(run, &blocked);
  for (int32_t v = 0; v < b->vertex_count; v++) {
    if (run->next[v]) {
      list[n++] = (ranked){run->inside[v] ? run->height[v] : 0, v};
      rim += !run->inside[v];
    }
  }
  qsort(list, (size_t)n, sizeof *list, by_height);
  int32_t bands = (n - rim) / run->params->twist.band_vertices, wanted = bands < ORB_MAP_BANDS ? bands : ORB_MAP_BANDS;
  int fine = wanted >= run->params->twist.bands && fit_band(run, list, rim, &low);
  out->height[0] = out->angle[0] = 0;
  for (int32_t k = 0; k < wanted && fine; k++) {
    int32_t begin = rim + (int32_t)((int64_t)(n - rim) * k / wanted);
    int32_t end = rim + (int32_t)((int64_t)(n - rim) * (k + 1) / wanted);
    fine = fit_band(run, list + begin, end - begin, &high);
    out->height[k + 1] = high.height;
    out->angle[k + 1] = out->angle[k] + rotation_between(&low, &high);
    low = high;
  }
  out->count = fine ? (int)wanted + 1 : 0;
  orb_free(run->ctx, list);
  return ORB_OK;
}

int orb_map_twists_undo(const orb_map_twists *twists, const orb_map_surface *b, double share, orb_place *place) {
  const int32_t *v = b->triangles + 3 * (size_t)place->triangle;
  double height = 0;
  int32_t limb = -1;
  for (int k = 0; k < 3; k++) {
    height += place->at[k] * twists->height[v[k]];
    limb = twists->of[v[k]] > limb ? twists->of[v[k]] : limb;
  }
  if (limb < 0 || !(height > 0)) {
    return 0;
  }
  const orb_map_twist *t = &twists->limb[limb];
  if (t->count < 2) {
    return 0;
  }
  int k = 1;
  while (k < t->count - 1 && t->height[k] < height) {
    k++;
  }
  double gap = t->height[k] - t->height[k - 1], f = gap > 0 ? (height - t->height[k - 1]) / gap : 1;
  double angle = t->angle[k - 1] + fmin(1, fmax(0, f)) * (t->angle[k] - t->angle[k - 1]);
  return orb_map_limb_rotate(b, twists->height, -share * angle, place);
}

/* Adds the current limb to the list if it is twisted. Limbs stay apart: its neighbours are closed to other limbs. */
static orb_status add_limb(twist_run *run, int32_t pole, orb_map_twists *out) {
  int32_t n = run->b->vertex_count;
  orb_map_twist limb = {.pole = pole};
  int blocked;
  ORB_TRY(orb_map_limb_heights(run->ctx, run->params, run->b, run->inside, pole, run->height));
  ORB_TRY(measure_twist(run, &limb));
  for (int k = 1; k < limb.count; k++) {
    limb.most = fmax(limb.most, fabs(limb.angle[k]));
  }
  if (limb.most < run->params->twist.twisted) {
    return ORB_OK;
  }
  find_rim(run);
  (void)dilate(run, &blocked);
  for (int32_t v = 0; v < n; v++) {
    if (run->inside[v]) {
      out->of[v] = out->count;
      out->height[v] = run->height[v];
    }
    run->taken[v] |= run->next[v];
  }
  out->limb[out->count++] = limb;
  return ORB_OK;
}

/* Examines the part that vertex `seed` represents. */
static orb_status examine(twist_run *run, const int32_t *part, int32_t seed, orb_map_twists *out) {
  for (int32_t v = 0; v < run->b->vertex_count; v++) {
    run->inside[v] = part[v] == seed;
  }
  ORB_TRY(fill_holes(run));
  for (int32_t v = 0; v < run->b->vertex_count; v++) {
    if (run->inside[v] && run->taken[v]) {
      return ORB_OK;
    }
  }
  double share = share_inside(run);
  int32_t pole = share < run->params->twist.smallest || share > run->params->twist.largest ? -1 : find_pole(run);
  if (pole < 0) {
    return ORB_OK;
  }
  ORB_TRY(grow(run));
  return add_limb(run, pole, out);
}

/* Examines the rotated parts of the surface, the largest first. */
static orb_status examine_all(twist_run *run, orb_map_twists *out) {
  int32_t n = run->b->vertex_count;
  int32_t *count = ORB_NEW0(run->ctx, int32_t, n), *part = ORB_NEW(run->ctx, int32_t, n);
  orb_status status = count && part ? ORB_OK : ORB_E_NO_MEMORY;
  if (status != ORB_OK) {
    goto done;
  }
  for (int32_t v = 0; v < n; v++) {
    run->inside[v] = run->rotated[v] > run->params->twist.rotated;
  }
  join_parts(run, run->inside, 1);
  memcpy(part, run->part, (size_t)n * sizeof *part);
  for (int32_t v = 0; v < n; v++) {
    count[part[v]] += run->inside[v];
  }
  for (int i = 0; i < ORB_MAP_LIMBS; i++) {
    int32_t best = 0;
    for (int32_t v = 0; v < n; v++) {
      best = count[v] > count[best] ? v : best;
    }
    if (count[best] < run->params->twist.band_vertices * run->params->twist.bands) {
      break;
    }
    count[best] = 0;
    ORB_GO(status, examine(run, part, best, out), done);
  }
done:
  orb_free(run->ctx, count);
  orb_free(run->ctx, part);
  return status;
}

void orb_map_twists_free(orb_context *ctx, orb_map_twists *twists) {
  orb_free(ctx, twists->of);
  orb_free(ctx, twists->height);
  memset(twists, 0, sizeof *twists);
}

orb_status orb_map_twists_find(orb_context *ctx, const orb_map_params *params, const orb_map_surface *b,
                               const orb_map_image *map, const int32_t *held, int32_t held_count, orb_map_twists *out) {
  size_t n = (size_t)b->vertex_count;
  twist_run run = {.ctx = ctx, .params = params, .b = b, .map = map};
  orb_status status = ORB_E_NO_MEMORY;
  memset(out, 0, sizeof *out);
  out->of = ORB_NEW(ctx, int32_t, n);
  out->height = ORB_NEW0(ctx, double, n);
  run.back = ORB_NEW(ctx, double, 3 * n);
  run.height = ORB_NEW(ctx, double, n);
  run.rotated = ORB_NEW(ctx, double, n);
  run.part = ORB_NEW(ctx, int32_t, n);
  run.corner = ORB_NEW(ctx, int32_t, 2 * n);
  run.held = ORB_NEW0(ctx, unsigned char, 4 * n);
  if (!out->of || !out->height || !run.back || !run.height || !run.rotated || !run.part || !run.corner || !run.held) {
    goto done;
  }
  run.inside = run.held + n;
  run.next = run.held + 2 * n;
  run.taken = run.held + 3 * n;
  run.rim = run.corner + n;
  for (size_t v = 0; v < n; v++) {
    out->of[v] = -1;
  }
  for (int32_t h = 0; h < 3 * b->triangle_count; h++) {
    run.corner[b->triangles[h]] = h;
  }
  for (int32_t i = 0; i < held_count; i++) {
    run.held[held[i]] = 1;
  }
  ORB_GO(status, orb_map_rotations_measure(ctx, b, map, run.back, run.rotated, &out->kept), done);
  status = examine_all(&run, out);
done:
  orb_free(ctx, run.back);
  orb_free(ctx, run.height);
  orb_free(ctx, run.rotated);
  orb_free(ctx, run.part);
  orb_free(ctx, run.corner);
  orb_free(ctx, run.held);
  if (status != ORB_OK) {
    orb_map_twists_free(ctx, out);
  }
  return status;
}
