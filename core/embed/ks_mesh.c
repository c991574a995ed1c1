#include "embed/ks_mesh.h"

#include <string.h>

#include "base/check.h"

void ks_mesh_free(orb_context *ctx, ks_mesh *m) {
  orb_free(ctx, m->tri);
  orb_free(ctx, m->twin);
  orb_free(ctx, m->out);
  orb_free(ctx, m->valence);
  orb_free(ctx, m->log);
  memset(m, 0, sizeof *m);
}

orb_status ks_mesh_create(orb_context *ctx, const orb_mesh *mesh, const double *x, ks_mesh *out) {
  ks_mesh m = {
      .vertex_count = mesh->vertex_count, .triangle_count = mesh->triangle_count, .live = mesh->vertex_count, .x = x};
  size_t corners = 3 * (size_t)mesh->triangle_count;
  orb_status status = ORB_E_NO_MEMORY;
  m.tri = ORB_NEW(ctx, int32_t, corners);
  m.twin = ORB_NEW(ctx, int32_t, corners);
  m.out = ORB_NEW(ctx, int32_t, m.vertex_count);
  m.valence = ORB_NEW0(ctx, int32_t, m.vertex_count);
  m.log = ORB_NEW(ctx, struct ks_collapse, m.vertex_count);
  if (!m.tri || !m.twin || !m.out || !m.valence || !m.log) {
    goto fail;
  }
  memcpy(m.tri, mesh->triangles, corners * sizeof *m.tri);
  ORB_GO(status, orb_mesh_twins(ctx, m.tri, m.triangle_count, m.vertex_count, m.twin), fail);
  for (size_t h = 0; h < corners; h++) {
    m.out[m.tri[h]] = (int32_t)h;
    m.valence[m.tri[h]]++;
  }
  *out = m;
  return ORB_OK;
fail:
  ks_mesh_free(ctx, &m);
  return status;
}

int ks_link_holds(const ks_mesh *m, int32_t h, int32_t *mark, int32_t stamp) {
  if (m->live <= 4) {
    return 0;
  }
  int32_t v1 = m->tri[h], v2 = ks_head(m, h), common = 0;
  int32_t e = m->out[v2];
  do {
    mark[ks_head(m, e)] = stamp;
    e = ks_rotate(m, e);
  } while (e != m->out[v2]);
  e = m->out[v1];
  do {
    common += mark[ks_head(m, e)] == stamp;
    e = ks_rotate(m, e);
  } while (e != m->out[v1]);
  return common == 2;
}

static void pair_up(ks_mesh *m, int32_t a, int32_t b) {
  m->twin[a] = b;
  m->twin[b] = a;
}

/* With the ring v2 = r₀, r₁, …, r₍k−1₎ of v1, the triangles (v1,v2,r₁) and (v1,r₍k−1₎,v2) die. */
void ks_collapse_edge(ks_mesh *m, int32_t h) {
  int32_t v1 = m->tri[h], v2 = ks_head(m, h);
  int32_t first = ks_rotate(m, h);     /* v1→r₁ */
  int32_t last = orb_next(m->twin[h]); /* v1→r₍k−1₎ in the second dying triangle */
  int32_t before = m->twin[last];      /* r₍k−1₎→v1, stays */
  int32_t r1 = ks_head(m, first), rk = m->tri[before];
  for (int32_t e = first; e != last; e = ks_rotate(m, e)) {
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
}

int32_t ks_split_last(ks_mesh *m) {
  ORB_ASSERT(m->log_count > 0);
  struct ks_collapse c = m->log[--m->log_count];
  int32_t h = c.edge, v1 = c.vertex, v2 = ks_head(m, h);
  int32_t first = m->twin[orb_prev(h)], last = orb_next(m->twin[h]), before = m->twin[last];
  int32_t r1 = m->tri[orb_prev(h)], rk = m->tri[before];
  /* The dead triangles still point at their neighbours; let these point back. */
  m->twin[first] = orb_prev(h);
  m->twin[m->twin[orb_next(h)]] = orb_next(h);
  m->twin[before] = last;
  m->twin[m->twin[orb_next(last)]] = orb_next(last);
  int32_t k = 2;
  m->tri[h] = v1;
  for (int32_t e = first; e != last; e = ks_rotate(m, e)) {
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
  return v1;
}
