/* Registration as rigid as possible, where the answer is known, and matches of shapes without landmarks. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "align/find/match.h"
#include "elastic/body.h"
#include "elastic/elastic.h"
#include "elastic/searched.h"
#include "elastic/slide.h"
#include "numeric/vec3.h"
#include "support_context.h"
#include "support_shapes.h"

enum { LIMBS = 5 };

/* Five directions without any symmetry, and how far the limbs reach. */
static const double limb[LIMBS][3] = {{1, 0, 0}, {-0.6, 0.8, 0}, {0, -0.8, 0.6}, {-0.48, -0.6, -0.64}, {0, 0.28, 0.96}};
static const double reach[LIMBS] = {4, 3.4, 2.9, 2.5, 2.2};

/* The radius of the creature in a direction of length 1. */
static double radius(const double p[3]) {
  double r = 1;
  for (int i = 0; i < LIMBS; i++) {
    r += (reach[i] - 1) * exp(-20 * (1 - p[0] * limb[i][0] - p[1] * limb[i][1] - p[2] * limb[i][2]));
  }
  return r;
}

static orb_mesh creature(int levels) {
  orb_mesh mesh = shape_ball(ctx, levels);
  for (int32_t v = 0; v < mesh.vertex_count; v++) {
    double *p = mesh.positions + 3 * (size_t)v, r = radius(p);
    for (int k = 0; k < 3; k++) {
      p[k] *= r;
    }
  }
  return mesh;
}

static void scale_to_sphere(orb_mesh *mesh) {
  orb_extent extent;
  orb_mesh_extent(mesh, &extent);
  for (int32_t i = 0; i < 3 * mesh->vertex_count; i++) {
    mesh->positions[i] *= sqrt(4 * M_PI / extent.area);
  }
}

static orb_elastic_pose pose_of(const orb_mesh *mesh) {
  orb_elastic_pose pose = {orb_alloc(ctx, 3 * (size_t)mesh->vertex_count, sizeof(double)),
                           orb_alloc(ctx, 9 * (size_t)mesh->vertex_count, sizeof(double))};
  assert_non_null(pose.position);
  assert_non_null(pose.rotation);
  return pose;
}

static void pose_free(orb_elastic_pose *pose) {
  orb_free(ctx, pose->position);
  orb_free(ctx, pose->rotation);
}

static double distance(const double *x, const double *y) {
  return sqrt((x[0] - y[0]) * (x[0] - y[0]) + (x[1] - y[1]) * (x[1] - y[1]) + (x[2] - y[2]) * (x[2] - y[2]));
}

/* Maps each vertex to one beside its true place: nowhere exact. */
static int32_t *neighbours(const orb_mesh *mesh) {
  int32_t *next = orb_alloc(ctx, (size_t)mesh->vertex_count, sizeof *next);
  assert_non_null(next);
  for (int32_t h = 0; h < 3 * mesh->triangle_count; h++) {
    next[mesh->triangles[h]] = mesh->triangles[h % 3 == 2 ? h - 2 : h + 1];
  }
  return next;
}

/* A shape is registered to its rotated copy from a rough map: it hardly bends, and its local rotations are that
 * rotation. */
static void a_rotation_is_found(void **state) {
  (void)state;
  orb_mesh a = creature(3), b = creature(3);
  double bend, worst = 0;
  for (int32_t v = 0; v < b.vertex_count; v++) { /* x, y, z → y, z, x */
    double *p = b.positions + 3 * (size_t)v, x = p[0];
    p[0] = p[1];
    p[1] = p[2];
    p[2] = x;
  }
  scale_to_sphere(&a);
  scale_to_sphere(&b);
  int32_t *next = neighbours(&a);
  orb_rough_map map = {next, next};
  orb_elastic_pose pose = pose_of(&a);
  assert_int_equal(orb_elastic_register(ctx, &a, &b, NULL, &map, NULL, &pose, &bend), ORB_OK);
  assert_true(bend >= 0 && bend < 0.02);
  for (int32_t v = 0; v < a.vertex_count; v++) {
    worst = fmax(worst, distance(pose.position + 3 * (size_t)v, b.positions + 3 * (size_t)v));
  }
  assert_true(worst < 0.15); /* a third of a mean edge at the limbs' roots, where edges are longest */
  const double *r = pose.rotation;
  assert_true(r[1] > 0.9 && r[5] > 0.9 && r[6] > 0.9);
  pose_free(&pose);
  orb_free(ctx, next);
  shape_free(ctx, &a);
  shape_free(ctx, &b);
}

