#include "remesh/placed/placed_net.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/error.h"
#include "base/grow.h"
#include "base/loops.h"
#include "base/memory.h"
#include "mesh/normals.h"
#include "numeric/predicates.h"
#include "numeric/vec3.h"
#include "sphere/locate.h"

/* Vertices a thread locates at a time, and vertices between two checks for cancellation: larger ones cost less
 * overhead, smaller ones balance threads better and cancel sooner. */
enum { GRAIN = 512, SLICE = 8192 };
enum { CHECK_EVERY = 4096 }; /* items between two checks where one thread works; a power of two */

const double *orb_placed_item_point(const orb_placed_net *placed, int32_t item) {
  int32_t s = placed->item_shape[item];
  return placed->view[s].points + 3 * (int64_t)(item - placed->item_begin[s]);
}

const double *orb_placed_item_position(const orb_placed_net *placed, int32_t item) {
  int32_t s = placed->item_shape[item];
  return placed->position[s] + 3 * (int64_t)(item - placed->item_begin[s]);
}

void orb_placed_free(orb_context *ctx, orb_placed_net *placed) {
  for (int32_t s = 0; s < placed->shape_count && placed->position; s++) {
    orb_free(ctx, placed->position[s]);
  }
  for (int32_t s = 0; s < placed->shape_count && placed->vertex_normal; s++) {
    orb_free(ctx, placed->vertex_normal[s]);
  }
  for (int32_t s = 0; s < placed->shape_count && placed->pack; s++) {
    orb_free(ctx, placed->pack[s].step);
    orb_free(ctx, placed->pack[s].vertex);
  }
  orb_free(ctx, placed->pack);
  orb_free(ctx, placed->position);
  orb_free(ctx, placed->vertex_normal);
  orb_free(ctx, placed->view);
  orb_free(ctx, placed->at);
  orb_free(ctx, placed->normal);
  orb_free(ctx, placed->spot);
  orb_free(ctx, placed->fixed);
  orb_free(ctx, placed->no_move);
  orb_free(ctx, placed->no_collapse);
  orb_free(ctx, placed->no_repair);
  orb_free(ctx, placed->not_inverted);
  orb_free(ctx, placed->within);
  orb_free(ctx, placed->item_begin);
  orb_free(ctx, placed->item_next);
  orb_free(ctx, placed->item_shape);
  orb_free(ctx, placed->vertex_items);
  orb_free(ctx, placed->triangle_items);
  orb_free(ctx, placed->kept_first);
  orb_free(ctx, placed->kept_to);
  orb_free(ctx, placed->kept_next);
  orb_net_free(ctx, &placed->net);
  memset(placed, 0, sizeof *placed);
}

/* Room for the kept edges of n vertices: each that splits one needs two entries. */
static orb_status reserve_kept(orb_context *ctx, orb_placed_net *placed, size_t n, size_t before) {
  const size_t entries = (size_t)placed->kept_given + 2 * n;
  if (!orb_regrow(ctx, &placed->kept_first, n, sizeof(int32_t)) ||
      !orb_regrow(ctx, &placed->kept_to, entries, sizeof(int32_t)) ||
      !orb_regrow(ctx, &placed->kept_next, entries, sizeof(int32_t))) {
    return ORB_E_NO_MEMORY;
  }
  memset(placed->kept_first + before, -1, (n - before) * sizeof(int32_t));
  return ORB_OK;
}

static void keep_from(orb_placed_net *placed, int32_t v, int32_t w) {
  placed->kept_to[placed->kept_count] = w;
  placed->kept_next[placed->kept_count] = placed->kept_first[v];
  placed->kept_first[v] = placed->kept_count++;
}

orb_status orb_placed_keep(orb_context *ctx, orb_placed_net *placed, const int32_t (*ends)[2], int64_t count) {
  placed->kept_given = (int32_t)(2 * count);
  ORB_TRY(reserve_kept(ctx, placed, (size_t)placed->capacity, 0));
  for (int64_t i = 0; i < count; i++) {
    keep_from(placed, ends[i][0], ends[i][1]);
    keep_from(placed, ends[i][1], ends[i][0]);
  }
  return ORB_OK;
}

/* The entry of v's list that says w, −1. */
static int32_t kept_entry(const orb_placed_net *placed, int32_t v, int32_t w) {
  int32_t i = placed->kept_first ? placed->kept_first[v] : -1;
  while (i >= 0 && placed->kept_to[i] != w) {
    i = placed->kept_next[i];
  }
  return i;
}

