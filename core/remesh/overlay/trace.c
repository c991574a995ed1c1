/* The vertices of an overlay: every edge of each layer is traced through the other one, so that each edge knows in
 * order what it meets. Both traces decide by the same exact orientations, so they find the same crossings; a crossing
 * is numbered by the edge of layer 0 and found again from that of layer 1. Two edges, both shorter than a half circle,
 * cross at most once. */
#include "remesh/overlay/trace.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/error.h"
#include "base/memory.h"
#include "base/parallel.h"
#include "numeric/vec3.h"

enum { GRAIN = 512 }; /* vertices or edges a thread takes at a time */

typedef struct layer_loop {
  orb_overlay *overlay;
  int l;    /* which layer */
  int fill; /* 0: count the events of each edge, 1: store them */
} layer_loop;

static void spot_range(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  const layer_loop *loop = arg;
  orb_layer *own = &loop->overlay->layer[loop->l], *other = &loop->overlay->layer[1 - loop->l];
  orb_place *places = loop->overlay->places; /* at this stage: of this layer's vertices on the other */
  for (int64_t v = begin; v < end; v++) {
    const double *p = own->view.points + 3 * v;
    orb_locate(other->locator, p, -1, &places[v]);
    orb_hit hit = orb_walk(&other->view, p, places[v].triangle);
    own->spot[v] = orb_spot_of(&hit);
  }
}

static void trace_range(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  const layer_loop *loop = arg;
  orb_layer *own = &loop->overlay->layer[loop->l], *other = &loop->overlay->layer[1 - loop->l];
  for (int64_t e = begin; e < end; e++) {
    int32_t h = own->half[e], v = own->view.triangles[h], w = own->view.triangles[orb_next(h)], n = 0;
    orb_arc_tracer tracer;
    orb_crossing crossing;
    orb_trace_between(&tracer, &other->view, own->spot[v], own->view.points + 3 * (int64_t)v, own->spot[w],
                      own->view.points + 3 * (int64_t)w);
    while (orb_trace_next(&tracer, &crossing)) {
      if (loop->fill) {
        own->event[own->begin[e] + n] = crossing;
      }
      n++;
    }
    if (!loop->fill) {
      own->begin[e + 1] = n;
    }
  }
}

static orb_status prepare_layer(orb_context *ctx, orb_layer *layer) {
  int32_t half_edges = 3 * layer->view.triangle_count, edges = 0;
  layer->spot = ORB_NEW(ctx, orb_spot, layer->vertex_count);
  layer->id = ORB_NEW(ctx, int32_t, layer->vertex_count);
  layer->edge = ORB_NEW(ctx, int32_t, half_edges);
  layer->half = ORB_NEW(ctx, int32_t, half_edges / 2);
  layer->begin = ORB_NEW0(ctx, int32_t, half_edges / 2 + 1);
  if (!layer->spot || !layer->id || !layer->edge || !layer->half || !layer->begin) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t h = 0; h < half_edges; h++) {
    if (h < layer->view.twin[h]) {
      layer->half[edges] = h;
      layer->edge[h] = layer->edge[layer->view.twin[h]] = edges++;
    }
  }
  return ORB_OK;
}

static orb_status trace_layer(orb_context *ctx, orb_overlay *overlay, int l) {
  orb_layer *layer = &overlay->layer[l];
  int32_t edges = 3 * layer->view.triangle_count / 2;
  layer_loop loop = {overlay, l, 0};
  orb_parallel_for(ctx, edges, GRAIN, trace_range, &loop);
  ORB_TRY(orb_context_check(ctx));
  int64_t total = 0;
  for (int32_t e = 0; e < edges; e++) {
    total += layer->begin[e + 1];
    if (total > INT32_MAX / 16) {
      return orb_fail(ctx, ORB_E_TOO_LARGE, "The overlay of these shapes has too many crossings; use 'adaptive'.");
    }
    layer->begin[e + 1] = (int32_t)total;
  }
  layer->event = ORB_NEW(ctx, orb_crossing, total);
  layer->event_id = ORB_NEW(ctx, int32_t, total);
  if (!layer->event || !layer->event_id) {
    return ORB_E_NO_MEMORY;
  }
  loop.fill = 1;
  orb_parallel_for(ctx, edges, GRAIN, trace_range, &loop);
  return orb_context_check(ctx);
}

