/* The relief of a surface, where geometry tells it, and what a slide makes of it. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#include "base/memory.h"
#include "elastic/relief.h"
#include "elastic/slide.h"
#include "numeric/vec3.h"
#include "support_context.h"
#include "support_shapes.h"

/* Two bumps beside the equator: their directions, heights and widths. */
enum { BUMPS = 2 };
static const double bump[BUMPS][3] = {{1, 0, 0}, {-0.28, 0.96, 0}};
static const double bump_height[BUMPS] = {0.05, 0.03}, bump_width[BUMPS] = {0.2, 0.15};

static double radius(const double d[3], double height) {
  double r = 1;
  for (int i = 0; i < BUMPS; i++) {
    r += height * bump_height[i] * exp(-2 * (1 - orb_dot(d, bump[i])) / (bump_width[i] * bump_width[i]));
  }
  return r;
}

/* A ball with bumps that are this many times as high. */
static orb_mesh bumpy(int levels, double height) {
  orb_mesh mesh = shape_ball(ctx, levels);
  for (int32_t v = 0; v < mesh.vertex_count; v++) {
    double *p = mesh.positions + 3 * (size_t)v, r = radius(p, height);
    for (int k = 0; k < 3; k++) {
      p[k] *= r;
    }
  }
  return mesh;
}

static orb_relief relief_of(const orb_mesh *mesh, orb_body *body) {
  orb_relief relief = {0};
  *body = (orb_body){0};
  assert_int_equal(orb_body_create(ctx, mesh, body), ORB_OK);
  assert_int_equal(orb_relief_create(ctx, body, orb_relief_grain(body, body), &relief), ORB_OK);
  return relief;
}

static int32_t nearest_vertex(const orb_mesh *mesh, const double d[3]) {
  int32_t best = 0;
  for (int32_t v = 0; v < mesh->vertex_count; v++) {
    best = orb_distance2(mesh->positions + 3 * (size_t)v, d) < orb_distance2(mesh->positions + 3 * (size_t)best, d)
               ? v
               : best;
  }
  return best;
}

/* The heights of a ball are noise of its triangles: they count as none. */
static void a_ball_has_no_relief(void **state) {
  (void)state;
  orb_mesh ball = shape_ball(ctx, 4);
  orb_body body;
  orb_relief relief = relief_of(&ball, &body);
  for (int32_t i = 0; i < ORB_RELIEF_SIZES * ball.vertex_count; i++) {
    assert_true(relief.height[i] == 0);
  }
  orb_relief_free(ctx, &relief);
  orb_body_free(ctx, &body);
  shape_free(ctx, &ball);
}

/* The top of the higher bump stands out most, and beside it the relief slopes up to it. */
static void relief_rises_to_a_bump(void **state) {
  (void)state;
  orb_mesh mesh = bumpy(4, 1);
  orb_body body;
  orb_relief relief = relief_of(&mesh, &body);
  const int32_t top = nearest_vertex(&mesh, bump[0]);
  for (size_t s = 0; s < ORB_RELIEF_SIZES; s++) {
    double mean = 0, mass = 0, squares = 0;
    for (int32_t v = 0; v < mesh.vertex_count; v++) {
      const double h = relief.height[ORB_RELIEF_SIZES * (size_t)v + s];
      const double *p = mesh.positions + 3 * (size_t)v, *up = relief.slope + 3 * (ORB_RELIEF_SIZES * (size_t)v + s);
      const double away = acos(orb_dot(p, bump[0]) / orb_length(p));
      double to[3];
      assert_true(h <= relief.height[ORB_RELIEF_SIZES * (size_t)top + s] || away < 0.1);
      orb_sub(mesh.positions + 3 * (size_t)top, p, to);
      if (away > 0.1 && away < 0.2) {
        assert_true(orb_dot(up, to) > 0);
      }
      mass += body.mass[v];
      mean += body.mass[v] * h;
      squares += body.mass[v] * h * h;
    }
    assert_true(fabs(mean / mass) < 1e-9 && fabs(squares / mass - 1) < 1e-9);
  }
  orb_relief_free(ctx, &relief);
  orb_body_free(ctx, &body);
  shape_free(ctx, &mesh);
}

/* The relief is the same within a tenth on triangles half as large. */
static void relief_does_not_depend_on_triangles(void **state) {
  (void)state;
  orb_mesh coarse = bumpy(4, 1), fine = bumpy(5, 1);
  orb_body body[2] = {{0}, {0}};
  orb_relief relief[2] = {{0}, {0}};
  assert_int_equal(orb_body_create(ctx, &coarse, &body[0]), ORB_OK);
  assert_int_equal(orb_body_create(ctx, &fine, &body[1]), ORB_OK);
  const double grain = orb_relief_grain(&body[0], &body[1]);
  double most = 0, off = 0;
  assert_int_equal(orb_relief_create(ctx, &body[0], grain, &relief[0]), ORB_OK);
  assert_int_equal(orb_relief_create(ctx, &body[1], grain, &relief[1]), ORB_OK);
  for (int32_t v = 0; v < coarse.vertex_count; v++) { /* the ball's first vertices are those of the coarser one */
    assert_true(orb_distance2(coarse.positions + 3 * (size_t)v, fine.positions + 3 * (size_t)v) < 1e-20);
    const size_t at = ORB_RELIEF_SIZES * (size_t)v + 1;
    most = fmax(most, fabs(relief[1].height[at]));
    off = fmax(off, fabs(relief[0].height[at] - relief[1].height[at]));
  }
  assert_true(off < 0.1 * most);
  for (int i = 0; i < 2; i++) {
    orb_relief_free(ctx, &relief[i]);
    orb_body_free(ctx, &body[i]);
  }
  shape_free(ctx, &coarse);
  shape_free(ctx, &fine);
}