/* A tube and the same tube bent by a half turn along its axis: the registration finds the bend from a rough map. */
static void a_bent_tube_is_found(void **state) {
  (void)state;
  orb_mesh a = shape_ball(ctx, 3), b = shape_ball(ctx, 3);
  double bend, sum = 0;
  const double half = 3, turn = M_PI / 2 / half; /* radians a unit of length */
  for (int32_t v = 0; v < a.vertex_count; v++) {
    double *p = a.positions + 3 * (size_t)v, *q = b.positions + 3 * (size_t)v;
    p[0] *= 0.5;
    p[1] *= 0.5;
    p[2] = half * asin(fmax(-1, fmin(1, p[2]))) / (M_PI / 2);
    q[0] = (p[0] + 1 / turn) * cos(turn * p[2]);
    q[1] = p[1];
    q[2] = (p[0] + 1 / turn) * sin(turn * p[2]);
  }
  scale_to_sphere(&a);
  scale_to_sphere(&b);
  int32_t *next = neighbours(&a);
  orb_rough_map map = {next, next};
  orb_elastic_pose pose = pose_of(&a);
  assert_int_equal(orb_elastic_register(ctx, &a, &b, NULL, &map, NULL, &pose, &bend), ORB_OK);
  for (int32_t v = 0; v < a.vertex_count; v++) {
    sum += distance(pose.position + 3 * (size_t)v, b.positions + 3 * (size_t)v) / a.vertex_count;
  }
  assert_true(sum < 0.05);
  assert_true(bend < 0.1);
  pose_free(&pose);
  orb_free(ctx, next);
  shape_free(ctx, &a);
  shape_free(ctx, &b);
}

/* The point of an anchor, which rotates with the surroundings of its vertex. */
static double away_from_place(const orb_elastic_pose *pose, const orb_elastic_anchor *one) {
  double at[3];
  for (int k = 0; k < 3; k++) {
    at[k] = pose->position[3 * (size_t)one->vertex + (size_t)k] +
            orb_dot(pose->rotation + 9 * (size_t)one->vertex + 3 * (size_t)k, one->offset);
  }
  return distance(at, one->place);
}

/* A ball lies on itself in every rotation, so only anchors tell where its points belong. */
static void anchors_reach_their_places(void **state) {
  (void)state;
  enum { ANCHORS = 14 };
  orb_mesh a = shape_ball(ctx, 3), b = shape_ball(ctx, 3);
  const double c = cos(0.3), s = sin(0.3);
  orb_elastic_anchor anchor[ANCHORS] = {0};
  const orb_elastic_anchors anchors = {ANCHORS, anchor};
  scale_to_sphere(&a);
  scale_to_sphere(&b);
  assert_true(a.vertex_count > 10 * ANCHORS);
  for (int32_t i = 0; i < ANCHORS; i++) {
    anchor[i].vertex = i * (a.vertex_count / ANCHORS);
    const double *p = a.positions + 3 * (size_t)anchor[i].vertex, q[3] = {p[0] - 0.05 * p[1], p[1] + 0.05 * p[0], p[2]};
    orb_sub(q, p, anchor[i].offset);
    memcpy(anchor[i].place, (double[3]){c * q[0] - s * q[1], s * q[0] + c * q[1], q[2]}, sizeof anchor[i].place);
  }
  for (int with = 0; with < 2; with++) {
    double away = 0;
    orb_elastic_pose pose = pose_of(&a);
    memcpy(pose.position, a.positions, 3 * (size_t)a.vertex_count * sizeof *pose.position);
    for (int32_t i = 0; i < 9 * a.vertex_count; i++) {
      pose.rotation[i] = i % 9 % 4 == 0;
    }
    assert_int_equal(orb_elastic_settle(ctx, &a, &b, with ? &anchors : NULL, 6, 0, &pose), ORB_OK);
    for (int32_t i = 0; i < ANCHORS; i++) {
      away += away_from_place(&pose, &anchor[i]) / ANCHORS;
    }
    assert_true(with ? away < 0.05 : away > 0.2); /* a rotation by 0.3 moves a point by 0.24 in the mean */
    pose_free(&pose);
  }
  shape_free(ctx, &a);
  shape_free(ctx, &b);
}

