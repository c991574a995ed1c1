/* A hand that a pose has crumpled opens again: fingers that lie on other fingers go to their own. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "elastic/elastic.h"
#include "numeric/vec3.h"
#include "support_context.h"
#include "support_shapes.h"

enum { FINGERS = 5, LEVELS = 4 };
/* Heights, of which the ball of the body reaches from −2 to 2, and what lies above HAND is the hand. */
static const double BALL = 2, WRIST = 3, TIP = 3.9, HAND = 3;
static const double DRAWN = 14; /* how much denser the vertices are at the hand */

/* Directions from the middle of the body to the tips of four fingers in a row and of a thumb beside them, before they
 * are scaled to length 1. The arm points along z. */
static const double finger[FINGERS][3] = {{-0.12, 0, 1}, {-0.04, 0, 1}, {0.04, 0, 1}, {0.12, 0, 1}, {0.13, 0.1, 1}};

/* The distance of the surface from the middle in a direction of length 1: a ball, an arm and fingers. */
static double radius(const double p[3]) {
  double most = 0;
  for (int i = 0; i < FINGERS; i++) {
    const double *f = finger[i], cosine = orb_dot(p, f) / sqrt(orb_dot(f, f));
    most = fmax(most, exp(-1500 * (1 - cosine)) * (i == FINGERS - 1 ? 0.75 : 1));
  }
  return BALL + (WRIST - BALL) * exp(-60 * (1 - p[2])) + (TIP - WRIST) * most;
}

/* A body of area 4π with one arm and a hand, to which the ball's vertices are drawn. */
static orb_mesh body(void) {
  orb_mesh mesh = shape_ball(ctx, LEVELS);
  orb_extent extent;
  for (int32_t v = 0; v < mesh.vertex_count; v++) {
    double *p = mesh.positions + 3 * (size_t)v;
    const double angle = 2 * atan(tan(acos(fmax(-1, fmin(1, p[2]))) / 2) / DRAWN), around = atan2(p[1], p[0]);
    const double q[3] = {sin(angle) * cos(around), sin(angle) * sin(around), cos(angle)}, r = radius(q);
    for (int k = 0; k < 3; k++) {
      p[k] = r * q[k];
    }
  }
  orb_mesh_extent(&mesh, &extent);
  for (int32_t i = 0; i < 3 * mesh.vertex_count; i++) {
    mesh.positions[i] *= sqrt(4 * M_PI / extent.area);
  }
  return mesh;
}

/* The coordinate z above which the hand lies. */
static double wrist_of(const orb_mesh *mesh) {
  double top = 0;
  for (int32_t v = 0; v < mesh->vertex_count; v++) {
    top = fmax(top, mesh->positions[3 * (size_t)v + 2]);
  }
  return top * HAND / TIP;
}

typedef struct scene {
  orb_mesh a, b;
  orb_elastic_pose pose;
} scene;

/* Both meshes are the same; in the pose, the hand is turned inside out: left is right. */
static void open_scene(orb_context *context, scene *s) {
  s->a = body();
  s->b = body();
  const size_t n = (size_t)s->a.vertex_count;
  s->pose = (orb_elastic_pose){orb_alloc(context, 3 * n, sizeof(double)), orb_alloc(context, 9 * n, sizeof(double))};
  assert_non_null(s->pose.position);
  assert_non_null(s->pose.rotation);
  memcpy(s->pose.position, s->a.positions, 3 * n * sizeof(double));
  const double wrist = wrist_of(&s->a);
  for (int32_t v = 0; v < s->a.vertex_count; v++) {
    const double share = fmin(1, fmax(0, (s->a.positions[3 * (size_t)v + 2] - wrist) / 0.05));
    s->pose.position[3 * (size_t)v] *= 1 - 2 * share;
  }
  for (size_t i = 0; i < 9 * n; i++) {
    s->pose.rotation[i] = i % 9 % 4 == 0;
  }
}

static void close_scene(orb_context *context, scene *s) {
  orb_free(context, s->pose.position);
  orb_free(context, s->pose.rotation);
  shape_free(ctx, &s->a);
  shape_free(ctx, &s->b);
}

/* The mean distance of the hand's vertices from where they belong. */
static double hand_off(const scene *s) {
  const double wrist = wrist_of(&s->b);
  double sum = 0;
  int32_t count = 0;
  for (int32_t v = 0; v < s->b.vertex_count; v++) {
    if (s->b.positions[3 * (size_t)v + 2] > wrist) {
      sum += sqrt(orb_distance2(s->pose.position + 3 * (size_t)v, s->b.positions + 3 * (size_t)v));
      count++;
    }
  }
  assert_true(count > 60);
  return sum / count;
}

/* Closest points leave fingers on other fingers: these are 0.08 apart. */
static void a_crumpled_hand_opens(void **state) {
  (void)state;
  for (int mends = 0; mends < 2; mends++) {
    scene s;
    open_scene(ctx, &s);
    assert_int_equal(orb_elastic_settle(ctx, &s.a, &s.b, NULL, 3, mends, &s.pose), ORB_OK);
    assert_true(mends ? hand_off(&s) < 0.01 : hand_off(&s) > 0.06);
    close_scene(ctx, &s);
  }
}

