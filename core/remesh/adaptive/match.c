/* Setting a match up: the union of all shapes' vertices on the sphere, their places, and the hand-over at the end. */
#include "remesh/adaptive/match.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/grow.h"
#include "base/loops.h"
#include "mesh/normals.h"
#include "numeric/predicates.h"
#include "numeric/vec3.h"
#include "remesh/net_export.h"
#include "sphere/locate.h"

enum { GRAIN = 512, SLICE = 8192 };

const double *orb_match_item_point(const orb_match *match, int32_t item) {
  int32_t s = match->item_shape[item];
  return match->view[s].points + 3 * (int64_t)(item - match->item_begin[s]);
}

const double *orb_match_item_position(const orb_match *match, int32_t item) {
  int32_t s = match->item_shape[item];
  return match->position[s] + 3 * (int64_t)(item - match->item_begin[s]);
}

void orb_match_free(orb_context *ctx, orb_match *match) {
  for (int32_t s = 0; s < match->shape_count && match->position; s++) {
    orb_free(ctx, match->position[s]);
  }
  for (int32_t s = 0; s < match->shape_count && match->vertex_normal; s++) {
    orb_free(ctx, match->vertex_normal[s]);
  }
  orb_free(ctx, match->position);
  orb_free(ctx, match->vertex_normal);
  orb_free(ctx, match->view);
  orb_free(ctx, match->at);
  orb_free(ctx, match->normal);
  orb_free(ctx, match->spot);
  orb_free(ctx, match->fixed);
  orb_free(ctx, match->stayed);
  orb_free(ctx, match->alone);
  orb_free(ctx, match->stuck);
  orb_free(ctx, match->hopeless);
  orb_free(ctx, match->straight);
  orb_free(ctx, match->within);
  orb_free(ctx, match->item_begin);
  orb_free(ctx, match->item_next);
  orb_free(ctx, match->item_shape);
  orb_free(ctx, match->vertex_items);
  orb_free(ctx, match->triangle_items);
  orb_net_free(ctx, &match->net);
  memset(match, 0, sizeof *match);
}

orb_status orb_match_reserve(orb_context *ctx, orb_match *match, int64_t more) {
  if (match->net.vertex_count + more <= match->capacity) {
    return ORB_OK;
  }
  ORB_TRY(orb_net_reserve(ctx, &match->net, more));
  size_t n = (size_t)match->net.vertex_capacity, cells = n * (size_t)match->shape_count;
  if (!orb_regrow(ctx, &match->at, 3 * cells, sizeof(double)) ||
      !orb_regrow(ctx, &match->normal, 3 * cells, sizeof(double)) ||
      !orb_regrow(ctx, &match->spot, cells, sizeof(orb_spot)) || !orb_regrow(ctx, &match->fixed, n, 1) ||
      !orb_regrow(ctx, &match->stayed, n, sizeof(uint64_t)) || !orb_regrow(ctx, &match->alone, n, sizeof(uint64_t)) ||
      !orb_regrow(ctx, &match->stuck, n, sizeof(uint64_t)) ||
      !orb_regrow(ctx, &match->hopeless, 4 * n, sizeof(uint64_t)) ||
      !orb_regrow(ctx, &match->straight, 2 * n, sizeof(uint64_t)) ||
      !orb_regrow(ctx, &match->within, 6 * n, sizeof(uint64_t)) ||
      !orb_regrow(ctx, &match->vertex_items, n, sizeof(int32_t)) ||
      !orb_regrow(ctx, &match->triangle_items, 2 * n, sizeof(int32_t))) {
    return ORB_E_NO_MEMORY;
  }
  for (size_t i = (size_t)match->capacity; i < n; i++) {
    match->fixed[i] = 0;
    match->stayed[i] = match->alone[i] = match->stuck[i] = 0;
    match->vertex_items[i] = -1;
    match->triangle_items[2 * i] = match->triangle_items[2 * i + 1] = -1;
    memset(match->hopeless + 4 * i, 0, 4 * sizeof *match->hopeless);
    match->straight[2 * i] = match->straight[2 * i + 1] = 0;
    memset(match->within + 6 * i, 0, 6 * sizeof *match->within);
  }
  match->capacity = (int32_t)n;
  return ORB_OK;
}