int orb_placed_keeps(const orb_placed_net *placed, int32_t h) {
  return kept_entry(placed, placed->net.triangles[h], placed->net.triangles[placed->net.twin[h]]) >= 0;
}

/* n has split the edge of a and b. */
static void keep_halves(orb_placed_net *placed, int32_t a, int32_t b, int32_t n) {
  const int32_t forth = kept_entry(placed, a, b), back = kept_entry(placed, b, a);
  if (forth >= 0 && back >= 0) {
    placed->kept_to[forth] = placed->kept_to[back] = n;
    keep_from(placed, n, a);
    keep_from(placed, n, b);
  }
}

orb_status orb_placed_reserve(orb_context *ctx, orb_placed_net *placed, int64_t more) {
  if (placed->net.vertex_count + more <= placed->capacity) {
    return ORB_OK;
  }
  ORB_TRY(orb_net_reserve(ctx, &placed->net, more));
  size_t n = (size_t)placed->net.vertex_capacity, cells = n * (size_t)placed->shape_count;
  if (!orb_regrow(ctx, &placed->at, 3 * cells, sizeof(double)) ||
      !orb_regrow(ctx, &placed->normal, 3 * cells, sizeof(double)) ||
      !orb_regrow(ctx, &placed->spot, cells, sizeof(orb_spot)) || !orb_regrow(ctx, &placed->fixed, n, 1) ||
      !orb_regrow(ctx, &placed->no_move, n, sizeof(uint64_t)) ||
      !orb_regrow(ctx, &placed->no_collapse, n, sizeof(uint64_t)) ||
      !orb_regrow(ctx, &placed->no_repair, 4 * n, sizeof(uint64_t)) ||
      !orb_regrow(ctx, &placed->not_inverted, 2 * n, sizeof(uint64_t)) ||
      !orb_regrow(ctx, &placed->within, 6 * n, sizeof(uint64_t)) ||
      !orb_regrow(ctx, &placed->vertex_items, n, sizeof(int32_t)) ||
      !orb_regrow(ctx, &placed->triangle_items, 2 * n, sizeof(int32_t))) {
    return ORB_E_NO_MEMORY;
  }
  for (size_t i = (size_t)placed->capacity; i < n; i++) {
    placed->fixed[i] = 0;
    placed->no_move[i] = placed->no_collapse[i] = 0;
    placed->vertex_items[i] = -1;
    placed->triangle_items[2 * i] = placed->triangle_items[2 * i + 1] = -1;
    memset(placed->no_repair + 4 * i, 0, 4 * sizeof *placed->no_repair);
    placed->not_inverted[2 * i] = placed->not_inverted[2 * i + 1] = 0;
    memset(placed->within + 6 * i, 0, 6 * sizeof *placed->within);
  }
  if (placed->kept_first) {
    ORB_TRY(reserve_kept(ctx, placed, n, (size_t)placed->capacity));
  }
  placed->capacity = (int32_t)n;
  return ORB_OK;
}

static orb_status pack_shape(orb_context *ctx, const orb_sphere_view *view, const double *position,
                             int32_t vertex_count, orb_pack *out) {
  int64_t half_edges = 3 * (int64_t)view->triangle_count;
  out->step = ORB_NEW(ctx, orb_pack_step, half_edges);
  out->vertex = ORB_NEW(ctx, orb_pack_vertex, vertex_count);
  if (!out->step || !out->vertex) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t h = 0; h < half_edges; h++) {
    out->step[h] = (orb_pack_step){view->triangles[orb_prev(h)], {view->twin[orb_next(h)], view->twin[orb_prev(h)]}, 0};
  }
  for (int64_t v = 0; v < vertex_count; v++) {
    memcpy(out->vertex[v].point, view->points + 3 * v, sizeof out->vertex[v].point);
    memcpy(out->vertex[v].position, position + 3 * v, sizeof out->vertex[v].position);
  }
  return orb_context_check(ctx);
}

