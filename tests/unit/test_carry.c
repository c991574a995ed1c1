/* Carrying attributes: weights, blends of corners, padding, baked colours; values from geometry. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/memory.h"
#include "carry/bake.h"
#include "carry/corners.h"
#include "carry/pad.h"
#include "carry/skin.h"
#include "format/image.h"
#include "support_supermesh.h"

static int setup(void **state) {
  return orb_context_create(NULL, (orb_context **)state) == ORB_OK ? 0 : -1;
}
static int teardown(void **state) {
  orb_context_destroy(*state);
  return 0;
}

static double sum_of(const float weight[4]) {
  return (double)weight[0] + (double)weight[1] + (double)weight[2] + (double)weight[3];
}

static void test_four_heaviest(void **state) {
  (void)state;
  uint16_t joint[4];
  float weight[4];
  int32_t joints[] = {7, 3, 9, 1, 5};
  double weights[] = {0.1, 0.3, 0.05, 0.35, 0.2};
  orb_four_heaviest(joints, weights, 5, joint, weight);
  const uint16_t order[] = {1, 3, 5, 7};
  const double share[] = {0.35 / 0.95, 0.3 / 0.95, 0.2 / 0.95, 0.1 / 0.95};
  for (int k = 0; k < 4; k++) {
    assert_int_equal(joint[k], order[k]);
    assert_true(fabs((double)weight[k] - share[k]) < 1e-6);
  }
  assert_true(sum_of(weight) == 1);
  float in_float = 0;
  for (int k = 0; k < 4; k++) {
    in_float += weight[k];
  }
  assert_true(in_float == 1);

  int32_t two[] = {4, 2};
  double exact[] = {0.25, 0.75};
  orb_four_heaviest(two, exact, 2, joint, weight);
  assert_true(joint[0] == 2 && joint[1] == 4 && joint[2] == 0 && joint[3] == 0);
  assert_true(weight[0] == 0.75f && weight[1] == 0.25f && weight[2] == 0 && weight[3] == 0);

  const float odd = 0.3f; /* its bits stay: with 1 − 0.3f, which is float32, the sum is exact */
  int32_t pair[] = {0, 1};
  double bits[] = {(double)odd, 1 - (double)odd};
  orb_four_heaviest(pair, bits, 2, joint, weight);
  assert_true(weight[0] == 1 - odd && weight[1] == odd);

  orb_four_heaviest(pair, bits, 0, joint, weight);
  assert_true(joint[0] == 0 && weight[0] == 1 && weight[1] == 0);
}

/* A thousand random blends: the sum is exact, and every weight is within a rounding of its share. */
static void test_sums_are_exact(void **state) {
  (void)state;
  uint32_t seed = 12345;
  for (int round = 0; round < 1000; round++) {
    int32_t joints[12];
    double weights[12], share[12], kept = 0;
    for (int i = 0; i < 12; i++) {
      seed = seed * 1664525 + 1013904223;
      joints[i] = i;
      share[i] = weights[i] = (double)(seed >> 8) / (1 << 24) + 1e-9;
    }
    uint16_t joint[4];
    float weight[4];
    orb_four_heaviest(joints, weights, 12, joint, weight);
    assert_true(sum_of(weight) == 1);
    for (int k = 0; k < 4; k++) {
      kept += share[joint[k]];
      for (int i = 0; i < 12; i++) {
        assert_true(share[i] <= share[joint[3]] || i == joint[0] || i == joint[1] || i == joint[2]);
      }
    }
    for (int k = 0; k < 4; k++) {
      assert_true(fabs((double)weight[k] - share[joint[k]] / kept) < 2e-7);
    }
  }
}

static void test_padding(void **state) {
  (void)state;
  enum { SIDE = 9 };
  unsigned char rgba[4 * SIDE * SIDE] = {0}, known[SIDE * SIDE] = {0};
  int32_t queue[SIDE * SIDE];
  const size_t centre = 4 * SIDE + 4;
  known[centre] = 1;
  memcpy(rgba + 4 * centre, "\x10\x20\x30\xff", 4);
  orb_pad(rgba, known, SIDE, 2, queue);
  int count = 0;
  for (int i = 0; i < SIDE * SIDE; i++) {
    int far = abs(i % SIDE - 4) > abs(i / SIDE - 4) ? abs(i % SIDE - 4) : abs(i / SIDE - 4);
    assert_int_equal(known[i], far <= 2);
    count += known[i];
    assert_memory_equal(rgba + (size_t)4 * (size_t)i, "\x10\x20\x30\xff",
                        4); /* the mean of one colour is that colour */
  }
  assert_int_equal(count, 25);
}

