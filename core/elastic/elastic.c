/* A round adds up pulls on the vertices of mesh a: from the rough map, and from the nearest places both ways. Then
 * rotations and positions take turns. Each vertex takes the rotation that fits its edges best. Then all positions
 * together solve a linear system that asks each edge to equal the given edge under the rotations of its ends. The pulls
 * grow stronger from round to round.
 *
 * The first rotations come from the rough map: how it rotates the surroundings of each vertex. If they came from the
 * rotation of the whole instead, an arm raised by 150° would stay twisted, since neighbouring rotations hold each
 * other.
 *
 * A slide differs in three things. An edge should be what rotations and smoothed stretches make of it (stretch.h):
 * bodies that differ in girth otherwise drift along each other until their lengths agree. And it looks for places ahead
 * of where the mesh is, on the way that it took in the last round (momentum; Nesterov 1983). A place is where the
 * vertex is already, except for its distance from the surface, so a pull moves it along the surface by little in each
 * round. What else moves it along the surface is the relief (relief.h): normals of a limb hardly tell how far along the
 * limb and around it a vertex belongs, but its muscles do. A limb that begins far away takes more rounds than others,
 * so a slide goes on while it moves. */
#include "elastic/elastic.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/context.h"
#include "base/memory.h"
#include "base/parallel.h"
#include "elastic/body.h"
#include "elastic/relief.h"
#include "elastic/stretch.h"
#include "numeric/factor.h"
#include "numeric/rotation.h"
#include "numeric/vec3.h"

/* Lengths are those of surfaces of area 4π. Chosen by trial on the pairs of the half `choose` of
 * tests/bench/correspond.py, unless a line gives another reason. */
enum {
  MAP_ROUNDS = 2,         /* along the rough map alone; 8 change little */
  PLACE_ROUNDS = 6,       /* to the nearest places; 10 rank maps no better, and let wrong ones catch up */
  SLIDE_ROUNDS = 10,      /* in which the reach shrinks. More bring others no nearer to the truth, */
  SLIDE_ROUNDS_MOST = 40, /* but one that still moves goes on: a leg that began a tenth of the body away took 31 */
  ALTERNATIONS = 2,       /* of rotations and positions in a round */
  SURROUNDINGS = 4, /* a vertex takes its first rotation from the images of its surroundings, one vertex in this many of
                       the mesh. With one in 16, a limb's girth and as much of its length, noise of the rough map stays
                       as twists: of 20 pairs, the right map then bends the shapes least in 17 instead of 19, and by a
                       tenth more */
  GRAIN = 128       /* vertices of one task */
};
/* Distance at which a pull is as strong as the edges. A rough map is off by 0.2 or more at the ends of limbs. */
static const double MAP_REACH = 0.6, FIRST_REACH = 0.6, LAST_REACH = 0.06;
/* A pose to settle is carried from copies, and is off by about one of their edges. */
static const double SETTLE_FIRST_REACH = 0.15, SETTLE_LAST_REACH = 0.03;
/* A slide follows the relief as far as the last reach lets it: with 0.06 people stay a twentieth farther from the
 * truth. First ones of 0.2 to 0.6 are as good. */
static const double SLIDE_FIRST_REACH = 0.3, SLIDE_LAST_REACH = 0.12;
static const double AHEAD =
    0.9; /* of the way of the last round: how far ahead a slide looks. 0.7 comes a fiftieth less far */
/* A slide moves while more than this share of the surface has gone farther than this in the last round. With 0.1, a leg
 * of emmy-armsup to emmy-sidebend stops half-way. With 0.02, most slides take a few rounds more, in vain. */
static const double MOVING_SHARE = 0.05, MOVING = 0.01;
/* Share of the step by the relief that is taken where a vertex of b pulls one of a, which has its own step. With 0,
 * people stay a fiftieth farther from the truth, and with 1 animals a hundredth. */
static const double BACK_SHARE = 0.5;
/* The rough map keeps pulling beside the places, with this share of its strength at first, and not at all after FADED
 * of the rounds: without it a limb slides to the nearest other one. */