static orb_status take_shapes(orb_context *ctx, orb_match *match) {
  const orb_remesh_job *job = match->job;
  int32_t shapes = match->shape_count = job->shape_count;
  match->position = ORB_NEW0(ctx, double *, shapes);
  match->vertex_normal = ORB_NEW0(ctx, double *, shapes);
  match->view = ORB_NEW(ctx, orb_sphere_view, shapes);
  match->item_begin = ORB_NEW0(ctx, int32_t, shapes + 1);
  if (!match->position || !match->vertex_normal || !match->view || !match->item_begin) {
    return ORB_E_NO_MEMORY;
  }
  int64_t items = 0;
  for (int32_t s = 0; s < shapes; s++) {
    const orb_mesh *mesh = &job->shapes[s].mesh;
    match->view[s] = (orb_sphere_view){job->shapes[s].points, mesh->triangles, job->twin[s], mesh->triangle_count};
    items += mesh->vertex_count;
    if (items > INT32_MAX / 8) {
      return orb_fail(ctx, ORB_E_TOO_LARGE, "The shapes have too many vertices together.");
    }
    match->item_begin[s + 1] = (int32_t)items;
    match->position[s] = ORB_NEW(ctx, double, 3 * (int64_t)mesh->vertex_count);
    match->vertex_normal[s] = ORB_NEW(ctx, double, 3 * (int64_t)mesh->vertex_count);
    if (!match->position[s] || !match->vertex_normal[s]) {
      return ORB_E_NO_MEMORY;
    }
    ORB_TRY(orb_smooth_normals(ctx, mesh->positions, mesh->vertex_count, mesh->triangles, mesh->triangle_count,
                               match->vertex_normal[s]));
    double scale = job->diagonal[s] > 0 ? 1 / job->diagonal[s] : 1;
    for (int64_t i = 0; i < 3 * (int64_t)mesh->vertex_count; i++) {
      match->position[s][i] = mesh->positions[i] * scale;
    }
  }
  match->item_next = ORB_NEW(ctx, int32_t, items);
  match->item_shape = ORB_NEW(ctx, int32_t, items);
  if (!match->item_next || !match->item_shape) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t s = 0; s < shapes; s++) {
    for (int32_t i = match->item_begin[s]; i < match->item_begin[s + 1]; i++) {
      match->item_shape[i] = s;
      match->item_next[i] = -1;
    }
  }
  return ORB_OK;
}

static void put_item_at(orb_match *match, int32_t item, int32_t v) {
  match->item_next[item] = match->vertex_items[v];
  match->vertex_items[v] = item;
}

/* Places net vertex v on shape s, starting at triangle `hint`. */
static void settle(orb_match *match, int32_t v, int32_t s, int32_t hint) {
  const double *p = orb_net_point(&match->net, v);
  orb_place place;
  orb_hit hit = orb_locate_hit(match->job->locator[s], p, hint, &place);
  int64_t cell = (int64_t)v * match->shape_count + s;
  match->spot[cell] = orb_spot_of(&hit);
  double *at = match->at + 3 * cell, *normal = match->normal + 3 * cell;
  at[0] = at[1] = at[2] = normal[0] = normal[1] = normal[2] = 0;
  for (int k = 0; k < 3; k++) {
    int64_t corner = match->view[s].triangles[3 * place.triangle + k];
    for (int j = 0; j < 3; j++) {
      at[j] += place.at[k] * match->position[s][3 * corner + j];
      normal[j] += place.at[k] * match->vertex_normal[s][3 * corner + j];
    }
  }
  (void)orb_normalize(normal);
}

void orb_match_place_on(orb_match *match, int32_t v, int32_t s) {
  settle(match, v, s, match->spot[(int64_t)v * match->shape_count + s].h / 3);
}

void orb_match_place(orb_match *match, int32_t v, const double p[3]) {
  memcpy(match->net.points + 3 * (int64_t)v, p, 3 * sizeof(double));
  for (int32_t s = 0; s < match->shape_count; s++) {
    orb_match_place_on(match, v, s);
  }
}

