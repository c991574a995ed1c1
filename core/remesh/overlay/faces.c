/* The faces of an overlay. Each edge is cut by its events into pieces; a piece has two directed sides, 2p along the
 * edge and 2p + 1 against it. At every overlay vertex the sides that leave it are sorted counter-clockwise, by exact
 * orientations of original vertices only; then the faces can be followed. Where edges of both layers coincide, so do
 * their pieces: that of layer 0 stays and remembers the half-edge of layer 1. Faces are convex (intersections of two
 * triangles) with at most six corners, none of them straight, and are cut into triangles. */
#include "remesh/overlay/faces.h"

#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "numeric/predicates.h"
#include "numeric/vec3.h"

/* A side that leaves a vertex: the vertex its edge leads to, and one strictly to the left of the edge. */
typedef struct ray {
  int32_t side, half;
  const double *to, *left;
} ray;

typedef struct graph {
  orb_overlay *overlay;
  int32_t first_piece[2]; /* of each layer */
  int32_t piece_count;
  int32_t *edge_of; /* per piece */
  int32_t *next;    /* per side: the next one around the face on its left; −1: its piece was dropped as coinciding */
  int32_t *along;   /* per side of layer 0: the half-edge of layer 1 that it coincides with; −1: none */
  ray *own, *other, *sector;
} graph;

static int32_t piece_of(const graph *g, int l, int32_t e, int32_t k) {
  return g->first_piece[l] + g->overlay->layer[l].begin[e] + e + k;
}

static int layer_of(const graph *g, int32_t side) {
  return side / 2 >= g->first_piece[1];
}

/* The half-edge that a side runs along. */
static int32_t half_of(const graph *g, int32_t side) {
  const orb_layer *layer = &g->overlay->layer[layer_of(g, side)];
  int32_t h = layer->half[g->edge_of[side / 2]];
  return side & 1 ? layer->view.twin[h] : h;
}

static int32_t origin_of(const graph *g, int32_t side) {
  int l = layer_of(g, side);
  const orb_layer *layer = &g->overlay->layer[l];
  int32_t e = g->edge_of[side / 2], h = layer->half[e];
  int32_t k = side / 2 - piece_of(g, l, e, 0) + (side & 1), events = layer->begin[e + 1] - layer->begin[e];
  if (k == 0) {
    return layer->id[layer->view.triangles[h]];
  }
  return k <= events ? layer->event_id[layer->begin[e] + k - 1] : layer->id[layer->view.triangles[orb_next(h)]];
}

static ray make_ray(const graph *g, int32_t side) {
  const orb_layer *layer = &g->overlay->layer[layer_of(g, side)];
  int32_t h = half_of(g, side);
  return (ray){side, h, layer->view.points + 3 * (int64_t)layer->view.triangles[orb_next(h)],
               layer->view.points + 3 * (int64_t)layer->view.triangles[orb_prev(h)]};
}

/* The rays of a vertex of layer l in counter-clockwise order; first: a half-edge that leaves it. */
static int32_t star(const graph *g, int l, int32_t first, ray *out) {
  const orb_layer *layer = &g->overlay->layer[l];
  int32_t n = 0, h = first;
  do {
    int32_t e = layer->edge[h], pieces = layer->begin[e + 1] - layer->begin[e] + 1;
    out[n++] = make_ray(g, h == layer->half[e] ? 2 * piece_of(g, l, e, 0) : 2 * piece_of(g, l, e, pieces - 1) + 1);
    h = layer->view.twin[orb_prev(h)];
  } while (h != first);
  return n;
}

/* The two rays of edge e of layer l at overlay vertex id, one of its events. */
static int32_t passing(const graph *g, int l, int32_t e, int32_t id, ray *out) {
  const orb_layer *layer = &g->overlay->layer[l];
  int32_t i = layer->begin[e];
  while (layer->event_id[i] != id) {
    i++;
    ORB_ASSERT(i < layer->begin[e + 1]);
  }
  int32_t k = i - layer->begin[e];
  out[0] = make_ray(g, 2 * piece_of(g, l, e, k + 1));
  out[1] = make_ray(g, 2 * piece_of(g, l, e, k) + 1);
  return 2;
}

/* `before` and `side` leave a vertex one after the other, counter-clockwise: the side opposite to `side`, which arrives
 * there, is followed by `before`. */