static const double MAP_SHARE = 0.3, FADED = 0.7;
/* Distances at which a vertex of the rough map is an outlier and counts a quarter: at first, in the first rounds, and
 * beside places. */
static const double OUTLIER_FIRST = 10, OUTLIER_MAP = 0.6, OUTLIER_PLACE = 0.4;
static const double NORMAL_SHARE = 0.05; /* of normals beside positions in a first rotation: a limb is nearly a line */
static const double FACING = 0.2;        /* least cosine of two normals: with less the place does not pull */
static const double HELD = 0.2;          /* weight that holds such a vertex where it looks from, relative to a pull */
static const double PLANE_MOST = 0.1;    /* most that a place slides from a vertex within its tangent plane */
static const double ANCHORED = 10;       /* pull of an anchor, relative to the edges of its vertex */
static const double LEAST_DIAGONAL = 1e-9; /* keeps the matrix regular where nothing pulls */

typedef struct registration {
  orb_context *ctx;
  orb_body a, b;
  const orb_rough_map *map;           /* NULL: none */
  const orb_elastic_anchors *anchors; /* NULL: none */
  orb_factor *factor;
  orb_elastic_pose *pose;
  double *normal; /* of a in its pose */
  orb_searched searched;
  double *diagonal, *right; /* the system */
  double *pull, *target;    /* on each vertex of a: the weight, and the weighted target (3) */
  int32_t *place, *visit; /* of each vertex of a: the nearest one of b; of each vertex of b: the nearest one of a; −1:
                             not yet searched */
  orb_stretch *stretch;   /* NULL: edges are only rotated */
  const orb_relief *relief; /* of a and b; NULL: not known */
  double noise;             /* of the relief, at the places as they are */
  double *ahead, *last;     /* of a slide: where it looks, and where it was in the last round; NULL: none */
  int is_alone;             /* no other registration runs beside this one: its loops run on all threads */
} registration;

/* Runs body over the vertices [0, count). */
static void for_vertices(registration *r, int32_t count, orb_loop_fn body) {
  if (r->is_alone) {
    orb_parallel_for(r->ctx, count, GRAIN, body, r);
  } else {
    body(r, 0, count, 0);
  }
}

static void fit_range(void *arg, int64_t begin, int64_t end, int thread) {
  registration *r = arg;
  const orb_body *a = &r->a;
  (void)thread;
  for (int32_t v = (int32_t)begin; v < end; v++) {
    double h[9] = {0};
    for (int32_t i = a->start[v]; i < a->start[v + 1]; i++) {
      double p[3], q[3];
      orb_sub(a->mesh->positions + 3 * (size_t)a->next[i], a->mesh->positions + 3 * (size_t)v, p);
      orb_sub(r->pose->position + 3 * (size_t)a->next[i], r->pose->position + 3 * (size_t)v, q);
      orb_add_outer(h, q, p, a->weight[i]);
    }
    (void)orb_nearest_rotation(h, r->pose->rotation + 9 * (size_t)v);
  }
}

/* Rotations, and stretches where they count, for the positions as they are. */
static void fit_surroundings(registration *r) {
  for_vertices(r, r->a.count, fit_range);
  if (r->stretch) {
    orb_stretch_fit(r->ctx, &r->a, r->pose->position, r->pose->rotation, r->stretch);
  }
}

/* Sums, over the edges that arrive at v, what the surroundings of both ends make of each given edge. */
static void add_edges(const registration *r, int32_t v, double sum[3]) {
  const orb_body *a = &r->a;
  const double *linear = r->stretch ? r->stretch->linear : r->pose->rotation, *here = linear + 9 * (size_t)v;
  for (int32_t i = a->start[v]; i < a->start[v + 1]; i++) {
    const double *there = linear + 9 * (size_t)a->next[i];
    double e[3];
    orb_sub(a->mesh->positions + 3 * (size_t)v, a->mesh->positions + 3 * (size_t)a->next[i], e);
    for (int k = 0; k < 3; k++) {
      sum[k] += a->weight[i] / 2 * (orb_dot(here + 3 * k, e) + orb_dot(there + 3 * k, e));
    }
  }
}