static orb_status number_vertices(orb_context *ctx, orb_overlay *overlay) {
  orb_layer *a = &overlay->layer[0], *b = &overlay->layer[1];
  overlay->lone = ORB_NEW(ctx, int32_t, b->vertex_count);
  overlay->cross = ORB_NEW(ctx, int32_t, 2 * (int64_t)a->begin[3 * a->view.triangle_count / 2]);
  if (!overlay->lone || !overlay->cross) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t v = 0; v < a->vertex_count; v++) {
    a->id[v] = v;
  }
  int32_t n = a->vertex_count;
  for (int32_t v = 0; v < b->vertex_count; v++) {
    if (b->spot[v].kind == ORB_SPOT_VERTEX) {
      b->id[v] = a->view.triangles[b->spot[v].h];
    } else {
      overlay->lone[overlay->lone_count++] = v;
      b->id[v] = n++;
    }
  }
  for (int32_t e = 0; e < 3 * a->view.triangle_count / 2; e++) {
    for (int32_t i = a->begin[e]; i < a->begin[e + 1]; i++) {
      if (a->event[i].at_vertex) {
        a->event_id[i] = b->id[b->view.triangles[a->event[i].h]];
      } else {
        overlay->cross[2 * overlay->crossing_count] = e;
        overlay->cross[2 * overlay->crossing_count++ + 1] = b->edge[a->event[i].h];
        a->event_id[i] = n++;
      }
    }
  }
  overlay->vertex_count = n;
  for (int32_t e = 0; e < 3 * b->view.triangle_count / 2; e++) {
    for (int32_t i = b->begin[e]; i < b->begin[e + 1]; i++) {
      b->event_id[i] = -1;
      if (b->event[i].at_vertex) {
        b->event_id[i] = a->view.triangles[b->event[i].h];
        continue;
      }
      int32_t ea = a->edge[b->event[i].h];
      for (int32_t k = a->begin[ea]; k < a->begin[ea + 1] && b->event_id[i] < 0; k++) {
        if (!a->event[k].at_vertex && b->edge[a->event[k].h] == e) {
          b->event_id[i] = a->event_id[k];
        }
      }
      ORB_ASSERT(b->event_id[i] >= 0); /* both traces name the same crossings */
    }
  }
  return ORB_OK;
}

static void place_on_edge(const orb_layer *layer, int32_t edge, double t, orb_place *out) {
  int32_t h = layer->half[edge];
  *out = (orb_place){h / 3, {0, 0, 0}};
  out->at[h % 3] = 1 - t;
  out->at[orb_next(h) % 3] = t;
}

static void corner_place(int32_t h, orb_place *out) {
  *out = (orb_place){h / 3, {0, 0, 0}};
  out->at[h % 3] = 1;
}

/* The parameter along the chord of edge e of `layer` at which the plane of edge f of `other` cuts it. */
static double cut(const orb_layer *layer, int32_t e, const orb_layer *other, int32_t f) {
  const double *end[4];
  int32_t h[2] = {layer->half[e], other->half[f]};
  for (int k = 0; k < 2; k++) {
    end[k] = layer->view.points + 3 * (int64_t)layer->view.triangles[k ? orb_next(h[0]) : h[0]];
    end[2 + k] = other->view.points + 3 * (int64_t)other->view.triangles[k ? orb_next(h[1]) : h[1]];
  }
  double from = fabs(orb_det(end[2], end[3], end[0])), to = fabs(orb_det(end[2], end[3], end[1]));
  double sum = from + to;
  return sum > 0 ? from / sum : 0.5;
}

/* The parameter along the chord of edge e of `layer` of the point p, which lies on the edge up to rounding. The cut of
 * nearly parallel edges is ill-conditioned, but the place of a given point on an edge is not. */