void orb_match_copy_vertex(orb_match *match, int32_t to, int32_t from) {
  int64_t shapes = match->shape_count;
  if (to == from) {
    return;
  }
  memcpy(match->net.points + 3 * (int64_t)to, match->net.points + 3 * (int64_t)from, 3 * sizeof(double));
  memcpy(match->at + 3 * to * shapes, match->at + 3 * from * shapes, 3 * (size_t)shapes * sizeof(double));
  memcpy(match->normal + 3 * to * shapes, match->normal + 3 * from * shapes, 3 * (size_t)shapes * sizeof(double));
  memcpy(match->spot + to * shapes, match->spot + from * shapes, (size_t)shapes * sizeof(orb_spot));
}

/* Vertices that follow each other mostly lie near each other; then the one before is a better start than a cell of the
 * locator, which holds about four triangles. */
static void settle_range(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  orb_match *match = arg;
  for (int64_t v = begin; v < end; v++) {
    const double *p = match->net.points + 3 * v;
    double apart2 = v > begin ? orb_distance2(p, p - 3) : INFINITY;
    for (int32_t s = 0; s < match->shape_count; s++) {
      int near = apart2 * match->view[s].triangle_count < 50;
      settle(match, (int32_t)v, s, near ? match->spot[(v - 1) * match->shape_count + s].h / 3 : -1);
    }
  }
}

static void fix_landmarks(orb_match *match) {
  const orb_remesh_job *job = match->job;
  for (int32_t v = 0; v < match->net.vertex_count; v++) {
    for (int32_t i = match->vertex_items[v]; i >= 0 && !match->fixed[v]; i = match->item_next[i]) {
      const int32_t *landmarks = job->shapes[match->item_shape[i]].landmark_vertices;
      for (int32_t l = 0; landmarks && l < job->landmark_count; l++) {
        match->fixed[v] |= landmarks[l] == i - match->item_begin[match->item_shape[i]];
      }
    }
  }
}

orb_status orb_match_create(orb_context *ctx, const orb_remesh_job *job, orb_match *match) {
  memset(match, 0, sizeof *match);
  match->job = job;
  orb_status status;
  ORB_GO(status, take_shapes(ctx, match), fail);
  int32_t base = 0;
  for (int32_t s = 1; s < match->shape_count; s++) {
    base = job->shapes[s].mesh.triangle_count > job->shapes[base].mesh.triangle_count ? s : base;
  }
  const orb_aligned_shape *shape = &job->shapes[base];
  int64_t items = match->item_begin[match->shape_count];
  ORB_GO(status,
         orb_net_init(ctx, &match->net, shape->points, shape->mesh.vertex_count, shape->mesh.triangles,
                      shape->mesh.triangle_count, items + items / 4),
         fail);
  ORB_GO(status, orb_match_reserve(ctx, match, items - match->net.vertex_count), fail);
  for (int32_t v = 0; v < shape->mesh.vertex_count; v++) {
    put_item_at(match, match->item_begin[base] + v, v);
  }
  for (int32_t s = 0; s < match->shape_count; s++) {
    for (int32_t v = 0; v < job->shapes[s].mesh.vertex_count && s != base; v++) {
      const double *p = job->shapes[s].points + 3 * (int64_t)v;
      orb_place near;
      orb_locate(job->locator[base], p, -1, &near);
      put_item_at(match, match->item_begin[s] + v, orb_net_insert(&match->net, p, &near.triangle));
      if ((v & 4095) == 0) {
        ORB_GO(status, orb_context_check(ctx), fail);
      }
    }
  }
  fix_landmarks(match);
  return orb_sliced_by(ctx, match->net.vertex_count, SLICE, GRAIN, settle_range, match);
fail:
  orb_match_free(ctx, match);
  return status;
}

void orb_match_deal(orb_match *match, int32_t list, int32_t start) {
  orb_sphere_view view = orb_net_view(&match->net);
  while (list >= 0) {
    int32_t item = list;
    list = match->item_next[item];
    orb_hit hit = orb_walk(&view, orb_match_item_point(match, item), start);
    match->item_next[item] = match->triangle_items[hit.triangle];
    match->triangle_items[hit.triangle] = item;
  }
}