static void fill_system(void *arg, int64_t begin, int64_t end, int thread) {
  registration *r = arg;
  const orb_body *a = &r->a;
  (void)thread;
  for (int32_t v = (int32_t)begin; v < end; v++) {
    double *right = r->right + 3 * (size_t)v;
    memcpy(right, r->target + 3 * (size_t)v, sizeof(double[3]));
    add_edges(r, v, right);
    r->diagonal[v] = r->pull[v] + LEAST_DIAGONAL;
    for (int32_t i = a->start[v]; i < a->start[v + 1]; i++) {
      r->diagonal[v] += a->weight[i];
    }
  }
}

/* Positions for the rotations and pulls as they are. again: the pulls have other weights than last time. */
static orb_status solve(registration *r, int again) {
  for_vertices(r, r->a.count, fill_system);
  if (again) {
    ORB_TRY(orb_factor_compute(r->factor, r->diagonal));
  }
  orb_factor_solve3(r->factor, r->right, r->pose->position);
  return ORB_OK;
}

static void clear_pulls(registration *r) {
  memset(r->pull, 0, (size_t)r->a.count * sizeof *r->pull);
  memset(r->target, 0, 3 * (size_t)r->a.count * sizeof *r->target);
}

static void add_pull(registration *r, int32_t v, const double target[3], double weight) {
  r->pull[v] += weight;
  for (int k = 0; k < 3; k++) {
    r->target[3 * (size_t)v + (size_t)k] += weight * target[k];
  }
}

/* The point beside the vertex rotates with the vertex's surroundings. */
static void pull_by_anchors(registration *r) {
  for (int32_t i = 0; r->anchors && i < r->anchors->count; i++) {
    const orb_elastic_anchor *one = &r->anchors->one[i];
    const double *rotation = r->pose->rotation + 9 * (size_t)one->vertex;
    double target[3], edges = 0;
    for (int k = 0; k < 3; k++) {
      target[k] = one->place[k] - orb_dot(rotation + 3 * k, one->offset);
    }
    for (int32_t e = r->a.start[one->vertex]; e < r->a.start[one->vertex + 1]; e++) {
      edges += r->a.weight[e];
    }
    add_pull(r, one->vertex, target, ANCHORED * edges);
  }
}

static void pull_by_map(registration *r, double weight, double outlier) {
  for (int back = 0; back < 2; back++) {
    const orb_body *from = back ? &r->b : &r->a;
    const int32_t *to = back ? r->map->back : r->map->forth;
    for (int32_t i = 0; i < from->count; i++) {
      int32_t v = back ? to[i] : i, u = back ? i : to[i];
      const double *y = r->b.mesh->positions + 3 * (size_t)u;
      double far = orb_distance2(y, r->pose->position + 3 * (size_t)v), share = 1 / (1 + far / (outlier * outlier));
      add_pull(r, v, y, weight * from->mass[i] * share * share);
    }
  }
}

/* The point of the tangent plane of p that is nearest to x, or PLANE_MOST from p on the way to it. */
static void within_plane(const double p[3], const double n[3], const double x[3], double out[3]) {
  double away[3];
  orb_sub(x, p, away);
  double off = orb_dot(away, n), along = sqrt(fmax(0, orb_dot(away, away) - off * off));
  for (int k = 0; k < 3; k++) {
    out[k] = p[k] + (away[k] - off * n[k]) * (along > PLANE_MOST ? PLANE_MOST / along : 1);
  }
}

/* Where the vertices of a look for places. */
static const double *looks_from(const registration *r) {
  return r->ahead ? r->ahead : r->pose->position;
}

static void look_ahead(registration *r) {
  const double *position = r->pose->position;
  for (size_t i = 0; r->ahead && i < 3 * (size_t)r->a.count; i++) {
    r->ahead[i] = position[i] + AHEAD * (position[i] - r->last[i]);
    r->last[i] = position[i];
  }
}

