/* Traces the edges of a base on one sheet: a spanning tree first, then the others. */
#include <stdlib.h>

#include "align/pin/base.h"
#include "align/pin/base_trace.h"
#include "align/pin/path_tracer.h"
#include "base/check.h"
#include "base/forest.h"
#include "base/memory.h"
#include "numeric/vec3.h"

typedef struct base_tracer {
  orb_path_tracer on;
  const orb_sheet *base;
  const int32_t *at;
  int32_t *base_done;     /* of each base half-edge */
  int32_t most_triangles; /* of the sheet */
} base_tracer;

static const double *point_of(const orb_sheet *s, int32_t v) {
  return s->shape.points + 3 * (size_t)v;
}

static int32_t edge_name(const orb_sheet *s, int32_t h) {
  return h < s->twin[h] ? h : s->twin[h];
}

/* Opens or closes the gates around the sheet vertex of base half-edge b's origin: the sector between the traced base
 * edges before and after b. */
static int set_gates(base_tracer *t, int32_t b, int open) {
  const orb_sheet *base = t->base;
  int32_t v = t->at[base->shape.mesh.triangles[b]], after = orb_sheet_swing(base, b), before_b = -1;
  while (after != b && !t->base_done[after]) {
    after = orb_sheet_swing(base, after);
  }
  for (int32_t i = after; i != b; i = orb_sheet_swing(base, i)) {
    before_b = t->base_done[i] ? i : before_b;
  }
  if (after == b) {
    orb_path_tracer_gates(&t->on, v, -1, -1, open);
    return 1;
  }
  int32_t first = orb_path_tracer_outgoing(&t->on, v, edge_name(base, before_b)),
          last = orb_path_tracer_outgoing(&t->on, v, edge_name(base, after));
  if (first < 0 || last < 0) {
    return 0;
  }
  orb_path_tracer_gates(&t->on, v, first, last, open);
  return 1;
}

static orb_status trace_one(base_tracer *t, int32_t b, int *good) {
  int32_t twin = t->base->twin[b];
  ORB_TRY(orb_path_tracer_fit(&t->on));
  ORB_TRY(orb_context_check(t->on.ctx));
  if (t->on.sheet->shape.mesh.triangle_count > t->most_triangles || !set_gates(t, b, 1) || !set_gates(t, twin, 1)) {
    *good = 0;
    return ORB_OK;
  }
  const int32_t *corners = t->base->shape.mesh.triangles;
  ORB_TRY(orb_path_tracer_search(&t->on, t->at[corners[b]], t->at[corners[twin]], good));
  (void)set_gates(t, b, 0);
  (void)set_gates(t, twin, 0);
  if (*good) {
    ORB_TRY(orb_path_tracer_lay(&t->on, edge_name(t->base, b), good));
    t->base_done[b] = t->base_done[twin] = 1;
  }
  return ORB_OK;
}

typedef struct candidate {
  double length;
  int32_t half_edge;
} candidate;

static int by_length(const void *a, const void *b) {
  const candidate *x = a, *y = b;
  return x->length < y->length   ? -1
         : x->length > y->length ? 1
                                 : (x->half_edge > y->half_edge) - (x->half_edge < y->half_edge);
}

static orb_status trace_all(base_tracer *t, candidate *order, int32_t *forest, int *good) {
  const orb_mesh *mesh = &t->base->shape.mesh;
  int32_t edges = 0;
  for (int32_t h = 0; h < 3 * mesh->triangle_count; h++) {
    if (h < t->base->twin[h]) {
      const double *a = point_of(t->on.sheet, t->at[mesh->triangles[h]]),
                   *b = point_of(t->on.sheet, t->at[mesh->triangles[orb_next(h)]]);
      order[edges++] = (candidate){orb_distance2(a, b), h};
    }
  }
  qsort(order, (size_t)edges, sizeof *order, by_length);
  orb_forest_plant(forest, mesh->vertex_count);
  for (int32_t v = 0; v < mesh->vertex_count; v++) {
    t->on.paths->on[t->at[v]] = 1;
  }
  *good = 1;
  for (int tree = 1; tree >= 0; tree--) {
    for (int32_t i = 0; i < edges && *good; i++) {
      int32_t b = order[i].half_edge, from = mesh->triangles[b], to = mesh->triangles[orb_next(b)];
      if (t->base_done[b] || (!orb_forest_join(forest, from, to) && tree)) {
        continue;
      }
      ORB_TRY(trace_one(t, b, good));
    }
  }
  return ORB_OK;
}

orb_status orb_base_trace(orb_context *ctx, orb_sheet *sheet, const orb_sheet *base, const int32_t *at,
                          orb_paths *paths, int32_t most_triangles, int64_t *work, int *good) {
  const orb_mesh *mesh = &base->shape.mesh;
  base_tracer t = {.on = {.ctx = ctx, .sheet = sheet, .paths = paths, .work = work}, .base = base, .at = at};
  t.most_triangles = most_triangles;
  candidate *order = ORB_NEW(ctx, candidate, 3 * (size_t)mesh->triangle_count);
  int32_t *forest = ORB_NEW(ctx, int32_t, mesh->vertex_count);
  orb_status status = ORB_OK;
  t.base_done = ORB_NEW0(ctx, int32_t, 3 * (size_t)mesh->triangle_count);
  if (!order || !forest || !t.base_done) {
    status = ORB_E_NO_MEMORY;
    goto end;
  }
  ORB_GO(status, orb_paths_fit(ctx, sheet, paths), end);
  ORB_GO(status, trace_all(&t, order, forest, good), end);
end:
  orb_free(ctx, order);
  orb_free(ctx, forest);
  orb_free(ctx, t.base_done);
  orb_path_tracer_free(&t.on);
  return status;
}