/* The radius of a potato with five bumps in a direction of length 1. */
static double potato(const double p[3]) {
  double r = 1;
  for (int i = 0; i < LIMBS; i++) {
    r += 0.2 * (reach[i] - 1) * exp(-8 * (1 - p[0] * limb[i][0] - p[1] * limb[i][1] - p[2] * limb[i][2]));
  }
  return r;
}

/* A potato, a taller one, and a map between them that is pushed aside around one place. */
typedef struct push {
  orb_mesh a, b, start;
} push;

static void push_open(push *s) {
  *s = (push){shape_ball(ctx, 4), shape_ball(ctx, 4), shape_ball(ctx, 4)};
  for (int32_t v = 0; v < s->a.vertex_count; v++) {
    const double *d = s->a.positions + 3 * (size_t)v, angle = 0.3 * exp(-10 * (1 - d[0]));
    const double turned[3] = {cos(angle) * d[0] - sin(angle) * d[1], sin(angle) * d[0] + cos(angle) * d[1], d[2]};
    const double r = potato(d), there = potato(turned);
    for (int k = 0; k < 3; k++) {
      const size_t at = 3 * (size_t)v + (size_t)k;
      s->start.positions[at] = turned[k] * there * (k == 2 ? 1.2 : 1);
      s->b.positions[at] *= r * (k == 2 ? 1.2 : 1);
      s->a.positions[at] *= r;
    }
  }
  scale_to_sphere(&s->a);
  scale_to_sphere(&s->b);
  scale_to_sphere(&s->start);
}

static void push_close(push *s) {
  shape_free(ctx, &s->a);
  shape_free(ctx, &s->b);
  shape_free(ctx, &s->start);
}

/* Slides the first shape from where the map has it. Do the two fit? */
static int slide(push *s, const orb_elastic_anchors *anchors) {
  int fits;
  assert_int_equal(orb_elastic_slide(ctx, &s->a, &s->b, anchors, s->start.positions, &fits), ORB_OK);
  return fits;
}

/* The greatest distance of a vertex from its place. */
static double push_left(const push *s) {
  double most = 0;
  for (int32_t v = 0; v < s->a.vertex_count; v++) {
    most = fmax(most, distance(s->start.positions + 3 * (size_t)v, s->b.positions + 3 * (size_t)v));
  }
  return most;
}

static void a_slide_undoes_a_push(void **state) {
  (void)state;
  push s;
  push_open(&s);
  const double before = push_left(&s);
  assert_true(slide(&s, NULL));
  assert_true(before > 0.3);
  assert_true(push_left(&s) < 0.5 * before);
  push_close(&s);
}

/* The vertex that is pushed the most is an anchor at its true place: it goes there, and its surroundings follow. */
static void an_anchor_leads_a_slide(void **state) {
  (void)state;
  push free_one, held;
  int32_t worst = 0;
  double most = 0;
  push_open(&free_one);
  push_open(&held);
  for (int32_t v = 0; v < held.a.vertex_count; v++) {
    const double away = distance(held.start.positions + 3 * (size_t)v, held.b.positions + 3 * (size_t)v);
    worst = away > most ? v : worst;
    most = fmax(most, away);
  }
  orb_elastic_anchor one = {.vertex = worst};
  memcpy(one.place, held.b.positions + 3 * (size_t)worst, sizeof one.place);
  const orb_elastic_anchors anchors = {1, &one};
  assert_true(slide(&free_one, NULL));
  assert_true(slide(&held, &anchors));
  assert_true(distance(held.start.positions + 3 * (size_t)worst, one.place) < 0.05 * most);
  assert_true(push_left(&held) < push_left(&free_one));
  push_close(&free_one);
  push_close(&held);
}

/* A potato is no stick: the slide ends after a round, though the map reaches all of it. */
static void a_slide_ends_where_shapes_do_not_fit(void **state) {
  (void)state;
  push s;
  push_open(&s);
  for (int32_t v = 0; v < s.b.vertex_count; v++) {
    s.b.positions[3 * (size_t)v + 2] *= 12;
    s.start.positions[3 * (size_t)v + 2] *= 12;
  }
  scale_to_sphere(&s.b);
  scale_to_sphere(&s.start);
  assert_false(slide(&s, NULL));
  push_close(&s);
}