static void link_pair(graph *g, int32_t before, int32_t side) {
  g->next[side ^ 1] = before;
}

static void coincide(graph *g, const ray *a, const ray *b) {
  const ray *kept = layer_of(g, a->side) == 0 ? a : b, *gone = kept == a ? b : a;
  g->along[kept->side] = gone->half;
}

/* Merges two cyclic orders around x and links the result. Sectors between neighbours in `own` span at most a half
 * circle, so a ray lies in a sector if it is left of its first and right of its second side. */
static void merge_rays(graph *g, const double *x, int32_t own_count, int32_t other_count) {
  int32_t first = -1, last = -1;
  for (int32_t i = 0; i < own_count; i++) {
    const ray *p = &g->own[i], *q = &g->own[(i + 1) % own_count];
    int32_t inside = 0, side = p->side;
    for (int32_t k = 0; k < other_count; k++) {
      const ray *r = &g->other[k];
      int sign = orb_orient(x, p->to, r->to);
      if (sign == 0 && orb_orient(x, r->to, p->left) > 0) {
        coincide(g, p, r);
        side = layer_of(g, p->side) == 0 ? p->side : r->side;
      } else if (sign > 0 && orb_orient(x, r->to, q->to) > 0) {
        int32_t at = inside++;
        while (at > 0 && orb_orient(x, g->sector[at - 1].to, r->to) < 0) {
          g->sector[at] = g->sector[at - 1];
          at--;
        }
        g->sector[at] = *r;
      }
    }
    for (int32_t k = -1; k < inside; k++) {
      int32_t now = k < 0 ? side : g->sector[k].side;
      if (last >= 0) {
        link_pair(g, last, now);
      }
      first = first < 0 ? now : first;
      last = now;
    }
  }
  link_pair(g, last, first);
}

static void link_vertex(graph *g, int l, int32_t v, int32_t half) {
  const orb_layer *own = &g->overlay->layer[l], *other = &g->overlay->layer[1 - l];
  orb_spot spot = own->spot[v];
  int32_t n = star(g, l, half, g->own), m = 0;
  if (spot.kind == ORB_SPOT_VERTEX) {
    m = star(g, 1 - l, spot.h, g->other);
  } else if (spot.kind == ORB_SPOT_EDGE) {
    m = passing(g, 1 - l, other->edge[spot.h], own->id[v], g->other);
  }
  merge_rays(g, own->view.points + 3 * (int64_t)v, n, m);
}

static void link_crossing(graph *g, int32_t i) {
  const orb_overlay *overlay = g->overlay;
  int32_t id = overlay->layer[0].vertex_count + overlay->lone_count + i;
  ray a[2], b[2];
  (void)passing(g, 0, overlay->cross[2 * i], id, a);
  (void)passing(g, 1, overlay->cross[2 * i + 1], id, b);
  int forward_left = orb_orient(a[1].to, a[0].to, b[0].to) > 0;
  const int32_t ring[4] = {a[0].side, b[!forward_left].side, a[1].side, b[forward_left].side};
  for (int k = 0; k < 4; k++) {
    link_pair(g, ring[k], ring[(k + 1) % 4]);
  }
}

static int32_t *first_halves(orb_context *ctx, const orb_layer *layer, int32_t *most) {
  int32_t *half = ORB_NEW(ctx, int32_t, layer->vertex_count), *valence = ORB_NEW0(ctx, int32_t, layer->vertex_count);
  for (int32_t h = 0; half && valence && h < 3 * layer->view.triangle_count; h++) {
    half[layer->view.triangles[h]] = h;
    if (++valence[layer->view.triangles[h]] > *most) {
      *most = valence[layer->view.triangles[h]];
    }
  }
  if (!valence) {
    orb_free(ctx, half);
    half = NULL;
  }
  orb_free(ctx, valence);
  return half;
}