static orb_status take_shapes(orb_context *ctx, orb_placed_net *placed) {
  const orb_remesh_job *job = placed->job;
  int32_t shapes = placed->shape_count = job->shape_count;
  placed->position = ORB_NEW0(ctx, double *, shapes);
  placed->vertex_normal = ORB_NEW0(ctx, double *, shapes);
  placed->view = ORB_NEW(ctx, orb_sphere_view, shapes);
  placed->pack = ORB_NEW0(ctx, orb_pack, shapes);
  placed->item_begin = ORB_NEW0(ctx, int32_t, shapes + 1);
  if (!placed->position || !placed->vertex_normal || !placed->view || !placed->pack || !placed->item_begin) {
    return ORB_E_NO_MEMORY;
  }
  int64_t items = 0;
  for (int32_t s = 0; s < shapes; s++) {
    const orb_mesh *mesh = &job->shapes[s].mesh;
    placed->view[s] = (orb_sphere_view){job->shapes[s].points, mesh->triangles, job->twin[s], mesh->triangle_count};
    items += mesh->vertex_count;
    if (items > INT32_MAX / 8) {
      return orb_fail(ctx, ORB_E_TOO_LARGE, "The shapes have too many vertices together.");
    }
    placed->item_begin[s + 1] = (int32_t)items;
    placed->position[s] = ORB_NEW(ctx, double, 3 * (int64_t)mesh->vertex_count);
    placed->vertex_normal[s] = ORB_NEW(ctx, double, 3 * (int64_t)mesh->vertex_count);
    if (!placed->position[s] || !placed->vertex_normal[s]) {
      return ORB_E_NO_MEMORY;
    }
    ORB_TRY(orb_smooth_normals(ctx, mesh->positions, mesh->vertex_count, mesh->triangles, mesh->triangle_count,
                               placed->vertex_normal[s]));
    double scale = job->diagonal[s] > 0 ? 1 / job->diagonal[s] : 1;
    for (int64_t i = 0; i < 3 * (int64_t)mesh->vertex_count; i++) {
      placed->position[s][i] = mesh->positions[i] * scale;
    }
    ORB_TRY(pack_shape(ctx, &placed->view[s], placed->position[s], mesh->vertex_count, &placed->pack[s]));
  }
  placed->item_next = ORB_NEW(ctx, int32_t, items);
  placed->item_shape = ORB_NEW(ctx, int32_t, items);
  if (!placed->item_next || !placed->item_shape) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t s = 0; s < shapes; s++) {
    for (int32_t i = placed->item_begin[s]; i < placed->item_begin[s + 1]; i++) {
      placed->item_shape[i] = s;
      placed->item_next[i] = -1;
    }
  }
  return ORB_OK;
}

static void put_item_at(orb_placed_net *placed, int32_t item, int32_t v) {
  placed->item_next[item] = placed->vertex_items[v];
  placed->vertex_items[v] = item;
}

void orb_placed_locate(orb_placed_net *placed, int32_t v, int32_t s, int32_t hint) {
  const double *p = orb_net_point(&placed->net, v);
  int64_t cell = (int64_t)v * placed->shape_count + s;
  orb_place place = {.triangle = hint};
  if (hint >= 0 && orb_pack_locate(&placed->pack[s], &placed->view[s], p, &place)) {
    placed->spot[cell] = (orb_spot){3 * place.triangle, ORB_SPOT_FACE};
  } else {
    orb_hit hit = orb_locate_hit(placed->job->locator[s], p, hint, &place);
    placed->spot[cell] = orb_spot_of(&hit);
  }
  double *at = placed->at + 3 * cell, *normal = placed->normal + 3 * cell;
  at[0] = at[1] = at[2] = normal[0] = normal[1] = normal[2] = 0;
  for (int k = 0; k < 3; k++) {
    int64_t corner = placed->view[s].triangles[3 * (int64_t)place.triangle + k];
    const double *x = placed->pack[s].vertex[corner].position, *n = placed->vertex_normal[s] + 3 * corner;
    for (int j = 0; j < 3; j++) {
      at[j] += place.at[k] * x[j];
      normal[j] += place.at[k] * n[j];
    }
  }
  (void)orb_normalize(normal);
}

void orb_placed_copy_vertex(orb_placed_net *placed, int32_t to, int32_t from) {
  int64_t shapes = placed->shape_count;
  if (to == from) {
    return;
  }
  memcpy(placed->net.points + 3 * (int64_t)to, placed->net.points + 3 * (int64_t)from, 3 * sizeof(double));
  memcpy(placed->at + 3 * to * shapes, placed->at + 3 * from * shapes, 3 * (size_t)shapes * sizeof(double));
  memcpy(placed->normal + 3 * to * shapes, placed->normal + 3 * from * shapes, 3 * (size_t)shapes * sizeof(double));
  memcpy(placed->spot + to * shapes, placed->spot + from * shapes, (size_t)shapes * sizeof(orb_spot));
}

