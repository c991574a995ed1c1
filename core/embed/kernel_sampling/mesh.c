#include "embed/kernel_sampling/mesh.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "numeric/vec3.h"

/* Least area of a triangle, as a share of the mean: Eq. 3 divides by it. */
static const double AREA_FLOOR = 1e-2;

void orb_ks_mesh_free(orb_context *ctx, orb_ks_mesh *m) {
  orb_free(ctx, m->tri);
  orb_free(ctx, m->twin);
  orb_free(ctx, m->out);
  orb_free(ctx, m->valence);
  orb_free(ctx, m->log);
  orb_free(ctx, m->area);
  orb_free(ctx, m->saved);
  memset(m, 0, sizeof *m);
}

/* The area of the triangle of half-edge h on the coarse mesh. */
static double triangle_area(const orb_ks_mesh *m, int32_t h) {
  return orb_triangle_area(m->x + 3 * (size_t)m->tri[h], m->x + 3 * (size_t)orb_ks_head(m, h),
                           m->x + 3 * (size_t)m->tri[orb_prev(h)]);
}

orb_status orb_ks_mesh_create(orb_context *ctx, const orb_mesh *mesh, const double *x, orb_ks_mesh *out) {
  orb_ks_mesh m = {
      .vertex_count = mesh->vertex_count, .triangle_count = mesh->triangle_count, .live = mesh->vertex_count, .x = x};
  size_t corners = 3 * (size_t)mesh->triangle_count;
  orb_status status = ORB_E_NO_MEMORY;
  m.tri = ORB_NEW(ctx, int32_t, corners);
  m.twin = ORB_NEW(ctx, int32_t, corners);
  m.out = ORB_NEW(ctx, int32_t, m.vertex_count);
  m.valence = ORB_NEW0(ctx, int32_t, m.vertex_count);
  m.log = ORB_NEW(ctx, struct orb_ks_collapse, m.vertex_count);
  m.area = ORB_NEW(ctx, double, m.triangle_count);
  if (!m.tri || !m.twin || !m.out || !m.valence || !m.log || !m.area) {
    goto fail;
  }
  memcpy(m.tri, mesh->triangles, corners * sizeof *m.tri);
  ORB_GO(status, orb_mesh_twins(ctx, m.tri, m.triangle_count, m.vertex_count, m.twin), fail);
  for (size_t h = 0; h < corners; h++) {
    m.out[m.tri[h]] = (int32_t)h;
    m.valence[m.tri[h]]++;
  }
  double total = 0;
  for (int32_t t = 0; t < m.triangle_count; t++) {
    m.area[t] = triangle_area(&m, 3 * t);
    total += m.area[t];
  }
  m.area_floor = AREA_FLOOR * (total > 0 ? total : 4 * M_PI) / m.triangle_count;
  double floored = 0;
  for (int32_t t = 0; t < m.triangle_count; t++) {
    m.area[t] = m.area[t] > m.area_floor ? m.area[t] : m.area_floor;
    floored += m.area[t];
  }
  for (int32_t t = 0; t < m.triangle_count; t++) {
    m.area[t] *= 4 * M_PI / floored;
  }
  *out = m;
  return ORB_OK;
fail:
  orb_ks_mesh_free(ctx, &m);
  return status;
}

int orb_ks_link_holds(const orb_ks_mesh *m, int32_t h, int32_t *mark, int32_t stamp) {
  if (m->live <= 4) {
    return 0;
  }
  int32_t v1 = m->tri[h], v2 = orb_ks_head(m, h), common = 0;
  int32_t e = m->out[v2];
  do {
    mark[orb_ks_head(m, e)] = stamp;
    e = orb_ks_rotate(m, e);
  } while (e != m->out[v2]);
  e = m->out[v1];
  do {
    common += mark[orb_ks_head(m, e)] == stamp;
    e = orb_ks_rotate(m, e);
  } while (e != m->out[v1]);
  return common == 2;
}

static void pair_up(orb_ks_mesh *m, int32_t a, int32_t b) {
  m->twin[a] = b;
  m->twin[b] = a;
}

