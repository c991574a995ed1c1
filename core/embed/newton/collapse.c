/* Vertex v goes into u, its neighbour next to corner `first`. Of the k triangles of v's star the first and the last
 * (those at the edge vu) vanish; in the others u replaces v. Areas are carried: the star's whole target area goes to
 * the k − 2 triangles that are left, in proportion to their new areas plus a floor, so that a limb keeps its room on
 * the sphere on every coarse level. */
#include "embed/newton/collapse.h"

#include <math.h>

#include "base/check.h"
#include "base/memory.h"

static const float CARRY_FLOOR = 0.1F; /* share of the mean new area, so that every triangle gets some */

orb_status orb_collapse_reserve(orb_context *ctx, orb_hierarchy *h, int32_t valence) {
  int64_t need = h->area_count + valence;
  if (need > h->area_capacity) {
    int64_t capacity = h->area_capacity + h->area_capacity / 4;
    capacity = capacity < need ? need : capacity;
    float *grown = orb_realloc(ctx, h->area_log, (size_t)capacity, sizeof(float));
    if (!grown) {
      return ORB_E_NO_MEMORY;
    }
    h->area_log = grown;
    h->area_capacity = capacity;
  }
  return ORB_OK;
}

static float doubled_area(const orb_corner_table *s, int32_t a, int32_t b, int32_t c) {
  const float *p = s->position4 + 4 * (int64_t)a, *q = s->position4 + 4 * (int64_t)b;
  const float *r = s->position4 + 4 * (int64_t)c;
  float u[3], w[3];
  for (int k = 0; k < 3; k++) {
    u[k] = q[k] - p[k];
    w[k] = r[k] - p[k];
  }
  float x = u[1] * w[2] - u[2] * w[1], y = u[2] * w[0] - u[0] * w[2], z = u[0] * w[1] - u[1] * w[0];
  return sqrtf(x * x + y * y + z * z);
}

static void link(orb_corner_table *s, int32_t a, int32_t b) {
  s->opposite[a] = b;
  s->opposite[b] = a;
}

/* Spreads the star's area over the triangles that stay: the second to the last but one. */
static void carry_areas(orb_corner_table *s, int32_t u, int32_t second, int32_t kept, float star_area) {
  float sum = 0;
  int32_t c = second;
  for (int32_t i = 0; i < kept; i++, c = orb_corner_swing(s, c)) {
    sum += doubled_area(s, u, s->corner[orb_corner_next(c)], s->corner[orb_corner_prev(c)]);
  }
  float floor = CARRY_FLOOR * sum / (float)kept + 1e-30F;
  sum += floor * (float)kept;
  c = second;
  for (int32_t i = 0; i < kept; i++, c = orb_corner_swing(s, c)) {
    float area = doubled_area(s, u, s->corner[orb_corner_next(c)], s->corner[orb_corner_prev(c)]);
    orb_corner_set_area(s, c, star_area * ((area + floor) / sum));
  }
}

void orb_collapse_apply(orb_corner_table *s, int32_t first, int32_t valence, orb_collapse *out, float *areas) {
  int32_t v = s->corner[first], u = s->corner[orb_corner_next(first)];
  int32_t second = orb_corner_swing(s, first), c = second, before = second;
  float star_area = orb_corner_area(s, first);
  for (int32_t i = 1; i < valence - 1; i++) { /* the triangles that stay */
    if (areas) {
      areas[i - 1] = orb_corner_area(s, c);
    }
    star_area += orb_corner_area(s, c);
    before = c;
    c = orb_corner_swing(s, c);
  }
  int32_t last = c;
  star_area += orb_corner_area(s, last);
  carry_areas(s, u, second, valence - 2, star_area); /* before the links it walks along change */
  c = second;
  for (int32_t i = 1; i < valence - 1; i++) {
    int32_t next = orb_corner_swing(s, c);
    s->corner[c] = u;
    c = next;
  }
  link(s, s->opposite[first], s->opposite[orb_corner_next(first)]);
  link(s, s->opposite[last], s->opposite[orb_corner_prev(last)]);
  int32_t left = s->corner[orb_corner_next(second)], right = s->corner[orb_corner_prev(before)];
  s->vertex_corner[u] = second;
  s->vertex_corner[left] = orb_corner_next(second);
  s->vertex_corner[right] = orb_corner_prev(before);
  orb_corner_table_set_valence(s, left, s->valence[left] - 1);
  orb_corner_table_set_valence(s, right, s->valence[right] - 1);
  orb_corner_table_set_valence(s, u, s->valence[u] + valence - 4);
  if (out) {
    *out = (orb_collapse){.vertex = v, .first = first, .last = last, .valence = valence};
  }
}

void orb_collapse_undo(orb_hierarchy *h, int32_t index) {
  const orb_collapse *log = &h->log[index];
  orb_corner_table *s = &h->surface;
  int32_t first = log->first, last = log->last, v = log->vertex, u = s->corner[orb_corner_next(first)];
  int32_t *o = s->opposite;
  o[o[last]] = last;
  o[o[orb_corner_prev(last)]] = orb_corner_prev(last);
  o[o[first]] = first;
  o[o[orb_corner_next(first)]] = orb_corner_next(first);
  const float *areas = h->area_log + log->areas;
  int32_t c = first;
  for (int32_t i = 0; i < log->valence; i++) {
    s->corner[c] = v;
    if (i > 0 && i < log->valence - 1) {
      orb_corner_set_area(s, c, areas[i - 1]);
    }
    c = orb_corner_swing(s, c);
  }
  s->vertex_corner[v] = first;
  s->vertex_corner[u] = orb_corner_next(first);
  int32_t left = s->corner[orb_corner_prev(first)], right = s->corner[orb_corner_next(last)];
  orb_corner_table_set_valence(s, left, s->valence[left] + 1);
  orb_corner_table_set_valence(s, right, s->valence[right] + 1);
  orb_corner_table_set_valence(s, u, s->valence[u] - (log->valence - 4));
}

void orb_collapse_redo(orb_hierarchy *h, int32_t index) {
  orb_collapse_apply(&h->surface, h->log[index].first, h->log[index].valence, NULL, NULL);
}