static void test_png(void **state) {
  orb_context *ctx = *state;
  unsigned char rgba[4 * 6];
  for (int i = 0; i < 24; i++) {
    rgba[i] = (unsigned char)(11 * i);
  }
  const orb_pixels given = {3, 2, rgba};
  for (int has_alpha = 0; has_alpha < 2; has_alpha++) {
    orb_buffer png = {0};
    orb_pixels back;
    assert_int_equal(orb_png_encode(ctx, &given, has_alpha, &png), ORB_OK);
    assert_int_equal(orb_image_decode(ctx, png.data, png.size, &back), ORB_OK);
    assert_true(back.width == 3 && back.height == 2);
    for (int i = 0; i < 24; i++) {
      assert_int_equal(back.rgba[i], i % 4 < 3 || has_alpha ? rgba[i] : 255);
    }
    orb_free(ctx, back.rgba);
    for (size_t size = 0; size < png.size - 12; size += 7) { /* cut short */
      assert_int_not_equal(orb_image_decode(ctx, png.data, size, &back), ORB_OK);
      assert_null(back.rgba);
    }
    orb_buffer_free(ctx, &png);
  }
}

static void identity(int32_t shape, const double p[3], double out[3]) {
  (void)shape;
  memcpy(out, p, 3 * sizeof *out);
}

/* Numbers of a file whose vertices and triangles are those of the mesh. */
static void number_file(orb_context *ctx, orb_aligned_shape *shape) {
  orb_mesh *mesh = &shape->mesh;
  orb_free(ctx, mesh->source);
  orb_free(ctx, mesh->vertex_of_source);
  orb_free(ctx, mesh->source_triangle);
  mesh->source = ORB_NEW(ctx, int32_t, mesh->vertex_count);
  mesh->vertex_of_source = ORB_NEW(ctx, int32_t, mesh->vertex_count);
  mesh->source_triangle = ORB_NEW(ctx, int32_t, mesh->triangle_count);
  shape->parent = ORB_NEW(ctx, int32_t, mesh->triangle_count);
  mesh->file_vertex_count = mesh->vertex_count;
  mesh->file_triangle_count = mesh->triangle_count;
  for (int32_t v = 0; v < mesh->vertex_count; v++) {
    mesh->source[v] = mesh->vertex_of_source[v] = v;
  }
  for (int32_t t = 0; t < mesh->triangle_count; t++) {
    mesh->source_triangle[t] = shape->parent[t] = t;
  }
}

/* A shape merged with itself: each corner's blend is its own vertex, and the blended values are the given ones. */
static void test_blends_of_itself(void **state) {
  orb_context *ctx = *state;
  synthetic made = synthetic_make(ctx, 2, 2, identity);
  const orb_mesh *mesh = &made.shapes[1].mesh;
  orb_corner_blend *blends;
  number_file(ctx, &made.shapes[1]);
  float *values = ORB_NEW(ctx, float, mesh->vertex_count), *corners = ORB_NEW(ctx, float, 3 * mesh->triangle_count);
  assert_int_equal(orb_corner_blends_create(ctx, mesh, &made.shapes[1], mesh->triangles, &blends), ORB_OK);
  for (int32_t v = 0; v < mesh->vertex_count; v++) {
    values[v] = (float)mesh->positions[3 * v];
  }
  orb_corner_blends_apply(blends, 3 * mesh->triangle_count, values, 1, corners);
  for (int32_t h = 0; h < 3 * mesh->triangle_count; h++) {
    assert_true(corners[h] == values[mesh->triangles[h]]);
  }
  orb_free(ctx, blends);

  /* If one half of the triangles comes from a repair, it takes the values at its rim. */
  orb_mesh *changed = &made.shapes[1].mesh;
  for (int32_t t = 0; t < mesh->triangle_count; t++) {
    double z = 0;
    for (int k = 0; k < 3; k++) {
      z += mesh->positions[3 * mesh->triangles[3 * t + k] + 2];
    }
    changed->source_triangle[t] = z > 0 ? ORB_MADE_FILL : t;
  }
  assert_int_equal(orb_corner_blends_create(ctx, mesh, &made.shapes[1], mesh->triangles, &blends), ORB_OK);
  for (int32_t v = 0; v < mesh->vertex_count; v++) {
    values[v] = mesh->positions[3 * v + 2] > -1e-9 ? 1 : 0;
  }
  orb_corner_blends_apply(blends, 3 * mesh->triangle_count, values, 1, corners);
  for (int32_t h = 0; h < 3 * mesh->triangle_count; h++) {
    assert_true(blends[h].weight[0] + blends[h].weight[1] + blends[h].weight[2] == 1);
    assert_true(corners[h] == values[mesh->triangles[h]]);
  }
  orb_free(ctx, blends);
  orb_free(ctx, values);
  orb_free(ctx, corners);
  orb_free(ctx, made.shapes[1].parent);
  synthetic_free(ctx, &made);
}

