/* Limbs that a map twists: the rings around them, the angle of the twist, and its removal. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "align/map/levels.h"
#include "align/map/twist/limb.h"
#include "align/map/twist/patch.h"
#include "align/map/twist/twist.h"
#include "align/map/twist/untwist.h"
#include "align/map/whole.h"
#include "numeric/predicates.h"
#include "numeric/vec3.h"
#include "support_shapes.h"

#define DEGREES (180 / M_PI)

static const double axis[3] = {0.6, 0, 0.8}, across[3] = {0, 1, 0}, third[3] = {-0.8, 0, 0.6};
static const double REACH = 1.2;              /* of the limb beyond the ball */
static const double FULL = 0.15, FADED = 0.7; /* angles from the axis between which a twist fades away */
static const double WOUND = 1.5;              /* the same of a whole turn, which shears more */
static const double ROOT = 1.55, BODY = 1.9;  /* the same for a lift */

/* A ball with one limb, and its own directions as its sphere. */
typedef struct creature {
  orb_context *ctx;
  orb_mesh mesh;
  double *sphere; /* directions */
  double *image;  /* the same, twisted */
  double *x;      /* positions of the shape that is mapped */
  orb_map_surface surface;
  int32_t pole;
} creature;

static double from_axis(const double p[3]) {
  return acos(fmin(1, fmax(-1, orb_dot(p, axis))));
}

/* Rodrigues' rotation about a unit vector. */
static void rotate(const double about[3], double angle, double p[3]) {
  double c[3], along = orb_dot(about, p);
  orb_cross(about, p, c);
  for (int k = 0; k < 3; k++) {
    p[k] = p[k] * cos(angle) + c[k] * sin(angle) + about[k] * along * (1 - cos(angle));
  }
}

/* 1 up to `from`, 0 beyond `to`. */
static double fading(double at, double from, double to) {
  const double fade = fmin(1, fmax(0, (to - at) / (to - from)));
  return fade * fade * (3 - 2 * fade);
}

/* A ball with one limb. twist: the rotation of the limb's end, counterclockwise as seen from outside; bend: that of the
 * mapped shape's limb, most at its tip; lift: the same of the limb as a whole. */
static creature make_lifted(double reach, double twist, double bend, double lift) {
  creature c = {.pole = 0};
  assert_int_equal(orb_context_create(NULL, &c.ctx), ORB_OK);
  c.mesh = shape_ball(c.ctx, 6);
  size_t n = 3 * (size_t)c.mesh.vertex_count;
  c.sphere = malloc(n * sizeof *c.sphere);
  c.image = malloc(n * sizeof *c.image);
  c.x = malloc(n * sizeof *c.x);
  assert_true(c.sphere && c.image && c.x);
  memcpy(c.sphere, c.mesh.positions, n * sizeof *c.sphere);
  memcpy(c.image, c.mesh.positions, n * sizeof *c.image);
  for (int32_t v = 0; v < c.mesh.vertex_count; v++) {
    double *p = c.mesh.positions + 3 * (size_t)v, far = from_axis(p);
    c.pole = far < from_axis(c.sphere + 3 * (size_t)c.pole) ? v : c.pole;
    rotate(axis, twist * fading(far, FULL, fabs(twist) > M_PI ? WOUND : FADED), c.image + 3 * (size_t)v);
    for (int k = 0; k < 3; k++) {
      p[k] *= 1 + reach * exp(-30 * (1 - cos(far)));
    }
  }
  orb_aligned_shape shape = {.mesh = c.mesh, .points = c.sphere};
  assert_int_equal(orb_map_surface_create(c.ctx, &shape, &c.surface), ORB_OK);
  memcpy(c.x, c.surface.x, n * sizeof *c.x);
  for (int32_t v = 0; v < c.mesh.vertex_count; v++) {
    double out = orb_length(c.mesh.positions + 3 * (size_t)v);
    rotate(across, bend * (out - 1) / REACH, c.x + 3 * (size_t)v);
    rotate(across, lift * fading(from_axis(c.sphere + 3 * (size_t)v), ROOT, BODY), c.x + 3 * (size_t)v);
  }
  for (int32_t t = 0; t < c.mesh.triangle_count; t++) {
    const int32_t *v = c.mesh.triangles + 3 * (size_t)t;
    assert_true(orb_orient(c.image + 3 * (size_t)v[0], c.image + 3 * (size_t)v[1], c.image + 3 * (size_t)v[2]) > 0);
  }
  return c;
}