static void find_places(void *arg, int64_t begin, int64_t end, int thread) {
  registration *r = arg;
  (void)thread;
  for (int64_t v = begin; v < end; v++) {
    r->place[v] = orb_searched_nearest(&r->b.searched, looks_from(r) + 3 * v, r->normal + 3 * v, r->place[v]);
  }
}

static void find_visits(void *arg, int64_t begin, int64_t end, int thread) {
  registration *r = arg;
  (void)thread;
  for (int64_t u = begin; u < end; u++) {
    r->visit[u] = orb_searched_nearest(&r->searched, r->b.mesh->positions + 3 * u, r->b.normal + 3 * u, r->visit[u]);
  }
}

/* Moves the place of vertex v along the surface, to where b stands out as far as a does at v. */
static void follow_relief(const registration *r, int32_t v, double target[3]) {
  const size_t u = 3 * (size_t)r->place[v];
  double from[3], step[3];
  if (r->relief) {
    orb_sub(target, r->b.mesh->positions + u, from);
    orb_relief_step(r->relief[0].height + ORB_RELIEF_SIZES * (size_t)v, r->relief + 1, r->place[v], from,
                    r->b.normal + u, r->noise, step);
    for (int k = 0; k < 3; k++) {
      target[k] += step[k];
    }
  }
}

/* The same for vertex u of b, which pulls vertex v: the place where a stands out as far as b does at u should come to
 * u. Slopes of a are those of the mesh as given, so the step is made there and rotated. */
static void follow_relief_back(const registration *r, int32_t u, int32_t v, const double at[3], double target[3]) {
  double away[3], from[3], step[3];
  if (r->relief) {
    const double *rotation = r->pose->rotation + 9 * (size_t)v, *y = r->b.mesh->positions + 3 * (size_t)u;
    orb_sub(y, at, away);
    const double length = orb_length(away), share = length > PLANE_MOST ? PLANE_MOST / length : 1;
    for (int k = 0; k < 3; k++) {
      from[k] = share * (rotation[k] * away[0] + rotation[3 + k] * away[1] + rotation[6 + k] * away[2]);
    }
    orb_relief_step(r->relief[1].height + ORB_RELIEF_SIZES * (size_t)u, r->relief, v, from, r->a.normal + 3 * (size_t)v,
                    r->noise, step);
    for (int k = 0; k < 3; k++) {
      target[k] -= BACK_SHARE * orb_dot(rotation + 3 * k, step);
    }
  }
}

/* Each vertex of a is pulled to the nearest place of b, and each vertex of b pulls the nearest one of a. */
static void pull_by_place(registration *r, double weight) {
  const double *position = looks_from(r);
  double target[3];
  look_ahead(r);
  orb_body_normals(r->a.mesh, position, r->normal, NULL);
  orb_searched_fill(position, r->normal, &r->searched);
  for_vertices(r, r->a.count, find_places);
  for_vertices(r, r->b.count, find_visits);
  r->noise = r->relief ? orb_relief_noise(&r->a, &r->relief[0], &r->relief[1], r->place) : 0;
  for (int32_t v = 0; v < r->a.count; v++) {
    const double *x = position + 3 * (size_t)v, *n = r->normal + 3 * (size_t)v;
    size_t u = 3 * (size_t)r->place[v];
    int faces = orb_dot(n, r->b.normal + u) > FACING;
    within_plane(r->b.mesh->positions + u, r->b.normal + u, x, target);
    follow_relief(r, v, target);
    add_pull(r, v, faces ? target : x, weight * r->a.mass[v] * (faces ? 1 : HELD));
  }
  for (int32_t u = 0; u < r->b.count; u++) {
    const double *x = r->b.mesh->positions + 3 * (size_t)u, *n = r->b.normal + 3 * (size_t)u;
    int32_t v = r->visit[u];
    if (orb_dot(n, r->normal + 3 * (size_t)v) > FACING) {
      within_plane(x, n, position + 3 * (size_t)v, target);
      follow_relief_back(r, u, v, position + 3 * (size_t)v, target);
      add_pull(r, v, target, weight * r->b.mass[u]);
    }
  }
}