/* Successive vertices mostly lie near each other. Where fewer than about 50 triangles of mean size would fit into the
 * square of their distance, the previous vertex is a better start than the locator's cell. */
static void locate_range(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  orb_placed_net *placed = arg;
  for (int64_t v = begin; v < end; v++) {
    const double *p = placed->net.points + 3 * v;
    double apart2 = v > begin ? orb_distance2(p, p - 3) : INFINITY;
    for (int32_t s = 0; s < placed->shape_count; s++) {
      int near = apart2 * placed->view[s].triangle_count < 50;
      orb_placed_locate(placed, (int32_t)v, s, near ? placed->spot[(v - 1) * placed->shape_count + s].h / 3 : -1);
    }
  }
}

static void fix_landmarks(orb_placed_net *placed) {
  const orb_remesh_job *job = placed->job;
  for (int32_t v = 0; v < placed->net.vertex_count; v++) {
    for (int32_t i = placed->vertex_items[v]; i >= 0 && !placed->fixed[v]; i = placed->item_next[i]) {
      const int32_t *landmarks = job->shapes[placed->item_shape[i]].landmark_vertices;
      for (int32_t l = 0; landmarks && l < job->landmark_count; l++) {
        placed->fixed[v] |= landmarks[l] == i - placed->item_begin[placed->item_shape[i]];
      }
    }
  }
}

orb_status orb_placed_create(orb_context *ctx, const orb_remesh_job *job, orb_placed_net *placed) {
  memset(placed, 0, sizeof *placed);
  placed->job = job;
  orb_status status;
  ORB_GO(status, take_shapes(ctx, placed), fail);
  int32_t base = 0;
  for (int32_t s = 1; s < placed->shape_count; s++) {
    base = job->shapes[s].mesh.triangle_count > job->shapes[base].mesh.triangle_count ? s : base;
  }
  const orb_aligned_shape *shape = &job->shapes[base];
  int64_t items = placed->item_begin[placed->shape_count];
  ORB_GO(status,
         orb_net_init(ctx, &placed->net, shape->points, shape->mesh.vertex_count, shape->mesh.triangles,
                      shape->mesh.triangle_count, job->twin[base], items + items / 4),
         fail);
  ORB_GO(status, orb_placed_reserve(ctx, placed, items - placed->net.vertex_count), fail);
  for (int32_t v = 0; v < shape->mesh.vertex_count; v++) {
    put_item_at(placed, placed->item_begin[base] + v, v);
  }
  for (int32_t s = 0; s < placed->shape_count; s++) {
    for (int32_t v = 0; v < job->shapes[s].mesh.vertex_count && s != base; v++) {
      const double *p = job->shapes[s].points + 3 * (int64_t)v;
      orb_place near;
      orb_locate(job->locator[base], p, -1, &near);
      put_item_at(placed, placed->item_begin[s] + v, orb_net_insert(&placed->net, p, &near.triangle));
      if (v % CHECK_EVERY == 0) {
        ORB_GO(status, orb_context_check(ctx), fail);
      }
    }
  }
  fix_landmarks(placed);
  return orb_sliced_by(ctx, placed->net.vertex_count, SLICE, GRAIN, locate_range, placed);
fail:
  orb_placed_free(ctx, placed);
  return status;
}

void orb_placed_assign(orb_placed_net *placed, int32_t list, int32_t start) {
  orb_sphere_view view = orb_net_view(&placed->net);
  while (list >= 0) {
    int32_t item = list;
    list = placed->item_next[item];
    orb_hit hit = orb_walk(&view, orb_placed_item_point(placed, item), start);
    placed->item_next[item] = placed->triangle_items[hit.triangle];
    placed->triangle_items[hit.triangle] = item;
  }
}

void orb_placed_assign_among(orb_placed_net *placed, int32_t list, const int32_t *triangles, int count) {
  const orb_net *net = &placed->net;
  while (list >= 0) {
    int32_t item = list;
    const double *x = orb_placed_item_point(placed, item);
    int at = -1;
    for (int i = 0; i < count && at < 0; i++) {
      const int32_t *c = net->triangles + 3 * (int64_t)triangles[i];
      const double *p = orb_net_point(net, c[0]), *q = orb_net_point(net, c[1]), *r = orb_net_point(net, c[2]);
      at = orb_orient(p, q, x) >= 0 && orb_orient(q, r, x) >= 0 && orb_orient(r, p, x) >= 0 ? i : -1;
    }
    ORB_ASSERT(at >= 0);
    list = placed->item_next[item];
    placed->item_next[item] = placed->triangle_items[triangles[at]];
    placed->triangle_items[triangles[at]] = item;
  }
}