/* A ball with shallow bumps and hollows. Where they are depends on the phase. */
static orb_mesh bumpy_ball(double phase) {
  orb_mesh mesh = shape_ball(ctx, 4);
  for (int32_t v = 0; v < mesh.vertex_count; v++) {
    double *p = mesh.positions + 3 * (size_t)v;
    const double r = 1 + 0.03 * sin(8 * p[0] + phase) * sin(8 * p[1] + 1 - phase) * sin(8 * p[2] + 2 + phase);
    for (int k = 0; k < 3; k++) {
      p[k] *= r;
    }
  }
  scale_to_sphere(&mesh);
  return mesh;
}

/* Two balls fit each other however they lie. If their bumps lie near each other, they slide; bumps that have nothing to
 * do with each other do not say where to. */
static void a_slide_ends_where_reliefs_are_unrelated(void **state) {
  (void)state;
  for (int related = 0; related < 2; related++) {
    const double other = related ? 0.25 : M_PI / 2;
    push s = {bumpy_ball(0), bumpy_ball(other), bumpy_ball(other)};
    assert_int_equal(slide(&s, NULL), related);
    push_close(&s);
  }
}

/* The result has the same bytes for any number of threads. */
static void a_slide_is_the_same_on_any_threads(void **state) {
  (void)state;
  push s[2];
  for (int i = 0; i < 2; i++) {
    const orb_context_options config = {.threads = i == 0 ? 1 : 3};
    orb_context *own, *before = ctx;
    push_open(&s[i]);
    assert_int_equal(orb_context_create(&config, &own), ORB_OK);
    ctx = own;
    assert_true(slide(&s[i], NULL));
    ctx = before;
    orb_context_destroy(own);
  }
  assert_memory_equal(s[0].start.positions, s[1].start.positions, 3 * (size_t)s[0].a.vertex_count * sizeof(double));
  push_close(&s[0]);
  push_close(&s[1]);
}

/* Each vertex of an icosahedron has its five neighbours once. All corners have 60°, and two triangles lie beside an
 * edge. */
static void a_body_lists_its_edges_once(void **state) {
  (void)state;
  orb_mesh mesh = shape_icosahedron(ctx);
  orb_body body = {0};
  assert_int_equal(orb_body_create(ctx, &mesh, &body), ORB_OK);
  assert_int_equal(body.start[body.count], 60);
  for (int32_t v = 0; v < body.count; v++) {
    int32_t seen = 0;
    assert_int_equal(body.start[v + 1] - body.start[v], 5);
    for (int32_t i = body.start[v]; i < body.start[v + 1]; i++) {
      assert_int_not_equal(body.next[i], v);
      assert_false(seen & 1 << body.next[i]);
      seen |= 1 << body.next[i];
      assert_true(fabs(body.weight[i] - 1 / sqrt(3)) < 1e-12);
    }
  }
  orb_body_free(ctx, &body);
  shape_free(ctx, &mesh);
}

/* Surroundings that are listed beforehand change nothing. */
static void surroundings_are_shared(void **state) {
  (void)state;
  orb_mesh a = creature(3);
  scale_to_sphere(&a);
  int32_t *near = neighbours(&a);
  const orb_rough_map map = {near, near};
  orb_surroundings around;
  orb_elastic_pose pose[2] = {pose_of(&a), pose_of(&a)};
  double bend[2];
  assert_int_equal(orb_surroundings_create(ctx, &a, &around), ORB_OK);
  for (int i = 0; i < 2; i++) {
    assert_int_equal(orb_elastic_register(ctx, &a, &a, i ? &around : NULL, &map, NULL, &pose[i], &bend[i]), ORB_OK);
  }
  assert_memory_equal(pose[0].position, pose[1].position, 3 * (size_t)a.vertex_count * sizeof(double));
  assert_memory_equal(&bend[0], &bend[1], sizeof(double));
  orb_surroundings_free(ctx, &around);
  pose_free(&pose[0]);
  pose_free(&pose[1]);
  orb_free(ctx, near);
  shape_free(ctx, &a);
}