/* The vertices around v, nearest rings first: `most` of them, if there are as many. mark: a number per vertex. */
static int32_t list_surroundings(const orb_body *a, int32_t v, int32_t most, int32_t *mark, int32_t *list) {
  int32_t count = 1;
  list[0] = v;
  mark[v] = v + 1;
  for (int32_t k = 0; k < count; k++) {
    for (int32_t i = a->start[list[k]]; i < a->start[list[k] + 1] && count < most; i++) {
      if (mark[a->next[i]] != v + 1) {
        mark[a->next[i]] = v + 1;
        list[count++] = a->next[i];
      }
    }
  }
  return count;
}

/* The rotation that carries these vertices best onto their images under the rough map. */
static void rotation_of_map(const registration *r, const int32_t *list, int32_t count, double rotation[9]) {
  double mean[2][3] = {{0}}, all = 0, h[9] = {0};
  const double *x = r->a.mesh->positions, *y = r->b.mesh->positions;
  for (int32_t k = 0; k < count; k++) {
    for (size_t i = 0; i < 3; i++) {
      mean[0][i] += r->a.mass[list[k]] * x[3 * (size_t)list[k] + i];
      mean[1][i] += r->a.mass[list[k]] * y[3 * (size_t)r->map->forth[list[k]] + i];
    }
    all += r->a.mass[list[k]];
  }
  for (int i = 0; i < 6; i++) {
    mean[i / 3][i % 3] /= all;
  }
  for (int32_t k = 0; k < count; k++) {
    size_t v = 3 * (size_t)list[k], u = 3 * (size_t)r->map->forth[list[k]];
    double p[3], q[3];
    orb_sub(x + v, mean[0], p);
    orb_sub(y + u, mean[1], q);
    orb_add_outer(h, q, p, r->a.mass[list[k]]);
    orb_add_outer(h, r->b.normal + u, r->a.normal + v, NORMAL_SHARE * r->a.mass[list[k]]);
  }
  (void)orb_nearest_rotation(h, rotation);
}

/* Sets the pose that the rough map gives directly. */
static orb_status begin_from_map(registration *r) {
  const int32_t n = r->a.count, most = 1 + n / SURROUNDINGS;
  int32_t *list = ORB_NEW(r->ctx, int32_t, most), *mark = ORB_NEW0(r->ctx, int32_t, n);
  const orb_status status = list && mark ? ORB_OK : ORB_E_NO_MEMORY;
  for (int32_t v = 0; v < n && status == ORB_OK; v++) {
    const int32_t count = list_surroundings(&r->a, v, most, mark, list);
    rotation_of_map(r, list, count, r->pose->rotation + 9 * (size_t)v);
    memcpy(r->pose->position + 3 * (size_t)v, r->b.mesh->positions + 3 * (size_t)r->map->forth[v], sizeof(double[3]));
  }
  orb_free(r->ctx, list);
  orb_free(r->ctx, mark);
  return status;
}

static orb_status follow_map(registration *r) {
  ORB_TRY(begin_from_map(r));
  for (int i = 0; i < MAP_ROUNDS; i++) {
    clear_pulls(r);
    pull_by_map(r, 1 / (MAP_REACH * MAP_REACH), i == 0 ? OUTLIER_FIRST : OUTLIER_MAP);
    pull_by_anchors(r);
    ORB_TRY(solve(r, 1));
    fit_surroundings(r);
  }
  return ORB_OK;
}

/* done: share of the rounds before this one. */
static orb_status follow_round(registration *r, double done, double reach) {
  if (r->is_alone) { /* elsewhere the caller's loops check */
    ORB_TRY(orb_context_check(r->ctx));
  }
  clear_pulls(r);
  if (r->map && done < FADED) {
    pull_by_map(r, MAP_SHARE / (MAP_REACH * MAP_REACH) * (1 - done / FADED), OUTLIER_PLACE);
  }
  pull_by_place(r, 1 / (reach * reach));
  pull_by_anchors(r);
  for (int k = 0; k < ALTERNATIONS; k++) {
    ORB_TRY(solve(r, k == 0));
    fit_surroundings(r);
  }
  return ORB_OK;
}