static double foot(const orb_layer *layer, int32_t e, const double p[3]) {
  double weight[2];
  for (int k = 0; k < 2; k++) {
    const double *end =
        layer->view.points + 3 * (int64_t)layer->view.triangles[k ? orb_next(layer->half[e]) : layer->half[e]];
    double d[3], n[3];
    orb_sub(p, end, d);
    orb_cross(end, d, n);
    weight[k] = orb_length(n);
  }
  double sum = weight[0] + weight[1];
  return sum > 0 ? weight[0] / sum : 0.5;
}

static void place_crossing(orb_overlay *overlay, int32_t i) {
  const orb_layer *a = &overlay->layer[0], *b = &overlay->layer[1];
  int32_t ea = overlay->cross[2 * i], eb = overlay->cross[2 * i + 1];
  int64_t v = (int64_t)a->vertex_count + overlay->lone_count + i;
  double t = cut(a, ea, b, eb), *p = overlay->points + 3 * v;
  const double *from = a->view.points + 3 * (int64_t)a->view.triangles[a->half[ea]];
  const double *to = a->view.points + 3 * (int64_t)a->view.triangles[orb_next(a->half[ea])];
  for (int k = 0; k < 3; k++) {
    p[k] = (1 - t) * from[k] + t * to[k];
  }
  (void)orb_normalize(p);
  place_on_edge(a, ea, t, &overlay->places[v]);
  place_on_edge(b, eb, foot(b, eb, p), &overlay->places[overlay->vertex_count + v]);
}

static orb_status place_vertices(orb_context *ctx, orb_overlay *overlay, orb_place *const on_other[2]) {
  orb_layer *a = &overlay->layer[0], *b = &overlay->layer[1];
  int64_t n = overlay->vertex_count;
  overlay->points = ORB_NEW(ctx, double, 3 * n);
  overlay->places = ORB_NEW(ctx, orb_place, 2 * n);
  if (!overlay->points || !overlay->places) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t h = 3 * a->view.triangle_count - 1; h >= 0; h--) {
    corner_place(h, &overlay->places[a->view.triangles[h]]);
  }
  for (int32_t h = 3 * b->view.triangle_count - 1; h >= 0; h--) {
    corner_place(h, &overlay->places[n + b->id[b->view.triangles[h]]]);
  }
  memcpy(overlay->points, a->view.points, 3 * (size_t)a->vertex_count * sizeof(double));
  for (int32_t v = 0; v < a->vertex_count; v++) {
    if (a->spot[v].kind != ORB_SPOT_VERTEX) {
      overlay->places[n + v] = on_other[0][v];
    }
  }
  for (int32_t i = 0; i < overlay->lone_count; i++) {
    int32_t v = overlay->lone[i], id = b->id[v];
    memcpy(overlay->points + 3 * (int64_t)id, b->view.points + 3 * (int64_t)v, 3 * sizeof(double));
    overlay->places[id] = on_other[1][v];
  }
  for (int32_t i = 0; i < overlay->crossing_count; i++) {
    place_crossing(overlay, i);
  }
  return ORB_OK;
}

orb_status orb_overlay_trace(orb_context *ctx, orb_overlay *overlay) {
  orb_place *on_other[2] = {NULL, NULL};
  orb_status status = ORB_OK;
  for (int l = 0; l < 2; l++) {
    ORB_GO(status, prepare_layer(ctx, &overlay->layer[l]), end);
    on_other[l] = ORB_NEW(ctx, orb_place, overlay->layer[l].vertex_count);
    status = on_other[l] ? ORB_OK : ORB_E_NO_MEMORY;
    if (status != ORB_OK) {
      goto end;
    }
  }
  for (int l = 0; l < 2; l++) {
    layer_loop loop = {overlay, l, 0};
    overlay->places = on_other[l];
    orb_parallel_for(ctx, overlay->layer[l].vertex_count, GRAIN, spot_range, &loop);
    overlay->places = NULL;
    ORB_GO(status, orb_context_check(ctx), end);
  }
  for (int l = 0; l < 2; l++) {
    ORB_GO(status, trace_layer(ctx, overlay, l), end);
  }
  ORB_GO(status, number_vertices(ctx, overlay), end);
  ORB_GO(status, place_vertices(ctx, overlay, on_other), end);
end:
  orb_free(ctx, on_other[0]);
  orb_free(ctx, on_other[1]);
  return status;
}