static orb_status link_all(orb_context *ctx, graph *g) {
  const orb_overlay *overlay = g->overlay;
  int32_t most = 4;
  int32_t *half[2] = {first_halves(ctx, &overlay->layer[0], &most), first_halves(ctx, &overlay->layer[1], &most)};
  g->own = ORB_NEW(ctx, ray, most);
  g->other = ORB_NEW(ctx, ray, most);
  g->sector = ORB_NEW(ctx, ray, most);
  orb_status status = half[0] && half[1] && g->own && g->other && g->sector ? ORB_OK : ORB_E_NO_MEMORY;
  for (int32_t v = 0; v < overlay->layer[0].vertex_count && status == ORB_OK; v++) {
    link_vertex(g, 0, v, half[0][v]);
  }
  for (int32_t i = 0; i < overlay->lone_count && status == ORB_OK; i++) {
    link_vertex(g, 1, overlay->lone[i], half[1][overlay->lone[i]]);
  }
  for (int32_t i = 0; i < overlay->crossing_count && status == ORB_OK; i++) {
    link_crossing(g, i);
  }
  orb_free(ctx, half[0]);
  orb_free(ctx, half[1]);
  return status == ORB_OK ? orb_context_check(ctx) : status;
}

/* The quality of a triangle on the sphere; negative if flipped. */
static double quality_of(const orb_overlay *overlay, int32_t a, int32_t b, int32_t c) {
  const double *p = overlay->points + 3 * (int64_t)a, *q = overlay->points + 3 * (int64_t)b,
               *r = overlay->points + 3 * (int64_t)c;
  double edges = orb_distance2(p, q) + orb_distance2(q, r) + orb_distance2(r, p);
  double quality = edges > 0 ? orb_det(p, q, r) / edges : 0;
  return orb_orient(p, q, r) > 0 ? quality : quality - 1;
}

static void emit(orb_overlay *overlay, int32_t a, int32_t b, int32_t c, const int32_t parent[2]) {
  int64_t t = overlay->triangle_count++;
  overlay->triangles[3 * t] = a;
  overlay->triangles[3 * t + 1] = b;
  overlay->triangles[3 * t + 2] = c;
  overlay->parent[2 * t] = parent[0];
  overlay->parent[2 * t + 1] = parent[1];
}

/* Cuts a convex face into triangles: four corners by the better diagonal, more by the best ear first. */
static void cut_face(orb_overlay *overlay, int32_t *corner, int n, const int32_t parent[2]) {
  while (n > 3) {
    int best = 0;
    double best_value = -4;
    for (int i = 0; i < n; i++) {
      int32_t a = corner[(i + n - 1) % n], b = corner[i], c = corner[(i + 1) % n];
      double value = quality_of(overlay, a, b, c);
      if (n == 4) {
        double rest = quality_of(overlay, a, c, corner[(i + 2) % n]);
        value = rest < value ? rest : value;
      }
      if (value > best_value) {
        best_value = value;
        best = i;
      }
    }
    emit(overlay, corner[(best + n - 1) % n], corner[best], corner[(best + 1) % n], parent);
    memmove(corner + best, corner + best + 1, (size_t)(n - best - 1) * sizeof *corner);
    n--;
  }
  emit(overlay, corner[0], corner[1], corner[2], parent);
}

/* Where a corner, a vertex of the other layer, lies in layer l. */
static orb_spot corner_spot(const orb_overlay *overlay, int l, int32_t id) {
  if (l == 1) {
    return overlay->layer[0].spot[id];
  }
  if (id >= overlay->layer[0].vertex_count) {
    return overlay->layer[1].spot[overlay->lone[id - overlay->layer[0].vertex_count]];
  }
  const orb_place *place = &overlay->places[id]; /* a vertex of both layers */
  return (orb_spot){3 * place->triangle + (place->at[1] == 1 ? 1 : place->at[2] == 1 ? 2 : 0), ORB_SPOT_VERTEX};
}

static int holds(const orb_overlay *overlay, int l, int32_t t, const int32_t *corner, int n) {
  const orb_layer *layer = &overlay->layer[l];
  for (int i = 0; i < n; i++) {
    for (int k = 0; k < 3; k++) {
      const double *a = layer->view.points + 3 * (int64_t)layer->view.triangles[3 * t + k];
      const double *b = layer->view.points + 3 * (int64_t)layer->view.triangles[3 * t + (k + 1) % 3];
      if (orb_orient(a, b, overlay->points + 3 * (int64_t)corner[i]) < 0) {
        return 0;
      }
    }
  }
  return 1;
}

/* The triangle of layer l that holds a face without a side of layer l; the face may touch its border at corners. All
 * corners are vertices of the other layer, so their points are exact. */