static orb_status follow_places(registration *r, int rounds, double first, double last) {
  for (int i = 0; i < rounds; i++) {
    const double done = (double)i / (rounds - 1);
    ORB_TRY(follow_round(r, done, first * pow(last / first, done)));
  }
  return ORB_OK;
}

static double bend_of(const registration *r) {
  const orb_body *a = &r->a;
  double bend = 0, length = 0;
  for (int32_t v = 0; v < a->count; v++) {
    const double *rotation = r->pose->rotation + 9 * (size_t)v;
    for (int32_t i = a->start[v]; i < a->start[v + 1]; i++) {
      double p[3], q[3];
      orb_sub(a->mesh->positions + 3 * (size_t)a->next[i], a->mesh->positions + 3 * (size_t)v, p);
      orb_sub(r->pose->position + 3 * (size_t)a->next[i], r->pose->position + 3 * (size_t)v, q);
      for (int k = 0; k < 3; k++) {
        double d = q[k] - orb_dot(rotation + 3 * k, p);
        bend += a->weight[i] * d * d;
      }
      length += a->weight[i] * orb_dot(p, p);
    }
  }
  return length > 0 ? bend / length : 0;
}

static void registration_free(registration *r) {
  orb_factor_destroy(r->factor);
  orb_body_free(r->ctx, &r->a);
  orb_body_free(r->ctx, &r->b);
  orb_free(r->ctx, r->normal);
  orb_free(r->ctx, r->ahead);
  orb_free(r->ctx, r->last);
  orb_searched_free(r->ctx, &r->searched);
  orb_free(r->ctx, r->diagonal);
  orb_free(r->ctx, r->right);
  orb_free(r->ctx, r->pull);
  orb_free(r->ctx, r->target);
  orb_free(r->ctx, r->place);
  orb_free(r->ctx, r->visit);
}

static orb_status factor_create(registration *r) {
  const orb_body *a = &r->a;
  int64_t count = 0;
  orb_coupling *couplings = ORB_NEW(r->ctx, orb_coupling, 3 * (size_t)a->mesh->triangle_count);
  if (!couplings) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t v = 0; v < a->count; v++) {
    for (int32_t i = a->start[v]; i < a->start[v + 1]; i++) {
      if (a->next[i] > v) {
        couplings[count++] = (orb_coupling){v, a->next[i], -a->weight[i]};
      }
    }
  }
  orb_status status = orb_factor_create(r->ctx, a->count, couplings, count, &r->factor);
  orb_free(r->ctx, couplings);
  return status;
}

static orb_status registration_create(orb_context *ctx, const orb_mesh *a, const orb_mesh *b, registration *r) {
  size_t n = (size_t)a->vertex_count;
  ORB_TRY(orb_body_create(ctx, a, &r->a));
  ORB_TRY(orb_body_create(ctx, b, &r->b));
  ORB_TRY(orb_searched_create(ctx, a->positions, r->a.normal, a->vertex_count, &r->searched));
  r->normal = ORB_NEW(ctx, double, 3 * n);
  r->diagonal = ORB_NEW(ctx, double, n);
  r->right = ORB_NEW(ctx, double, 3 * n);
  r->pull = ORB_NEW(ctx, double, n);
  r->target = ORB_NEW(ctx, double, 3 * n);
  r->place = ORB_NEW(ctx, int32_t, n);
  r->visit = ORB_NEW(ctx, int32_t, b->vertex_count);
  if (!r->normal || !r->diagonal || !r->right || !r->pull || !r->target || !r->place || !r->visit) {
    return ORB_E_NO_MEMORY;
  }
  memset(r->place, -1, n * sizeof *r->place); /* no hints for the first round */
  memset(r->visit, -1, (size_t)b->vertex_count * sizeof *r->visit);
  return factor_create(r);
}