void orb_match_deal_among(orb_match *match, int32_t list, const int32_t *triangles, int count) {
  const orb_net *net = &match->net;
  while (list >= 0) {
    int32_t item = list;
    const double *x = orb_match_item_point(match, item);
    int at = -1;
    for (int i = 0; i < count && at < 0; i++) {
      const int32_t *c = net->triangles + 3 * (int64_t)triangles[i];
      const double *p = orb_net_point(net, c[0]), *q = orb_net_point(net, c[1]), *r = orb_net_point(net, c[2]);
      at = orb_orient(p, q, x) >= 0 && orb_orient(q, r, x) >= 0 && orb_orient(r, p, x) >= 0 ? i : -1;
    }
    ORB_ASSERT(at >= 0);
    list = match->item_next[item];
    match->item_next[item] = match->triangle_items[triangles[at]];
    match->triangle_items[triangles[at]] = item;
  }
}

orb_status orb_match_create_on(orb_context *ctx, const orb_remesh_job *job, const orb_net *net, orb_match *match) {
  memset(match, 0, sizeof *match);
  match->job = job;
  orb_status status;
  ORB_GO(status, take_shapes(ctx, match), fail);
  ORB_GO(status,
         orb_net_init(ctx, &match->net, net->points, net->vertex_count, net->triangles, net->triangle_count,
                      net->vertex_count),
         fail);
  ORB_GO(status, orb_match_reserve(ctx, match, 64), fail);
  orb_locator *locator = NULL;
  ORB_GO(status,
         orb_locator_create(ctx, match->net.points, match->net.vertex_count, match->net.triangles,
                            match->net.triangle_count, match->net.twin, &locator),
         fail);
  orb_sphere_view view = orb_net_view(&match->net);
  for (int32_t i = 0; i < match->item_begin[match->shape_count] && status == ORB_OK; i++) {
    orb_place place;
    status = (i & 4095) == 0 ? orb_context_check(ctx) : ORB_OK;
    orb_locate(locator, orb_match_item_point(match, i), -1, &place);
    orb_hit hit = orb_walk(&view, orb_match_item_point(match, i), place.triangle);
    int corner = orb_hit_corner(&hit);
    if (corner >= 0) {
      put_item_at(match, i, match->net.triangles[3 * hit.triangle + corner]);
    } else {
      match->item_next[i] = match->triangle_items[hit.triangle];
      match->triangle_items[hit.triangle] = i;
    }
  }
  orb_locator_destroy(ctx, locator);
  if (status != ORB_OK) {
    goto fail;
  }
  fix_landmarks(match);
  return orb_sliced_by(ctx, match->net.vertex_count, SLICE, GRAIN, settle_range, match);
fail:
  orb_match_free(ctx, match);
  return status;
}

int32_t orb_match_split(orb_match *match, int32_t h, const double p[3]) {
  int32_t g = match->net.twin[h];
  int32_t lists[2] = {match->triangle_items[h / 3], match->triangle_items[g / 3]};
  int32_t beside = match->net.triangles[h]; /* of before: the split may put the new vertex here */
  int32_t v = orb_net_split_edge(&match->net, h, p);
  if (v < 0) {
    return -1;
  }
  for (int32_t s = 0; s < match->shape_count; s++) {
    int32_t near = match->spot[(int64_t)beside * match->shape_count + s].h / 3;
    settle(match, v, s, near);
  }
  int32_t t = h / 3;
  match->triangle_items[h / 3] = match->triangle_items[g / 3] = -1;
  orb_match_deal(match, lists[0], t);
  orb_match_deal(match, lists[1], t);
  return v;
}

int32_t orb_match_insert(orb_match *match, int32_t t, const double p[3]) {
  orb_net *net = &match->net;
  orb_sphere_view view = orb_net_view(net);
  orb_hit hit = orb_walk(&view, p, t);
  int32_t edge = orb_hit_edge(&hit), other = edge >= 0 ? net->twin[edge] / 3 : -1;
  int32_t lists[2] = {match->triangle_items[hit.triangle], other >= 0 ? match->triangle_items[other] : -1};
  int32_t near = hit.triangle, before = net->vertex_count, v = orb_net_insert(net, p, &near);
  if (v < before) { /* there is one: what lies here is its item from now on */
    return v;
  }
  for (int32_t s = 0; s < match->shape_count; s++) {
    settle(match, v, s, match->spot[(int64_t)net->triangles[3 * (int64_t)near] * match->shape_count + s].h / 3);
  }
  match->triangle_items[hit.triangle] = -1;
  if (other >= 0) {
    match->triangle_items[other] = -1;
  }
  orb_match_deal(match, lists[0], hit.triangle);
  orb_match_deal(match, lists[1], hit.triangle);
  return v;
}