/* A map of the wrong limbs bends more. */
static void wrong_limbs_bend(void **state) {
  (void)state;
  orb_mesh a = creature(3), ball = shape_ball(ctx, 3);
  double right, wrong;
  scale_to_sphere(&a);
  int32_t *same = orb_alloc(ctx, (size_t)a.vertex_count, sizeof *same), *forth = neighbours(&a), *back = neighbours(&a);
  for (int32_t v = 0; v < a.vertex_count; v++) {
    same[v] = v;
    double best[2] = {-2, -2};
    for (int32_t u = 0; u < a.vertex_count; u++) { /* x, y, z → y, z, x and back */
      const double *p = ball.positions + 3 * (size_t)v, *q = ball.positions + 3 * (size_t)u;
      double there = p[1] * q[0] + p[2] * q[1] + p[0] * q[2], here = q[1] * p[0] + q[2] * p[1] + q[0] * p[2];
      forth[v] = there > best[0] ? u : forth[v];
      back[v] = here > best[1] ? u : back[v];
      best[0] = fmax(best[0], there);
      best[1] = fmax(best[1], here);
    }
  }
  orb_rough_map identity = {same, same}, turned = {forth, back};
  orb_elastic_pose pose = pose_of(&a);
  assert_int_equal(orb_elastic_register(ctx, &a, &a, NULL, &identity, NULL, &pose, &right), ORB_OK);
  assert_int_equal(orb_elastic_register(ctx, &a, &a, NULL, &turned, NULL, &pose, &wrong), ORB_OK);
  assert_true(right < 0.01);
  assert_true(wrong > 0.1);
  pose_free(&pose);
  orb_free(ctx, same);
  orb_free(ctx, forth);
  orb_free(ctx, back);
  shape_free(ctx, &a);
  shape_free(ctx, &ball);
}

/* The same creature, rotated, larger and with a finer mesh: each vertex goes to its place. */
static void a_copy_is_matched(void **state) {
  (void)state;
  orb_mesh a = creature(3), b = creature(4);
  orb_match match;
  orb_extent extent;
  double sum = 0;
  for (int32_t v = 0; v < b.vertex_count; v++) {
    double *p = b.positions + 3 * (size_t)v, x = p[0];
    p[0] = 10 * p[1] + 5;
    p[1] = 10 * p[2];
    p[2] = 10 * x;
  }
  orb_mesh_extent(&a, &extent);
  assert_int_equal(orb_match_find(ctx, &a, &b, NULL, 1, &match), ORB_OK);
  assert_true(match.is_found);
  assert_true(match.bend < 0.1); /* wrong limbs bend the same creature more, even on its own mesh: the test above */
  assert_true(match.lead > 2);
  assert_true(match.pairs.count >= 6);
  assert_int_equal(orb_match_target(ctx, &match, 0, 1, &match.target), ORB_OK);
  for (int32_t v = 0; v < b.vertex_count; v++) {
    const double *p = b.positions + 3 * (size_t)v;
    const double truth[3] = {p[2] / 10, (p[0] - 5) / 10, p[1] / 10};
    sum += distance(match.target + 3 * (size_t)v, truth) / b.vertex_count;
  }
  assert_true(sum < 0.02 * extent.diagonal);
  for (int32_t k = 0; k < match.pairs.count; k++) {
    const double *p = b.positions + 3 * (size_t)match.pairs.second[k];
    const double truth[3] = {p[2] / 10, (p[0] - 5) / 10, p[1] / 10};
    assert_true(distance(a.positions + 3 * (size_t)match.pairs.first[k], truth) < 0.08 * extent.diagonal);
  }
  orb_match_free(ctx, &match);
  shape_free(ctx, &a);
  shape_free(ctx, &b);
}

static void threads_change_nothing(void **state) {
  (void)state;
  orb_mesh a = creature(3), b = creature(3);
  orb_match one, other;
  orb_context_options options = {.threads = 3};
  orb_context *three;
  assert_int_equal(orb_context_create(&options, &three), ORB_OK);
  assert_int_equal(orb_match_find(ctx, &a, &b, NULL, 1, &one), ORB_OK);
  assert_int_equal(orb_match_find(three, &a, &b, NULL, 1, &other), ORB_OK);
  assert_true(one.is_found && other.is_found);
  assert_memory_equal(&one.pairs, &other.pairs, sizeof one.pairs);
  assert_int_equal(one.other_count, other.other_count);
  assert_memory_equal(one.other, other.other, sizeof one.other);
  assert_memory_equal(&one.cost, &other.cost, sizeof one.cost);
  assert_memory_equal(&one.clear, &other.clear, sizeof one.clear);
  assert_int_equal(orb_match_target(ctx, &one, 0, 1, &one.target), ORB_OK);
  assert_int_equal(orb_match_target(three, &other, 0, 1, &other.target), ORB_OK);
  assert_memory_equal(one.target, other.target, 3 * (size_t)b.vertex_count * sizeof *one.target);
  orb_match_free(ctx, &one);
  orb_match_free(three, &other);
  orb_context_destroy(three);
  shape_free(ctx, &a);
  shape_free(ctx, &b);
}