typedef struct item_loop {
  const orb_placed_net *placed;
  const orb_locator *locator; /* of the net */
  int32_t *at;                /* per item: the half-edge that leaves its vertex, or minus its triangle, less 1 */
} item_loop;

static void item_range(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  item_loop *loop = arg;
  for (int64_t i = begin; i < end; i++) {
    orb_place place;
    orb_hit hit = orb_locate_hit(loop->locator, orb_placed_item_point(loop->placed, (int32_t)i), -1, &place);
    int corner = orb_hit_corner(&hit);
    loop->at[i] = corner >= 0 ? 3 * hit.triangle + corner : -1 - hit.triangle;
  }
}

/* Lists every item at the net vertex or triangle that holds it. */
static orb_status place_items(orb_context *ctx, orb_placed_net *placed, const orb_locator *locator) {
  int32_t items = placed->item_begin[placed->shape_count];
  item_loop loop = {placed, locator, ORB_NEW(ctx, int32_t, items)};
  orb_status status = loop.at ? orb_sliced_by(ctx, items, SLICE, GRAIN, item_range, &loop) : ORB_E_NO_MEMORY;
  for (int32_t i = 0; i < items && status == ORB_OK; i++) {
    if (loop.at[i] >= 0) {
      put_item_at(placed, i, placed->net.triangles[loop.at[i]]);
    } else {
      int32_t *list = &placed->triangle_items[-1 - loop.at[i]];
      placed->item_next[i] = *list;
      *list = i;
    }
  }
  orb_free(ctx, loop.at);
  return status;
}

orb_status orb_placed_create_on(orb_context *ctx, const orb_remesh_job *job, const orb_net *net,
                                orb_placed_net *placed) {
  memset(placed, 0, sizeof *placed);
  placed->job = job;
  orb_status status;
  ORB_GO(status, take_shapes(ctx, placed), fail);
  ORB_GO(status,
         orb_net_init(ctx, &placed->net, net->points, net->vertex_count, net->triangles, net->triangle_count, net->twin,
                      net->vertex_count),
         fail);
  ORB_GO(status, orb_placed_reserve(ctx, placed, 64), fail);
  orb_locator *locator = NULL;
  ORB_GO(status,
         orb_locator_create(ctx, placed->net.points, placed->net.vertex_count, placed->net.triangles,
                            placed->net.triangle_count, placed->net.twin, &locator),
         fail);
  status = place_items(ctx, placed, locator);
  orb_locator_destroy(ctx, locator);
  if (status != ORB_OK) {
    goto fail;
  }
  fix_landmarks(placed);
  return orb_sliced_by(ctx, placed->net.vertex_count, SLICE, GRAIN, locate_range, placed);
fail:
  orb_placed_free(ctx, placed);
  return status;
}

int32_t orb_placed_split(orb_placed_net *placed, int32_t h, const double p[3]) {
  int32_t g = placed->net.twin[h];
  int32_t lists[2] = {placed->triangle_items[h / 3], placed->triangle_items[g / 3]};
  int32_t beside = placed->net.triangles[h]; /* read before the split, which may put the new vertex here */
  const int32_t other = placed->net.triangles[g];
  int32_t v = orb_net_split_edge(&placed->net, h, p);
  if (v < 0) {
    return -1;
  }
  keep_halves(placed, beside, other, v);
  for (int32_t s = 0; s < placed->shape_count; s++) {
    int32_t near = placed->spot[(int64_t)beside * placed->shape_count + s].h / 3;
    orb_placed_locate(placed, v, s, near);
  }
  int32_t t = h / 3;
  placed->triangle_items[h / 3] = placed->triangle_items[g / 3] = -1;
  orb_placed_assign(placed, lists[0], t);
  orb_placed_assign(placed, lists[1], t);
  return v;
}