/* Drops what is dead of the net: `vertex` and `triangle` are the new numbers of what lives, in the same order. */
static void close_up(orb_match *match, const int32_t *vertex, const int32_t *triangle) {
  orb_net *net = &match->net;
  int32_t vertices = 0, triangles = 0;
  for (int32_t v = 0; v < net->vertex_count; v++) {
    int32_t h = net->out[v];
    if (h < 0) {
      continue;
    }
    vertices++;
    orb_match_copy_vertex(match, vertex[v], v);
    net->out[vertex[v]] = 3 * triangle[h / 3] + h % 3;
    match->fixed[vertex[v]] = match->fixed[v];
    match->stayed[vertex[v]] = match->stayed[v];
    match->alone[vertex[v]] = match->alone[v];
    match->stuck[vertex[v]] = match->stuck[v];
    match->vertex_items[vertex[v]] = match->vertex_items[v];
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
    match->triangle_items[triangle[t]] = match->triangle_items[t];
    match->straight[triangle[t]] = match->straight[t];
    memmove(match->within + 3 * (int64_t)triangle[t], match->within + 3 * (int64_t)t, 3 * sizeof *match->within);
    memmove(match->hopeless + 2 * (int64_t)triangle[t], match->hopeless + 2 * (int64_t)t, 2 * sizeof *match->hopeless);
  }
  for (int32_t v = vertices; v < net->vertex_count; v++) {
    match->fixed[v] = 0;
    match->stayed[v] = match->alone[v] = match->stuck[v] = 0;
    match->vertex_items[v] = -1;
  }
  for (int32_t t = triangles; t < net->triangle_count; t++) {
    match->triangle_items[t] = -1;
  }
  net->vertex_count = vertices;
  net->triangle_count = triangles;
}

orb_status orb_match_compact(orb_context *ctx, orb_match *match) {
  const orb_net *net = &match->net;
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
    close_up(match, vertex, triangle);
  }
  orb_free(ctx, vertex);
  orb_free(ctx, triangle);
  return status;
}

int64_t orb_match_live(const orb_match *match) {
  int64_t live = 0;
  for (int32_t t = 0; t < match->net.triangle_count; t++) {
    live += match->net.triangles[3 * t] >= 0;
  }
  return live;
}

typedef struct place_loop {
  const orb_match *match;
  const int32_t *number; /* a vertex: in the supermesh */
  orb_supermesh *out;
} place_loop;

static void place_range(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  place_loop *loop = arg;
  const orb_match *match = loop->match;
  for (int64_t v = begin; v < end; v++) {
    for (int32_t s = 0; s < match->shape_count && match->net.out[v] >= 0; s++) {
      orb_locate(match->job->locator[s], match->net.points + 3 * v, match->spot[v * match->shape_count + s].h / 3,
                 &loop->out->places[(int64_t)s * loop->out->vertex_count + loop->number[v]]);
    }
  }
}

orb_status orb_match_export(orb_context *ctx, const orb_match *match, orb_supermesh *out) {
  int32_t *number = ORB_NEW(ctx, int32_t, match->net.vertex_count);
  orb_status status = number ? orb_net_export(ctx, &match->net, out, number) : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    out->places = ORB_NEW(ctx, orb_place, (int64_t)match->shape_count * out->vertex_count);
    status = out->places ? ORB_OK : ORB_E_NO_MEMORY;
  }
  if (status == ORB_OK) {
    place_loop loop = {match, number, out};
    status = orb_sliced_by(ctx, match->net.vertex_count, SLICE, GRAIN, place_range, &loop);
  }
  if (status == ORB_OK) {
    status = orb_match_bounds(ctx, match, out->error_bound);
  }
  orb_free(ctx, number);
  return status;
}