static creature make(double reach, double twist, double bend) {
  return make_lifted(reach, twist, bend, 0);
}

static void drop(creature *c) {
  orb_map_surface_free(c->ctx, &c->surface);
  shape_free(c->ctx, &c->mesh);
  free(c->sphere);
  free(c->image);
  free(c->x);
  orb_context_destroy(c->ctx);
}

static void find(creature *c, const int32_t *held, int32_t held_count, orb_map_twists *out) {
  orb_map_image map = {c->mesh.vertex_count, c->mesh.triangle_count, c->mesh.triangles, c->x, c->image};
  const orb_map_params params = orb_map_params_of(ORB_PRESET_DEFAULT);
  assert_int_equal(orb_map_twists_find(c->ctx, &params, &c->surface, &map, held, held_count, out), ORB_OK);
}

/* Compares bit for bit, except for the padding, which is never set. */
static void assert_same_place(const orb_place *a, const orb_place *b) {
  assert_int_equal(a->triangle, b->triangle);
  assert_memory_equal(a->at, b->at, sizeof a->at);
}

/* On a round part, rings are circles, and angles along them are angles around the axis. */
static void rotations_follow_the_rings(void **state) {
  (void)state;
  const orb_map_params params = orb_map_params_of(ORB_PRESET_DEFAULT);
  creature c = make(0, 0, 0);
  size_t n = (size_t)c.mesh.vertex_count;
  unsigned char *inside = calloc(n, 1);
  double *height = malloc(n * sizeof *height);
  assert_true(inside && height);
  for (size_t v = 0; v < n; v++) {
    inside[v] = from_axis(c.sphere + 3 * v) < FADED ? ORB_PATCH_LIMB : 0;
  }
  inside[c.pole] = ORB_PATCH_END;
  assert_int_equal(orb_map_limb_heights(c.ctx, &params, &c.surface, inside, height), ORB_OK);
  for (int i = 0; i < 200; i++) {
    double far = 0.25 + 0.25 * i / 200, at = 0.7 * i, angle = (i % 9 - 4) * 0.8, p[3], q[3], wanted[3];
    for (int k = 0; k < 3; k++) {
      p[k] = cos(far) * axis[k] + sin(far) * (cos(at) * across[k] + sin(at) * third[k]);
    }
    memcpy(wanted, p, sizeof wanted);
    rotate(axis, angle, wanted);
    orb_place place;
    orb_locate(c.surface.locator, p, -1, &place);
    assert_true(orb_map_limb_rotate(&c.surface, height, angle, &place));
    orb_map_surface_at(&c.surface, &place, NULL, q, NULL);
    assert_true(fabs(place.at[0] + place.at[1] + place.at[2] - 1) < 1e-9);
    assert_true(fabs(from_axis(q) - far) < 0.06 * far);
    assert_true(sqrt(orb_distance2(q, wanted)) < 0.12 * sin(far));
  }
  orb_place outside = {.triangle = 0, .at = {1, 0, 0}}, as_it_was = outside;
  for (int32_t t = 0; t < c.mesh.triangle_count; t++) {
    const double *p = c.sphere + 3 * (size_t)c.mesh.triangles[3 * (size_t)t];
    outside.triangle = orb_dot(p, axis) < -0.5 ? t : outside.triangle;
  }
  as_it_was.triangle = outside.triangle;
  assert_false(orb_map_limb_rotate(&c.surface, height, 1, &outside));
  assert_same_place(&outside, &as_it_was);
  free(inside);
  free(height);
  drop(&c);
}

/* How far all vertices are from where they belong, after this share of the twists is undone. */
static double distance_left(const creature *c, const orb_map_twists *t, double share) {
  double sum = 0;
  for (int32_t v = 0; v < c->mesh.vertex_count; v++) {
    orb_place place;
    double y[3];
    orb_locate(c->surface.locator, c->image + 3 * (size_t)v, -1, &place);
    (void)orb_map_twists_undo(t, &c->surface, share, share == 1, &place);
    orb_map_surface_at(&c->surface, &place, y, NULL, NULL);
    sum += sqrt(orb_distance2(y, c->surface.x + 3 * (size_t)v));
  }
  return sum;
}