/* A ball and an icosahedron have no match but rotations; that is not an error. */
static void few_vertices_are_matched_by_rotations(void **state) {
  (void)state;
  orb_mesh a = shape_icosahedron(ctx), b = shape_ball(ctx, 2);
  orb_match match;
  assert_int_equal(orb_match_find(ctx, &a, &b, NULL, 1, &match), ORB_OK);
  assert_true(match.is_found);
  assert_int_equal(orb_match_target(ctx, &match, 0, 1, &match.target), ORB_OK);
  for (int32_t i = 0; i < 3 * b.vertex_count; i++) {
    assert_true(isfinite(match.target[i]));
  }
  orb_match_free(ctx, &match);
  shape_free(ctx, &a);
  shape_free(ctx, &b);
}

/* The squared distance in position and half-weighted normal. */
static double away(const double *x, const double *n, const double *y, const double *m) {
  double sum = 0;
  for (int k = 0; k < 3; k++) {
    sum += (x[k] - y[k]) * (x[k] - y[k]) + 0.25 * (n[k] - m[k]) * (n[k] - m[k]);
  }
  return sum;
}

/* The search by boxes finds the same vertex as a search of all vertices, even after they have moved from the places by
 * which they were put into blocks, and for any number of them. */
static void the_nearest_vertex_is_found(void **state) {
  (void)state;
  enum { MOST = 3500 };
  static const int32_t counts[] = {1, 15, 16, 17, 1024, 1025, 2048, 2049, MOST};
  static double at[3 * MOST], normal[3 * MOST];
  uint64_t bits = 88172645463325252ULL;
  for (size_t c = 0; c < sizeof counts / sizeof *counts; c++) {
    const int32_t n = counts[c];
    orb_searched searched;
    for (int round = 0; round < 2; round++) {
      for (int32_t i = 0; i < 3 * n; i++) {
        bits = bits * 6364136223846793005ULL + 1442695040888963407ULL;
        at[i] = (double)(bits >> 40) / (1 << 24);
        normal[i] = (double)(bits >> 20 & 0xffffff) / (1 << 24) - 0.5;
      }
      if (round == 0) {
        assert_int_equal(orb_searched_create(ctx, at, normal, n, &searched), ORB_OK);
      }
      orb_searched_fill(at, normal, &searched);
      for (int32_t q = 0; q < 200; q++) {
        const double x[3] = {at[q % n] + 0.1, at[(q + 1) % n], at[(q + 2) % n] - 0.2}, *m = normal + 3 * (q % n);
        const int32_t hint = q % 3 == 0 ? -1 : q % 3 == 1 ? q % n : (q * 7919) % n; /* none, a near one, any one */
        const int32_t found = orb_searched_nearest(&searched, x, m, hint);
        double least = INFINITY;
        for (int32_t v = 0; v < n; v++) {
          least = fmin(least, away(x, m, at + 3 * v, normal + 3 * v));
        }
        assert_true(away(x, m, at + 3 * found, normal + 3 * found) <= least * (1 + 1e-5));
      }
    }
    orb_searched_free(ctx, &searched);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(a_rotation_is_found),
                                     cmocka_unit_test(a_bent_tube_is_found),
                                     cmocka_unit_test(anchors_reach_their_places),
                                     cmocka_unit_test(a_slide_undoes_a_push),
                                     cmocka_unit_test(an_anchor_leads_a_slide),
                                     cmocka_unit_test(a_slide_ends_where_shapes_do_not_fit),
                                     cmocka_unit_test(a_slide_ends_where_reliefs_are_unrelated),
                                     cmocka_unit_test(a_slide_is_the_same_on_any_threads),
                                     cmocka_unit_test(a_body_lists_its_edges_once),
                                     cmocka_unit_test(surroundings_are_shared),
                                     cmocka_unit_test(wrong_limbs_bend),
                                     cmocka_unit_test(a_copy_is_matched),
                                     cmocka_unit_test(threads_change_nothing),
                                     cmocka_unit_test(the_nearest_vertex_is_found),
                                     cmocka_unit_test(few_vertices_are_matched_by_rotations)};
  return cmocka_run_group_tests(tests, context_one_thread, context_end);
}