orb_status orb_elastic_register(orb_context *ctx, const orb_mesh *a, const orb_mesh *b, const orb_rough_map *map,
                                const orb_elastic_anchors *anchors, orb_elastic_pose *pose, double *bend) {
  registration r = {.ctx = ctx, .map = map, .anchors = anchors, .pose = pose};
  orb_status status;
  ORB_GO(status, registration_create(ctx, a, b, &r), end);
  ORB_GO(status, follow_map(&r), end);
  ORB_GO(status, follow_places(&r, PLACE_ROUNDS, FIRST_REACH, LAST_REACH), end);
  *bend = bend_of(&r);
end:
  registration_free(&r);
  return status;
}

orb_status orb_elastic_settle(orb_context *ctx, const orb_mesh *a, const orb_mesh *b,
                              const orb_elastic_anchors *anchors, int rounds, orb_elastic_pose *pose) {
  registration r = {.ctx = ctx, .anchors = anchors, .pose = pose, .is_alone = 1};
  orb_status status;
  ORB_GO(status, registration_create(ctx, a, b, &r), end);
  status = follow_places(&r, rounds, SETTLE_FIRST_REACH, SETTLE_LAST_REACH);
end:
  registration_free(&r);
  return status;
}

/* What a slide needs besides a registration. */
typedef struct slide {
  registration r;
  orb_stretch stretch;
  orb_relief relief[2]; /* of a and b */
} slide;

static orb_status prepare_slide(slide *s) {
  registration *r = &s->r;
  const size_t n = 3 * (size_t)r->a.count;
  ORB_TRY(orb_stretch_create(r->ctx, &r->a, &s->stretch));
  r->stretch = &s->stretch;
  r->ahead = ORB_NEW(r->ctx, double, n);
  r->last = ORB_NEW(r->ctx, double, n);
  if (!r->ahead || !r->last) {
    return ORB_E_NO_MEMORY;
  }
  memcpy(r->last, r->pose->position, n * sizeof *r->last);
  const double grain = orb_relief_grain(&r->a, &r->b);
  ORB_TRY(orb_relief_create(r->ctx, &r->a, grain, s->relief));
  ORB_TRY(orb_relief_create(r->ctx, &r->b, grain, s->relief + 1));
  r->relief = s->relief;
  return ORB_OK;
}

/* Has the last round of a slide moved much of it? */
static int is_moving(const registration *r) {
  double all = 0, moving = 0;
  for (int32_t v = 0; v < r->a.count; v++) {
    const double far2 = orb_distance2(r->last + 3 * (size_t)v, r->pose->position + 3 * (size_t)v);
    all += r->a.mass[v];
    moving += far2 > MOVING * MOVING ? r->a.mass[v] : 0;
  }
  return moving > MOVING_SHARE * all;
}

static orb_status run_slide(registration *r) {
  fit_surroundings(r);
  ORB_TRY(follow_places(r, SLIDE_ROUNDS, SLIDE_FIRST_REACH, SLIDE_LAST_REACH));
  for (int i = SLIDE_ROUNDS; i < SLIDE_ROUNDS_MOST && is_moving(r); i++) {
    ORB_TRY(follow_round(r, 1, SLIDE_LAST_REACH));
  }
  return ORB_OK;
}

orb_status orb_elastic_slide(orb_context *ctx, const orb_mesh *a, const orb_mesh *b, const orb_elastic_anchors *anchors,
                             double *position) {
  orb_elastic_pose pose = {.position = position, .rotation = ORB_NEW(ctx, double, 9 * (size_t)a->vertex_count)};
  slide s = {.r = {.ctx = ctx, .anchors = anchors, .pose = &pose, .is_alone = 1}};
  orb_status status = pose.rotation ? ORB_OK : ORB_E_NO_MEMORY;
  if (status != ORB_OK) {
    return status;
  }
  ORB_GO(status, registration_create(ctx, a, b, &s.r), end);
  ORB_GO(status, prepare_slide(&s), end);
  status = run_slide(&s.r);
end:
  registration_free(&s.r);
  orb_stretch_free(ctx, &s.stretch);
  orb_relief_free(ctx, s.relief);
  orb_relief_free(ctx, s.relief + 1);
  orb_free(ctx, pose.rotation);
  return status;
}