/* Measures a twist with its sign, beyond half a turn as well, and undoes it. */
static void twists_are_measured_and_undone(void **state) {
  (void)state;
  const double degrees[] = {180, -180, 110, -150};
  for (int i = 0; i < 8; i++) {
    creature c = make(REACH, degrees[i / 2] / DEGREES, 0);
    orb_map_twists t;
    find(&c, &c.pole, i % 2, &t); /* with the tip known and without */
    assert_int_equal(t.count, 1);
    const orb_map_twist *limb = &t.limb[0];
    assert_true(from_axis(c.sphere + 3 * (size_t)limb->pole) < 0.15);
    double end = 0;
    for (int k = 0; k < limb->count; k++) {
      end = fabs(limb->angle[k]) > fabs(end) ? limb->angle[k] : end;
    }
    assert_true(fabs(end * DEGREES - degrees[i / 2]) < 20);
    assert_true(fabs(fabs(end) - limb->most) < 1e-12);
    assert_true(t.kept < 0.99);
    assert_true(distance_left(&c, &t, 1) < 0.25 * distance_left(&c, &t, 0));
    orb_map_twists_free(c.ctx, &t);
    drop(&c);
  }
}

/* A vertex about this far from the axis. */
static int32_t vertex_at(const creature *c, double far) {
  int32_t best = 0;
  for (int32_t v = 0; v < c->mesh.vertex_count; v++) {
    const double off = fabs(from_axis(c->sphere + 3 * (size_t)v) - far);
    best = off < fabs(from_axis(c->sphere + 3 * (size_t)best) - far) ? v : best;
  }
  return best;
}

/* How far undoing moves the middle of a triangle at most, of those nearer to the axis than `far`. */
static double most_moved(const creature *c, const orb_map_twists *t, double far) {
  double most = 0;
  for (int32_t i = 0; i < c->mesh.triangle_count; i++) {
    orb_place place = {.triangle = i, .at = {1.0 / 3, 1.0 / 3, 1.0 / 3}};
    double s[3], from[3], to[3];
    orb_map_surface_at(&c->surface, &place, from, s, NULL);
    if (from_axis(s) < far) {
      (void)orb_map_twists_undo(t, &c->surface, 1, 1, &place);
      orb_map_surface_at(&c->surface, &place, to, NULL, NULL);
      most = fmax(most, sqrt(orb_distance2(from, to)));
    }
  }
  return most;
}

/* Both ends of the limb are held, and the map winds what lies between by whole turns: they are counted and undone. What
 * is held keeps its place, and there is no way between. */
static void windings_between_held_vertices_are_undone(void **state) {
  (void)state;
  const struct {
    double turns, lift;
    int32_t held_beyond;
  } rows[] = {{1, 0, 2}, {-1, 0, 3}, {1, 170, 2}, {-1, 170, 1}};
  for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
    creature c = make_lifted(REACH, rows[i].turns * 2 * M_PI, 0, rows[i].lift / DEGREES);
    const int32_t held[4] = {vertex_at(&c, 1.52), c.pole, vertex_at(&c, 0.06), vertex_at(&c, 0.09)};
    orb_map_twists t;
    find(&c, held, 1 + rows[i].held_beyond, &t);
    assert_int_equal(t.count, 1);
    const orb_map_twist *limb = &t.limb[0];
    assert_int_equal(limb->pole, -1);
    assert_true(fabs(limb->angle[limb->count - 1] - rows[i].turns * 2 * M_PI) < 1e-9);
    assert_true(distance_left(&c, &t, 1) < 0.25 * distance_left(&c, &t, 0));
    assert_true(distance_left(&c, &t, 0.5) == distance_left(&c, &t, 0));
    assert_true(most_moved(&c, &t, 0.9 * FULL) < 0.02); /* what lies beyond stays; the tip is 0.1 wide there */
    for (int32_t k = 0; k < 1 + rows[i].held_beyond; k++) {
      orb_place place;
      double y[3];
      orb_locate(c.surface.locator, c.image + 3 * (size_t)held[k], -1, &place);
      (void)orb_map_twists_undo(&t, &c.surface, 1, 1, &place);
      orb_map_surface_at(&c.surface, &place, y, NULL, NULL);
      assert_true(sqrt(orb_distance2(y, c.surface.x + 3 * (size_t)held[k])) < 1e-3);
    }
    orb_map_twists_free(c.ctx, &t);
    drop(&c);
  }
}