int32_t orb_placed_insert(orb_placed_net *placed, int32_t t, const double p[3]) {
  orb_net *net = &placed->net;
  orb_sphere_view view = orb_net_view(net);
  orb_hit hit = orb_walk(&view, p, t);
  int32_t edge = orb_hit_edge(&hit), other = edge >= 0 ? net->twin[edge] / 3 : -1;
  int32_t lists[2] = {placed->triangle_items[hit.triangle], other >= 0 ? placed->triangle_items[other] : -1};
  const int32_t ends[2] = {edge >= 0 ? net->triangles[edge] : -1, edge >= 0 ? net->triangles[net->twin[edge]] : -1};
  int32_t near = hit.triangle, before = net->vertex_count, v = orb_net_insert(net, p, &near);
  if (v < before) { /* p is a vertex already */
    return v;
  }
  if (edge >= 0) {
    keep_halves(placed, ends[0], ends[1], v);
  }
  for (int32_t s = 0; s < placed->shape_count; s++) {
    orb_placed_locate(placed, v, s,
                      placed->spot[(int64_t)net->triangles[3 * (int64_t)near] * placed->shape_count + s].h / 3);
  }
  placed->triangle_items[hit.triangle] = -1;
  if (other >= 0) {
    placed->triangle_items[other] = -1;
  }
  orb_placed_assign(placed, lists[0], hit.triangle);
  orb_placed_assign(placed, lists[1], hit.triangle);
  return v;
}

/* Moves what lives to its new number in `vertex` and `triangle`; the order stays. */
static void renumber(orb_placed_net *placed, const int32_t *vertex, const int32_t *triangle) {
  orb_net *net = &placed->net;
  int32_t vertices = 0, triangles = 0;
  for (int32_t v = 0; v < net->vertex_count; v++) {
    int32_t h = net->out[v];
    if (h < 0) {
      continue;
    }
    vertices++;
    orb_placed_copy_vertex(placed, vertex[v], v);
    net->out[vertex[v]] = 3 * triangle[h / 3] + h % 3;
    placed->fixed[vertex[v]] = placed->fixed[v];
    placed->no_move[vertex[v]] = placed->no_move[v];
    placed->no_collapse[vertex[v]] = placed->no_collapse[v];
    placed->vertex_items[vertex[v]] = placed->vertex_items[v];
  }
  for (int32_t t = 0; t < net->triangle_count; t++) {
    if (net->triangles[3 * t] < 0) {
      continue;
    }
    triangles++;
    for (int k = 0; k < 3; k++) {
      int32_t twin = net->twin[3 * t + k];
      net->triangles[3 * triangle[t] + k] = vertex[net->triangles[3 * t + k]];
      net->twin[3 * triangle[t] + k] = 3 * triangle[twin / 3] + twin % 3;
    }
    placed->triangle_items[triangle[t]] = placed->triangle_items[t];
    placed->not_inverted[triangle[t]] = placed->not_inverted[t];
    memmove(placed->within + 3 * (int64_t)triangle[t], placed->within + 3 * (int64_t)t, 3 * sizeof *placed->within);
    memmove(placed->no_repair + 2 * (int64_t)triangle[t], placed->no_repair + 2 * (int64_t)t,
            2 * sizeof *placed->no_repair);
  }
  for (int32_t v = vertices; v < net->vertex_count; v++) {
    placed->fixed[v] = 0;
    placed->no_move[v] = placed->no_collapse[v] = 0;
    placed->vertex_items[v] = -1;
  }
  for (int32_t t = triangles; t < net->triangle_count; t++) {
    placed->triangle_items[t] = -1;
  }
  net->vertex_count = vertices;
  net->triangle_count = triangles;
}

orb_status orb_placed_compact(orb_context *ctx, orb_placed_net *placed) {
  const orb_net *net = &placed->net;
  int32_t *vertex = ORB_NEW(ctx, int32_t, net->vertex_count);
  int32_t *triangle = ORB_NEW(ctx, int32_t, net->triangle_count);
  orb_status status = vertex && triangle ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    for (int32_t v = 0, next = 0; v < net->vertex_count; v++) {
      vertex[v] = next;
      next += net->out[v] >= 0;
    }
    for (int32_t t = 0, next = 0; t < net->triangle_count; t++) {
      triangle[t] = next;
      next += net->triangles[3 * t] >= 0;
    }
    renumber(placed, vertex, triangle);
  }
  orb_free(ctx, vertex);
  orb_free(ctx, triangle);
  return status;
}

int64_t orb_placed_live(const orb_placed_net *placed) {
  int64_t live = 0;
  for (int32_t t = 0; t < placed->net.triangle_count; t++) {
    live += placed->net.triangles[3 * t] >= 0;
  }
  return live;
}