/* A shape and its own relief share all. With each vertex placed at another one, they share nothing: the squared
 * difference of two unrelated heights of variance 1 is 2, but what counts is bounded by 1. */
static void noise_is_what_reliefs_do_not_share(void **state) {
  (void)state;
  orb_mesh mesh = bumpy(4, 1);
  orb_body body;
  orb_relief relief = relief_of(&mesh, &body);
  int32_t *place = orb_alloc(ctx, (size_t)mesh.vertex_count, sizeof *place);
  assert_non_null(place);
  for (int32_t v = 0; v < mesh.vertex_count; v++) {
    place[v] = v;
  }
  assert_true(orb_relief_noise(&body, &relief, &relief, place) == 0);
  double last = 0;
  for (int k = 1; k < 4; k++) { /* rotated a little, and more */
    for (int32_t v = 0; v < mesh.vertex_count; v++) {
      const double *p = mesh.positions + 3 * (size_t)v, c = cos(0.1 * k), s = sin(0.1 * k);
      const double d[3] = {c * p[0] - s * p[1], s * p[0] + c * p[1], p[2]};
      place[v] = nearest_vertex(&mesh, d);
    }
    const double noise = orb_relief_noise(&body, &relief, &relief, place);
    assert_true(noise > last && noise <= 1);
    last = noise;
  }
  orb_free(ctx, place);
  orb_relief_free(ctx, &relief);
  orb_body_free(ctx, &body);
  shape_free(ctx, &mesh);
}

/* Steps from beside the bump, for the heights of its top, lead to the top. */
static void steps_lead_to_the_same_height(void **state) {
  (void)state;
  orb_mesh mesh = bumpy(4, 1);
  orb_body body;
  orb_relief relief = relief_of(&mesh, &body);
  const int32_t top = nearest_vertex(&mesh, bump[0]);
  const double beside[3] = {cos(0.15), 0, sin(0.15)};
  double p[3], step[3], from[3];
  memcpy(p, mesh.positions + 3 * (size_t)nearest_vertex(&mesh, beside), sizeof p);
  const double before = sqrt(orb_distance2(p, mesh.positions + 3 * (size_t)top));
  for (int i = 0; i < 20; i++) {
    const int32_t u = nearest_vertex(&mesh, p);
    orb_sub(p, mesh.positions + 3 * (size_t)u, from);
    orb_relief_step(relief.height + ORB_RELIEF_SIZES * (size_t)top, &relief, u, from, body.normal + 3 * (size_t)u, 0.1,
                    step);
    assert_true(orb_length(step) < 0.05 && fabs(orb_dot(step, body.normal + 3 * (size_t)u)) < 1e-12);
    for (int k = 0; k < 3; k++) {
      p[k] += step[k];
    }
  }
  assert_true(sqrt(orb_distance2(p, mesh.positions + 3 * (size_t)top)) < 0.5 * before);
  orb_relief_free(ctx, &relief);
  orb_body_free(ctx, &body);
  shape_free(ctx, &mesh);
}

/* The mean distance of the vertices near the bumps from their places, after a slide of a ball with bumps that begins
 * rotated by `angle` about the axis of the equator. */
static double slid(double angle) {
  orb_mesh a = bumpy(4, 1), b = bumpy(4, 1), start = bumpy(4, 0);
  double off = 0;
  int count = 0, fits;
  for (int32_t v = 0; v < start.vertex_count; v++) {
    double *p = start.positions + 3 * (size_t)v;
    const double x = cos(angle) * p[0] - sin(angle) * p[1], y = sin(angle) * p[0] + cos(angle) * p[1];
    const double d[3] = {x, y, p[2]}, r = radius(d, 1);
    for (int k = 0; k < 3; k++) {
      p[k] = r * d[k];
    }
  }
  assert_int_equal(orb_elastic_slide(ctx, &a, &b, NULL, start.positions, &fits), ORB_OK);
  assert_true(fits);
  for (int32_t v = 0; v < a.vertex_count; v++) {
    const double *p = a.positions + 3 * (size_t)v;
    if (orb_dot(p, bump[0]) > 0.97 || orb_dot(p, bump[1]) > 0.97) {
      off += sqrt(orb_distance2(start.positions + 3 * (size_t)v, b.positions + 3 * (size_t)v));
      count++;
    }
  }
  shape_free(ctx, &a);
  shape_free(ctx, &b);
  shape_free(ctx, &start);
  return off / count;
}

/* Ten rounds leave half of a rotation that is twice as wide as the bumps, or all of it. A slide that still moves goes
 * on. */
static void a_slide_goes_on_while_it_moves(void **state) {
  (void)state;
  assert_true(slid(0.3) < 0.03);
  assert_true(slid(0.4) < 0.03);
}

/* A map of least energy may rotate a ball freely. The normals of its low bumps hardly hold it: without the relief,
 * nearly the whole rotation would be left. */
static void low_bumps_hold_a_slide(void **state) {
  (void)state;
  assert_true(slid(0.15) < 0.03);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(a_ball_has_no_relief),
                                     cmocka_unit_test(relief_rises_to_a_bump),
                                     cmocka_unit_test(relief_does_not_depend_on_triangles),
                                     cmocka_unit_test(steps_lead_to_the_same_height),
                                     cmocka_unit_test(low_bumps_hold_a_slide),
                                     cmocka_unit_test(a_slide_goes_on_while_it_moves),
                                     cmocka_unit_test(noise_is_what_reliefs_do_not_share)};
  return cmocka_run_group_tests(tests, context_one_thread, context_end);
}