static int32_t parent_of_corners(const orb_overlay *overlay, int l, const int32_t *corner, int n) {
  orb_spot spot = corner_spot(overlay, l, corner[0]);
  for (int i = 1; i < n && spot.kind != ORB_SPOT_FACE; i++) {
    spot = corner_spot(overlay, l, corner[i]);
  }
  const int32_t *twin = overlay->layer[l].view.twin;
  int32_t h = spot.h;
  while (spot.kind != ORB_SPOT_FACE && !holds(overlay, l, h / 3, corner, n)) {
    h = spot.kind == ORB_SPOT_EDGE ? twin[h] : twin[orb_prev(h)];
    ORB_ASSERT(h != spot.h);
  }
  return h / 3;
}

enum { MAX_CORNERS = 6 }; /* of the intersection of two triangles */

static orb_status follow_faces(orb_context *ctx, graph *g) {
  orb_overlay *overlay = g->overlay;
  int64_t most = 2 * (int64_t)overlay->vertex_count - 4;
  unsigned char *done = ORB_NEW0(ctx, unsigned char, 2 * (int64_t)g->piece_count);
  overlay->triangles = ORB_NEW(ctx, int32_t, 3 * most);
  overlay->parent = ORB_NEW(ctx, int32_t, 2 * most);
  orb_status status = done && overlay->triangles && overlay->parent ? ORB_OK : ORB_E_NO_MEMORY;
  for (int32_t first = 0; first < 2 * g->piece_count && status == ORB_OK; first++) {
    if (done[first] || g->next[first] < 0) {
      continue;
    }
    int32_t corner[MAX_CORNERS], parent[2] = {-1, -1};
    int n = 0;
    for (int32_t side = first; !done[side]; side = g->next[side]) {
      ORB_ASSERT(n < MAX_CORNERS);
      done[side] = 1;
      corner[n++] = origin_of(g, side);
      parent[layer_of(g, side)] = half_of(g, side) / 3;
      if (layer_of(g, side) == 0 && g->along[side] >= 0) {
        parent[1] = g->along[side] / 3;
      }
    }
    for (int l = 0; l < 2; l++) {
      parent[l] = parent[l] >= 0 ? parent[l] : parent_of_corners(overlay, l, corner, n);
    }
    ORB_ASSERT(n >= 3 && overlay->triangle_count + n - 2 <= most);
    cut_face(overlay, corner, n, parent);
  }
  orb_free(ctx, done);
  if (status == ORB_OK) {
    ORB_ASSERT(overlay->triangle_count == most); /* Euler */
  }
  return status;
}

orb_status orb_overlay_faces(orb_context *ctx, orb_overlay *overlay) {
  graph g = {.overlay = overlay};
  int32_t edges[2];
  for (int l = 0; l < 2; l++) {
    edges[l] = 3 * overlay->layer[l].view.triangle_count / 2;
    g.first_piece[l] = g.piece_count;
    g.piece_count += edges[l] + overlay->layer[l].begin[edges[l]];
  }
  g.edge_of = ORB_NEW(ctx, int32_t, g.piece_count);
  g.next = ORB_NEW(ctx, int32_t, 2 * (int64_t)g.piece_count);
  g.along = ORB_NEW(ctx, int32_t, 2 * (int64_t)g.first_piece[1]);
  orb_status status = g.edge_of && g.next && g.along ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    memset(g.next, -1, 2 * (size_t)g.piece_count * sizeof *g.next);
    memset(g.along, -1, 2 * (size_t)g.first_piece[1] * sizeof *g.along);
    for (int l = 0; l < 2; l++) {
      for (int32_t e = 0; e < edges[l]; e++) {
        for (int32_t p = piece_of(&g, l, e, 0); p < piece_of(&g, l, e + 1, 0); p++) {
          g.edge_of[p] = e;
        }
      }
    }
    status = link_all(ctx, &g);
  }
  if (status == ORB_OK) {
    status = follow_faces(ctx, &g);
  }
  orb_free(ctx, g.edge_of);
  orb_free(ctx, g.next);
  orb_free(ctx, g.along);
  orb_free(ctx, g.own);
  orb_free(ctx, g.other);
  orb_free(ctx, g.sector);
  return status;
}