/* A hand that has no fault stays as it is, to the byte. */
static void a_right_hand_stays(void **state) {
  (void)state;
  scene s[2];
  for (int mends = 0; mends < 2; mends++) {
    open_scene(ctx, &s[mends]);
    const size_t size = 3 * (size_t)s[mends].a.vertex_count * sizeof(double);
    memcpy(s[mends].pose.position, s[mends].a.positions, size);
    assert_int_equal(orb_elastic_settle(ctx, &s[mends].a, &s[mends].b, NULL, 3, mends, &s[mends].pose), ORB_OK);
    assert_memory_equal(s[mends].pose.position, s[0].pose.position, size);
  }
  close_scene(ctx, &s[0]);
  close_scene(ctx, &s[1]);
}

/* The vertex of least or greatest coordinate x in the hand: on the outer finger, or on the thumb. */
static int32_t outermost(const orb_mesh *mesh, double sign) {
  const double wrist = wrist_of(mesh);
  int32_t best = -1;
  for (int32_t v = 0; v < mesh->vertex_count; v++) {
    if (mesh->positions[3 * (size_t)v + 2] > wrist &&
        (best < 0 || sign * mesh->positions[3 * (size_t)v] > sign * mesh->positions[3 * (size_t)best])) {
      best = v;
    }
  }
  return best;
}

/* An anchor on the hand holds while the hand opens. */
static void an_anchor_holds(void **state) {
  (void)state;
  scene s;
  open_scene(ctx, &s);
  const int32_t v = outermost(&s.a, -1);
  orb_elastic_anchor anchor = {.vertex = v};
  const orb_elastic_anchors anchors = {1, &anchor};
  memcpy(anchor.place, s.b.positions + 3 * (size_t)v, sizeof anchor.place);
  anchor.place[0] -= 0.02;
  assert_int_equal(orb_elastic_settle(ctx, &s.a, &s.b, &anchors, 3, 1, &s.pose), ORB_OK);
  assert_true(hand_off(&s) < 0.01);
  assert_true(sqrt(orb_distance2(s.pose.position + 3 * (size_t)v, anchor.place)) < 0.01);
  close_scene(ctx, &s);
}

static void threads_change_nothing(void **state) {
  (void)state;
  const orb_context_options options = {.threads = 3};
  orb_context *three;
  scene s[2];
  assert_int_equal(orb_context_create(&options, &three), ORB_OK);
  for (int i = 0; i < 2; i++) {
    orb_context *context = i == 0 ? ctx : three;
    open_scene(context, &s[i]);
    assert_int_equal(orb_elastic_settle(context, &s[i].a, &s[i].b, NULL, 3, 1, &s[i].pose), ORB_OK);
  }
  assert_memory_equal(s[0].pose.position, s[1].pose.position, 3 * (size_t)s[0].a.vertex_count * sizeof(double));
  assert_memory_equal(s[0].pose.rotation, s[1].pose.rotation, 9 * (size_t)s[0].a.vertex_count * sizeof(double));
  close_scene(ctx, &s[0]);
  close_scene(three, &s[1]);
  orb_context_destroy(three);
}

typedef struct rationed {
  int64_t left, calls; /* until an allocation fails, and made */
} rationed;

static void *alloc_or_fail(void *arg, size_t size) {
  rationed *r = arg;
  r->calls++;
  return r->left-- == 0 ? NULL : malloc(size);
}

static void free_it(void *arg, void *block) {
  (void)arg;
  free(block);
}

/* The pose is made by `ctx`, so that each allocation that fails is one of the registration. */
static int64_t settle_rationed(int64_t at, orb_status *status) {
  rationed ration = {at, 0};
  const orb_context_options options = {.threads = 1, .allocator = {alloc_or_fail, free_it, &ration}};
  orb_context *of;
  scene s;
  assert_int_equal(orb_context_create(&options, &of), ORB_OK);
  const int64_t before = ration.calls;
  open_scene(ctx, &s);
  *status = orb_elastic_settle(of, &s.a, &s.b, NULL, 2, 1, &s.pose);
  close_scene(ctx, &s);
  orb_context_destroy(of); /* it checks that nothing is left */
  return ration.calls - before;
}

/* Some allocations fail once: that is reported, and nothing is left behind. */
static void memory_runs_out(void **state) {
  (void)state;
  orb_status status;
  const int64_t calls = settle_rationed(INT64_MAX, &status);
  assert_int_equal(status, ORB_OK);
  assert_true(calls > 100);
  for (int64_t at = 1; at <= calls; at += calls / 12) { /* the allocation of the context comes before these */
    (void)settle_rationed(at, &status);
    assert_int_equal(status, ORB_E_NO_MEMORY);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(a_crumpled_hand_opens), cmocka_unit_test(a_right_hand_stays),
                                     cmocka_unit_test(an_anchor_holds), cmocka_unit_test(threads_change_nothing),
                                     cmocka_unit_test(memory_runs_out)};
  return cmocka_run_group_tests(tests, context_one_thread, context_end);
}