/* An asset whose vertices are those of the supermesh, and a copy of one for one triangle alone. */
static void test_corners(void **state) {
  orb_context *ctx = *state;
  synthetic made = synthetic_make(ctx, 1, 2, identity);
  const orb_supermesh *mesh = &made.supermesh;
  int32_t count = mesh->vertex_count + 2, last = 3 * mesh->triangle_count - 1;
  int32_t *vertices = ORB_NEW(ctx, int32_t, count), *triangles = ORB_NEW(ctx, int32_t, last + 1);
  int64_t *corner;
  for (int32_t v = 0; v < mesh->vertex_count; v++) {
    vertices[v] = v;
  }
  memcpy(triangles, mesh->triangles, (size_t)(last + 1) * sizeof *triangles);
  vertices[count - 2] = mesh->triangles[last];
  triangles[last] = count - 2;
  vertices[count - 1] = -1;
  assert_int_equal(orb_corners_create(ctx, mesh, vertices, count, triangles, mesh->triangle_count, &corner), ORB_OK);
  for (int32_t g = 0; g < count - 1; g++) {
    assert_int_equal(mesh->triangles[corner[g]], vertices[g]);
  }
  assert_int_equal(corner[count - 2], last);
  assert_int_equal(corner[count - 1], -1);
  orb_free(ctx, corner);
  orb_free(ctx, vertices);
  orb_free(ctx, triangles);
  synthetic_free(ctx, &made);
}

/* Colours of vertices that are linear in the height, baked into two charts: the projections of the two halves along x.
 */
static void test_bake(void **state) {
  orb_context *ctx = *state;
  synthetic made = synthetic_make(ctx, 3, 2, identity);
  const orb_supermesh *mesh = &made.supermesh;
  orb_mesh *shape = &made.shapes[1].mesh;
  int32_t corners = 3 * mesh->triangle_count;
  shape->colors = ORB_NEW(ctx, float, 4 * corners);
  float *uv = ORB_NEW(ctx, float, 2 * corners);
  unsigned char *has = ORB_NEW0(ctx, unsigned char, corners);
  int32_t *each = ORB_NEW(ctx, int32_t, corners), *material = ORB_NEW0(ctx, int32_t, mesh->triangle_count);
  for (int32_t h = 0; h < corners; h++) {
    const double *p = shape->positions + 3 * shape->triangles[h];
    double x = 0;
    for (int k = 0; k < 3; k++) {
      x += shape->positions[3 * shape->triangles[h / 3 * 3 + k]];
    }
    const float gray = (float)(0.5 + 0.4 * p[2]);
    for (int c = 0; c < 4; c++) {
      shape->colors[4 * h + c] = c < 3 ? gray : 1;
    }
    uv[2 * h] = (float)((x > 0 ? 0.75 : 0.25) + 0.2 * p[1]);
    uv[2 * h + 1] = (float)(0.5 + 0.4 * p[2]);
    has[h] = 1;
    each[h] = h;
  }
  const orb_given_charts charts = {.triangle_count = mesh->triangle_count,
                                   .vertex_count = corners,
                                   .triangles = each,
                                   .material = material,
                                   .uv = uv,
                                   .has = has};
  const orb_bake_job job = {.supermesh = mesh,
                            .shape = &made.shapes[1],
                            .number = 1,
                            .charts = &charts,
                            .vertices = mesh->triangles,
                            .vertex_count = corners,
                            .resolution = 64};
  orb_baked baked;
  orb_pixels pixels;
  assert_int_equal(orb_bake(ctx, &job, &baked), ORB_OK);
  assert_true(baked.resolution == 64 && baked.image_count == 1 && baked.shared == 0 && !baked.has_alpha);
  assert_int_equal(orb_image_decode(ctx, baked.images[0].png.data, baked.images[0].png.size, &pixels), ORB_OK);
  int inside = 0;
  for (int y = 0; y < 64; y++) {
    for (int x = 0; x < 64; x++) {
      double u = (x + 0.5) / 64, v = (y + 0.5) / 64;
      double across = (u - (u > 0.5 ? 0.75 : 0.25)) / 0.2, up = (v - 0.5) / 0.4;
      if (across * across + up * up < 0.9) { /* the polygon reaches farther than that */
        double linear = v, srgb = 1.055 * pow(linear, 1 / 2.4) - 0.055;
        assert_true(fabs(pixels.rgba[4 * (64 * y + x)] - 255 * srgb) <= 1);
        inside++;
      }
    }
  }
  assert_true(inside > 800);
  orb_free(ctx, pixels.rgba);
  orb_baked_free(ctx, &baked);
  orb_free(ctx, uv);
  orb_free(ctx, has);
  orb_free(ctx, each);
  orb_free(ctx, material);
  synthetic_free(ctx, &made);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test_setup_teardown(test_four_heaviest, setup, teardown),
      cmocka_unit_test_setup_teardown(test_sums_are_exact, setup, teardown),
      cmocka_unit_test_setup_teardown(test_padding, setup, teardown),
      cmocka_unit_test_setup_teardown(test_png, setup, teardown),
      cmocka_unit_test_setup_teardown(test_blends_of_itself, setup, teardown),
      cmocka_unit_test_setup_teardown(test_corners, setup, teardown),
      cmocka_unit_test_setup_teardown(test_bake, setup, teardown),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