/* A limb with held ends that is only lifted, bent, or twisted by less than a turn is not wound. */
static void posed_limbs_with_held_ends_stay(void **state) {
  (void)state;
  const double degrees[][3] = {{0, 0, 170}, {0, 100, 0},    {0, 80, 170},
                               {150, 0, 0}, {-150, 0, 170}, {250, 0, 0}}; /* twist, bend, lift */
  for (size_t i = 0; i < sizeof degrees / sizeof *degrees; i++) {
    creature c = make_lifted(REACH, degrees[i][0] / DEGREES, degrees[i][1] / DEGREES, degrees[i][2] / DEGREES);
    const int32_t held[3] = {vertex_at(&c, 1.52), c.pole, vertex_at(&c, 0.09)};
    orb_map_twists t;
    find(&c, held, 3, &t);
    assert_int_equal(t.count, 0);
    orb_map_twists_free(c.ctx, &t);
    drop(&c);
  }
}

/* The whole of it: the map of a wound tube is left for one of nearly no distortion, which no descent would reach. */
static void a_wound_map_is_unwound(void **state) {
  (void)state;
  creature c = make(REACH, 2 * M_PI, 0);
  int32_t held[3] = {vertex_at(&c, 1.52), c.pole, vertex_at(&c, 0.09)};
  for (int i = 0; i < 3; i++) {
    memcpy(c.image + 3 * (size_t)held[i], c.sphere + 3 * (size_t)held[i], sizeof(double[3]));
  }
  orb_aligned_shape fixed = {.mesh = c.mesh, .points = c.sphere, .landmark_vertices = held};
  orb_aligned_shape moving = {.mesh = c.mesh, .points = c.image, .landmark_vertices = held};
  const orb_map_guide guide = {.from = ORB_MAP_FROM_PINS};
  double energy[2], after;
  orb_map_run run = orb_map_run_of(c.ctx, &fixed, &moving, 0, 3, &guide, ORB_PRESET_DEFAULT);
  assert_int_equal(orb_map_run_open(&run, &guide, energy), ORB_OK);
  assert_true(energy[0] > 2);
  assert_int_equal(orb_map_levels_prepare(&run), ORB_OK);
  assert_int_equal(orb_map_untwist(&run, INFINITY), ORB_OK);
  assert_int_equal(orb_map_energy_of(&run, run.best, INFINITY, &after), ORB_OK);
  assert_true(after < 1.02); /* 1: an isometry */
  for (int i = 0; i < 3; i++) {
    assert_memory_equal(run.best + 3 * (size_t)held[i], c.sphere + 3 * (size_t)held[i], sizeof(double[3]));
  }
  orb_map_run_free(&run);
  drop(&c);
}

static void nothing_is_found(double twist, double bend, int both_ends_held) {
  creature c = make(REACH, twist / DEGREES, bend / DEGREES);
  orb_map_twists t;
  int32_t held[2] = {c.pole, c.pole};
  for (int32_t v = 0; v < c.mesh.vertex_count; v++) { /* a second one on the limb, where the twist is complete */
    held[1] = fabs(from_axis(c.sphere + 3 * (size_t)v) - 0.2) < 0.02 ? v : held[1];
  }
  assert_int_not_equal(held[0], held[1]);
  find(&c, held, both_ends_held ? 2 : 0, &t);
  assert_int_equal(t.count, 0);
  assert_true(twist != 0 || bend != 0 || fabs(t.kept - 1) < 1e-9); /* a map onto itself keeps all of the area halfway */
  orb_place place, as_it_was;
  orb_locate(c.surface.locator, axis, -1, &place);
  as_it_was = place;
  assert_false(orb_map_twists_undo(&t, &c.surface, 1, 1, &place));
  assert_same_place(&place, &as_it_was);
  orb_map_twists_free(c.ctx, &t);
  drop(&c);
}

static void what_is_no_twist_stays(void **state) {
  (void)state;
  nothing_is_found(0, 0, 0);
  nothing_is_found(40, 0, 0);
  nothing_is_found(0, 100, 0); /* a limb that is bent, not twisted */
  nothing_is_found(180, 0, 1); /* two partners on one limb are known: it is not untwisted */
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(rotations_follow_the_rings),
      cmocka_unit_test(twists_are_measured_and_undone),
      cmocka_unit_test(windings_between_held_vertices_are_undone),
      cmocka_unit_test(posed_limbs_with_held_ends_stay),
      cmocka_unit_test(a_wound_map_is_unwound),
      cmocka_unit_test(what_is_no_twist_stays),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