/* Saves the areas of the star of h's origin; *total: their sum. */
static orb_status save_areas(orb_context *ctx, orb_ks_mesh *m, int32_t h, double *total) {
  size_t count = (size_t)m->valence[m->tri[h]];
  if (m->saved_count + count > m->saved_capacity) {
    size_t capacity = m->saved_capacity + m->saved_capacity / 2 + count + 1024;
    double *grown = orb_realloc(ctx, m->saved, capacity, sizeof *grown);
    if (!grown) {
      return ORB_E_NO_MEMORY;
    }
    m->saved = grown;
    m->saved_capacity = capacity;
  }
  *total = 0;
  int32_t e = h;
  for (size_t i = 0; i < count; i++) {
    m->saved[m->saved_count++] = m->area[e / 3];
    *total += m->area[e / 3];
    e = orb_ks_rotate(m, e);
  }
  return ORB_OK;
}

/* Distributes `total` over the triangles of `count` half-edges from `first` on: half in proportion to their areas on
 * the mesh, half in equal parts, so that each gets some. */
static void share_area(orb_ks_mesh *m, int32_t first, int32_t count, double total) {
  double sum = 0;
  int32_t e = first;
  for (int32_t i = 0; i < count; i++) {
    m->area[e / 3] = triangle_area(m, e) + m->area_floor;
    sum += m->area[e / 3];
    e = orb_ks_rotate(m, e);
  }
  double even = sum / count;
  sum = 0;
  e = first;
  for (int32_t i = 0; i < count; i++) {
    m->area[e / 3] += even;
    sum += m->area[e / 3];
    e = orb_ks_rotate(m, e);
  }
  for (e = first; count > 0; count--) {
    m->area[e / 3] *= total / sum;
    e = orb_ks_rotate(m, e);
  }
}

/* With the ring v2 = r₀, r₁, …, r₍k−1₎ of v1, the triangles (v1,v2,r₁) and (v1,r₍k−1₎,v2) die. */
orb_status orb_ks_collapse_edge(orb_context *ctx, orb_ks_mesh *m, int32_t h) {
  int32_t v1 = m->tri[h], v2 = orb_ks_head(m, h), left = m->valence[v1] - 2;
  double total;
  ORB_TRY(save_areas(ctx, m, h, &total));
  int32_t first = orb_ks_rotate(m, h); /* v1→r₁ */
  int32_t last = orb_next(m->twin[h]); /* v1→r₍k−1₎ in the second dying triangle */
  int32_t before = m->twin[last];      /* r₍k−1₎→v1, stays */
  int32_t r1 = orb_ks_head(m, first), rk = m->tri[before];
  for (int32_t e = first; e != last; e = orb_ks_rotate(m, e)) {
    m->tri[e] = v2;
  }
  pair_up(m, first, m->twin[orb_next(h)]);
  m->twin[before] = m->twin[orb_next(last)];
  m->twin[m->twin[orb_next(last)]] = before;
  m->out[v2] = first;
  m->out[r1] = orb_next(first);
  m->out[rk] = before;
  m->valence[v2] += m->valence[v1] - 4;
  m->valence[r1]--;
  m->valence[rk]--;
  m->valence[v1] = 0;
  m->log[m->log_count].vertex = v1;
  m->log[m->log_count++].edge = h;
  m->live--;
  share_area(m, first, left, total);
  return ORB_OK;
}

int32_t orb_ks_split_last(orb_ks_mesh *m) {
  ORB_ASSERT(m->log_count > 0);
  struct orb_ks_collapse c = m->log[--m->log_count];
  int32_t h = c.edge, v1 = c.vertex, v2 = orb_ks_head(m, h);
  int32_t first = m->twin[orb_prev(h)], last = orb_next(m->twin[h]), before = m->twin[last];
  int32_t r1 = m->tri[orb_prev(h)], rk = m->tri[before];
  /* The dead triangles still point at their neighbours; make these point back. */
  m->twin[first] = orb_prev(h);
  m->twin[m->twin[orb_next(h)]] = orb_next(h);
  m->twin[before] = last;
  m->twin[m->twin[orb_next(last)]] = orb_next(last);
  int32_t k = 2;
  m->tri[h] = v1;
  for (int32_t e = first; e != last; e = orb_ks_rotate(m, e)) {
    m->tri[e] = v1;
    k++;
  }
  m->out[v1] = h;
  m->out[v2] = orb_next(h);
  m->valence[v1] = k;
  m->valence[v2] -= k - 4;
  m->valence[r1]++;
  m->valence[rk]++;
  m->live++;
  m->saved_count -= (size_t)k;
  int32_t e = h;
  for (int32_t i = 0; i < k; i++) {
    m->area[e / 3] = m->saved[m->saved_count + (size_t)i];
    e = orb_ks_rotate(m, e);
  }
  return v1;
}
