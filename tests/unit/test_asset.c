/* The asset: positions at every shape, normals and their splits, the animation, names, nudges. */
#include <float.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/memory.h"
#include "support_asset.h"

/* Ellipsoids: axis s is 1 + s. Their normals are known: p / axis², scaled. */
static double axis_of(int32_t shape, int c) {
  return c == shape ? 2.5 : 1;
}
static void ellipsoid(int32_t shape, const double p[3], double out[3]) {
  for (int c = 0; c < 3; c++) {
    out[c] = axis_of(shape, c) * p[c];
  }
}

/* Each triangle's three positions on each shape are those of a triangle of the supermesh, whatever the order. */
static void check_positions(const glb *file, const synthetic *made, int shapes) {
  const cJSON *primitive = asset_primitive(file, 0);
  const cJSON *targets = cJSON_GetObjectItem(primitive, "targets");
  int base = glb_attribute(cJSON_GetObjectItem(primitive, "attributes"), "POSITION");
  int indices = glb_attribute(primitive, "indices"), matched = 0;
  assert_int_equal(glb_attribute(primitive, "mode"), 4);
  assert_int_equal(glb_count(file, indices), 3 * made->supermesh.triangle_count);
  for (int i = 0; i < glb_count(file, indices); i++) {
    int v = (int)glb_value(file, indices, i, 0);
    double p[3], length = 0;
    for (int c = 0; c < 3; c++) { /* back to the ball */
      p[c] = glb_value(file, base, v, c) / axis_of(0, c);
      length += p[c] * p[c];
    }
    assert_true(fabs(length - 1) < 1e-6);
    for (int s = 1; s < shapes; s++) {
      int delta = glb_attribute(cJSON_GetArrayItem(targets, s - 1), "POSITION");
      for (int c = 0; c < 3; c++) {
        double shown = glb_value(file, base, v, c) + glb_value(file, delta, v, c);
        assert_true(fabs(shown - axis_of(s, c) * p[c]) < 1e-6);
        matched++;
      }
    }
  }
  assert_int_equal(matched, 9 * (shapes - 1) * made->supermesh.triangle_count);
}

static void check_normals(const glb *file, int shapes) {
  const cJSON *primitive = asset_primitive(file, 0);
  const cJSON *attributes = cJSON_GetObjectItem(primitive, "attributes");
  int base = glb_attribute(attributes, "POSITION"), normal = glb_attribute(attributes, "NORMAL");
  for (int v = 0; v < glb_count(file, base); v++) {
    for (int s = 0; s < shapes; s++) {
      int delta = s ? glb_attribute(cJSON_GetArrayItem(cJSON_GetObjectItem(primitive, "targets"), s - 1), "NORMAL") : 0;
      double dot = 0, length = 0, own = 0;
      for (int c = 0; c < 3; c++) {
        double p = glb_value(file, base, v, c) / axis_of(0, c), n = p / axis_of(s, c);
        double shown = glb_value(file, normal, v, c) + (s ? glb_value(file, delta, v, c) : 0);
        dot += n * shown;
        length += n * n;
        own += shown * shown;
      }
      assert_true(fabs(own - 1) < 1e-5);
      assert_true(dot / sqrt(length) > cos(3 * M_PI / 180)); /* a ball of 2,048 triangles */
    }
  }
}

static void two_shapes_are_base_and_target(void **state) {
  orb_context *ctx = *state;
  synthetic made = synthetic_make(ctx, 4, 2, ellipsoid);
  orb_asset_options options;
  orb_asset_defaults(&options);
  orb_buffer bytes;
  orb_asset_facts facts;
  glb file = asset_write(ctx, &made, &options, &facts, &bytes);
  assert_int_equal(facts.vertex_count, made.supermesh.vertex_count);
  assert_int_equal(facts.target_count, 1);
  assert_int_equal(facts.morphed_attributes, 2);
  assert_int_equal(facts.nudged_vertices, 0);
  check_positions(&file, &made, 2);
  check_normals(&file, 2);
  const cJSON *asset = cJSON_GetObjectItem(file.json, "asset");
  assert_string_equal(cJSON_GetObjectItem(asset, "generator")->valuestring, ORB_ENGINE);
  assert_int_equal(cJSON_GetArraySize(cJSON_GetObjectItem(file.json, "materials")), 1);
  glb_close(&file);
  orb_buffer_free(ctx, &bytes);
  synthetic_free(ctx, &made);
}

/* Every shape, the first included, is shown alone by a key frame; all weights are tents between. */
static void animation_shows_every_shape_alone(void **state) {
  orb_context *ctx = *state;
  synthetic made = synthetic_make(ctx, 1, 3, ellipsoid);
  orb_asset_options options;
  orb_asset_defaults(&options);
  orb_buffer bytes;
  glb file = asset_write(ctx, &made, &options, NULL, &bytes);
  check_positions(&file, &made, 3);
  const cJSON *animations = cJSON_GetObjectItem(file.json, "animations");
  assert_int_equal(cJSON_GetArraySize(animations), 1);
  const cJSON *sampler = cJSON_GetArrayItem(cJSON_GetObjectItem(cJSON_GetArrayItem(animations, 0), "samplers"), 0);
  int input = glb_attribute(sampler, "input"), output = glb_attribute(sampler, "output");
  assert_string_equal(cJSON_GetObjectItem(sampler, "interpolation")->valuestring, "LINEAR");
  int keys = glb_count(&file, input), alone[3] = {0};
  assert_int_equal(glb_count(&file, output), 2 * keys);
  for (int k = 0; k < keys; k++) {
    double a = glb_value(&file, output, 2 * k, 0), b = glb_value(&file, output, 2 * k + 1, 0);
    alone[0] += a == 0 && b == 0;
    alone[1] += a == 1 && b == 0;
    alone[2] += a == 0 && b == 1;
    assert_true(k == 0 || glb_value(&file, input, k, 0) > glb_value(&file, input, k - 1, 0));
  }
  assert_true(alone[0] >= 2 && alone[1] >= 2 && alone[2] >= 1);
  assert_true(glb_value(&file, output, 0, 0) == 0 && glb_value(&file, output, 2 * keys - 2, 0) == 0);
  /* Equal names are made different. */
  const cJSON *names = cJSON_GetObjectItem(cJSON_GetObjectItem(asset_mesh(&file), "extras"), "targetNames");
  assert_int_equal(cJSON_GetArraySize(names), 2);
  assert_string_equal(cJSON_GetArrayItem(names, 0)->valuestring, "two");
  assert_string_equal(cJSON_GetArrayItem(names, 1)->valuestring, "two (2)");
  glb_close(&file);
  orb_buffer_free(ctx, &bytes);
  options.animation = ORB_ANIMATION_NONE;
  options.normals = 0;
  file = asset_write(ctx, &made, &options, NULL, &bytes);
  assert_null(cJSON_GetObjectItem(file.json, "animations"));
  assert_int_equal(glb_attribute(cJSON_GetObjectItem(asset_primitive(&file, 0), "attributes"), "NORMAL"), -1);
  glb_close(&file);
  orb_buffer_free(ctx, &bytes);
  synthetic_free(ctx, &made);
}

/* Octahedron with the file's normals flat on each face: each of its 6 vertices is 4 in the file, with the same bits. */
static void hard_edges_split_vertices(void **state) {
  orb_context *ctx = *state;
  synthetic made = synthetic_make(ctx, 0, 2, ellipsoid);
  orb_mesh *mesh = &made.shapes[1].mesh;
  assert_int_equal(mesh->triangle_count, 8);
  mesh->normals = ORB_NEW(ctx, float, 9 * 8);
  for (int t = 0; t < 8; t++) {
    double n[3] = {0};
    for (int k = 0; k < 3; k++) {
      for (int c = 0; c < 3; c++) {
        n[c] += made.supermesh.points[3 * mesh->triangles[3 * t + k] + c] / sqrt(3); /* any unit vector of the face */
      }
    }
    for (int k = 0; k < 9; k++) {
      mesh->normals[9 * t + k] = (float)n[k % 3];
    }
  }
  orb_asset_options options;
  orb_asset_defaults(&options);
  orb_buffer bytes;
  orb_asset_facts facts;
  glb file = asset_write(ctx, &made, &options, &facts, &bytes);
  assert_int_equal(facts.vertex_count, 24);
  check_positions(&file, &made, 2);
  const cJSON *primitive = asset_primitive(&file, 0);
  const cJSON *attributes = cJSON_GetObjectItem(primitive, "attributes");
  const cJSON *target = cJSON_GetArrayItem(cJSON_GetObjectItem(primitive, "targets"), 0);
  int base = glb_attribute(attributes, "POSITION"), delta = glb_attribute(target, "POSITION");
  int distinct = 0;
  for (int v = 0; v < 24; v++) {
    int earlier = 0;
    for (int w = 0; w < v; w++) {
      int same = 1;
      for (int c = 0; c < 3; c++) {
        same &= glb_value(&file, base, v, c) == glb_value(&file, base, w, c) &&
                glb_value(&file, delta, v, c) == glb_value(&file, delta, w, c);
      }
      earlier |= same;
    }
    distinct += !earlier;
  }
  assert_int_equal(distinct, 6);
  /* On shape 1 the three normals of each triangle are its own. */
  int indices = glb_attribute(primitive, "indices");
  for (int t = 0; t < 8; t++) {
    double centre[3] = {0}, normal[3] = {0};
    for (int k = 0; k < 3; k++) {
      int v = (int)glb_value(&file, indices, 3 * t + k, 0);
      for (int c = 0; c < 3; c++) {
        centre[c] += glb_value(&file, base, v, c) / axis_of(0, c);
        normal[c] += glb_value(&file, glb_attribute(attributes, "NORMAL"), v, c) +
                     glb_value(&file, glb_attribute(target, "NORMAL"), v, c);
      }
    }
    for (int c = 0; c < 3; c++) {
      assert_true(fabs(normal[c] / 3 - centre[c] / sqrt(3)) < 1e-6);
    }
  }
  glb_close(&file);
  orb_buffer_free(ctx, &bytes);
  synthetic_free(ctx, &made);
}

/* Two vertices at one place on both shapes are written one unit in the last place apart. */
static void coinciding_vertices_are_kept_apart(void **state) {
  orb_context *ctx = *state;
  synthetic made = synthetic_make(ctx, 1, 2, ellipsoid);
  for (int s = 0; s < 2; s++) {
    double *p = made.shapes[s].mesh.positions;
    memcpy(p + 3 * 7, p + 3 * 2, 3 * sizeof *p);
    memcpy(p + 3 * 9, p + 3 * 2, 3 * sizeof *p);
  }
  orb_asset_options options;
  orb_asset_defaults(&options);
  orb_buffer bytes;
  orb_asset_facts facts;
  glb file = asset_write(ctx, &made, &options, &facts, &bytes);
  assert_int_equal(facts.nudged_vertices, 2);
  int base = glb_attribute(cJSON_GetObjectItem(asset_primitive(&file, 0), "attributes"), "POSITION"), near = 0;
  for (int v = 0; v < glb_count(&file, base); v++) {
    for (int w = 0; w < v; w++) {
      double largest = 0;
      for (int c = 0; c < 3; c++) {
        largest = fmax(largest, fabs(glb_value(&file, base, v, c) - glb_value(&file, base, w, c)));
      }
      assert_true(largest > 0);
      near += largest < 1e-6;
    }
  }
  assert_int_equal(near, 3);
  glb_close(&file);
  orb_buffer_free(ctx, &bytes);
  synthetic_free(ctx, &made);
}

/* Two shapes of which the first `crowd` vertices are at one place. */
static synthetic make_crowd(orb_context *ctx, int crowd, const double place[3]) {
  synthetic made = synthetic_make(ctx, 5, 2, ellipsoid);
  assert_true(made.shapes[0].mesh.vertex_count > crowd);
  for (int s = 0; s < 2; s++) {
    for (int v = 0; v < crowd; v++) {
      memcpy(made.shapes[s].mesh.positions + 3 * (size_t)v, place, 3 * sizeof *place);
    }
  }
  return made;
}

/* Hundreds of vertices at one place on both shapes, as a very thin map makes them, are still written apart, also where
 * coordinates are 0, which has no units in the last place that clients keep. */
static void crowds_are_kept_apart(void **state) {
  orb_context *ctx = *state;
  static const double places[2][3] = {{0.5, 0.25, 0}, {0, 0, 0}};
  enum { CROWD = 700 };
  for (int i = 0; i < 2; i++) {
    synthetic made = make_crowd(ctx, CROWD, places[i]);
    orb_asset_options options;
    orb_asset_defaults(&options);
    orb_buffer bytes;
    orb_asset_facts facts;
    glb file = asset_write(ctx, &made, &options, &facts, &bytes);
    assert_int_equal(facts.nudged_vertices, CROWD - 1);
    int base = glb_attribute(cJSON_GetObjectItem(asset_primitive(&file, 0), "attributes"), "POSITION"), near = 0;
    double at[CROWD][3];
    for (int v = 0; v < glb_count(&file, base); v++) {
      double off = 0;
      for (int c = 0; c < 3; c++) {
        off = fmax(off, fabs(glb_value(&file, base, v, c) - places[i][c]));
      }
      if (off <= 16 * 0.5 * FLT_EPSILON) {
        assert_true(near < CROWD);
        for (int c = 0; c < 3; c++) {
          at[near][c] = glb_value(&file, base, v, c);
          assert_true(at[near][c] == 0 || fabs(at[near][c]) > FLT_MIN);
        }
        for (int w = 0; w < near; w++) {
          assert_memory_not_equal(at[w], at[near], sizeof at[w]);
        }
        near++;
      }
    }
    assert_int_equal(near, CROWD);
    glb_close(&file);
    orb_buffer_free(ctx, &bytes);
    synthetic_free(ctx, &made);
  }
}

/* Thousands find no place near enough. */
static void larger_crowds_are_refused(void **state) {
  orb_context *ctx = *state;
  synthetic made = make_crowd(ctx, 2400, (const double[3]){0.5, 0.25, 0});
  orb_asset_options options;
  orb_asset_defaults(&options);
  orb_buffer bytes;
  orb_asset_facts facts;
  assert_int_equal(orb_asset_write(ctx, &made.supermesh, made.shapes, asset_names, &options, &facts, &bytes),
                   ORB_E_NOT_CERTIFIED);
  assert_non_null(strstr(orb_context_error(ctx)->detail, "coincide"));
  synthetic_free(ctx, &made);
}

/* The same bytes for one thread and for four. */
static void threads_do_not_matter(void **state) {
  (void)state;
  orb_buffer bytes[2];
  orb_context *contexts[2];
  for (int i = 0; i < 2; i++) {
    orb_context_options with = {.threads = i ? 4 : 1};
    assert_int_equal(orb_context_create(&with, &contexts[i]), ORB_OK);
    synthetic made = synthetic_make(contexts[i], 5, 3, ellipsoid);
    orb_asset_options options;
    orb_asset_defaults(&options);
    glb file = asset_write(contexts[i], &made, &options, NULL, &bytes[i]);
    glb_close(&file);
    synthetic_free(contexts[i], &made);
  }
  assert_int_equal(bytes[0].size, bytes[1].size);
  assert_memory_equal(bytes[0].data, bytes[1].data, bytes[0].size);
  for (int i = 0; i < 2; i++) {
    orb_buffer_free(contexts[i], &bytes[i]);
    orb_context_destroy(contexts[i]);
  }
}

/* A cylinder of coordinates round the z axis on shape 0's mesh, cut at x < 0, y = 0; two materials above and below. */
static void paint(orb_context *ctx, orb_mesh *mesh, const double *points) {
  mesh->texcoords = ORB_NEW0(ctx, float, 6 * mesh->triangle_count);
  mesh->material = ORB_NEW0(ctx, int32_t, mesh->triangle_count);
  mesh->materials = ORB_NEW0(ctx, orb_material, 2);
  mesh->material_count = 2;
  mesh->materials[0].base_texture.image = mesh->materials[1].base_texture.image = -1;
  for (int32_t t = 0; t < mesh->triangle_count; t++) {
    double x = 0, y = 0, z = 0;
    for (int k = 0; k < 3; k++) {
      const double *p = points + 3 * mesh->triangles[3 * t + k];
      x += p[0];
      y += p[1];
      z += p[2];
    }
    mesh->material[t] = z > 0;
    for (int k = 0; k < 3; k++) {
      const double *p = points + 3 * mesh->triangles[3 * t + k];
      double own = p[0] == 0 && p[1] == 0 ? atan2(y, x) : atan2(p[1], p[0]);
      own += own - atan2(y, x) > M_PI ? -2 * M_PI : own - atan2(y, x) < -M_PI ? 2 * M_PI : 0;
      mesh->texcoords[6 * t + 2 * k] = (float)(own / (2 * M_PI));
      mesh->texcoords[6 * t + 2 * k + 1] = (float)p[2];
    }
  }
}

static void turned_ball(int32_t shape, const double p[3], double out[3]) {
  double c = cos(0.4), s = sin(0.4), q[3] = {c * p[0] - s * p[1], s * p[0] + c * p[1], p[2]};
  (void)shape;
  out[0] = c * q[0] - s * q[2]; /* oblique to the paint's seam and its equator */
  out[1] = q[1];
  out[2] = s * q[0] + c * q[2];
}

/* A supermesh whose triangles cross the seam and the materials' border: no triangle's coordinates run from one side of
 * the seam to the other, and they are right at every vertex whose triangles are away from it. */
static void texture_seams_are_not_crossed(void **state) {
  orb_context *ctx = *state;
  synthetic fine = synthetic_make(ctx, 4, 2, ellipsoid), made = synthetic_make(ctx, 3, 2, turned_ball);
  orb_aligned_shape shapes[2] = {fine.shapes[0], fine.shapes[1]};
  orb_locator *locator;
  paint(ctx, &shapes[0].mesh, fine.supermesh.points);
  fine.shapes[0] = shapes[0]; /* to be freed with it */
  orb_supermesh *supermesh = &made.supermesh;
  assert_int_equal(orb_locator_create(ctx, shapes[0].points, shapes[0].mesh.vertex_count, shapes[0].mesh.triangles,
                                      shapes[0].mesh.triangle_count, NULL, &locator),
                   ORB_OK);
  for (int32_t v = 0; v < supermesh->vertex_count; v++) {
    memcpy(supermesh->points + 3 * v, made.shapes[0].mesh.positions + 3 * v, 3 * sizeof(double));
    orb_locate(locator, supermesh->points + 3 * v, -1, &supermesh->places[v]);
    supermesh->places[supermesh->vertex_count + v] = supermesh->places[v];
  }
  orb_locator_destroy(ctx, locator);
  orb_asset_options options;
  orb_asset_facts facts;
  orb_buffer bytes = {0};
  orb_asset_defaults(&options);
  assert_int_equal(orb_asset_write(ctx, supermesh, shapes, asset_names, &options, &facts, &bytes), ORB_OK);
  assert_int_equal(facts.primitive_count, 2);
  assert_true(facts.vertex_count > supermesh->vertex_count);
  glb file = glb_open(&bytes);
  int checked = 0;
  for (int m = 0; m < 2; m++) {
    const cJSON *primitive = asset_primitive(&file, m);
    const cJSON *attributes = cJSON_GetObjectItem(primitive, "attributes");
    int base = glb_attribute(attributes, "POSITION"), uv = glb_attribute(attributes, "TEXCOORD_0");
    int indices = glb_attribute(primitive, "indices");
    for (int i = 0; i < glb_count(&file, indices); i += 3) {
      double low = INFINITY, high = -INFINITY, polar = 0;
      for (int k = 0; k < 3; k++) {
        int v = (int)glb_value(&file, indices, i + k, 0);
        double x = glb_value(&file, base, v, 0) / axis_of(0, 0), y = glb_value(&file, base, v, 1);
        double u = glb_value(&file, uv, v, 0), z = glb_value(&file, base, v, 2);
        low = fmin(low, u);
        high = fmax(high, u);
        polar = fmax(polar, fabs(z));
        double off = u - atan2(y, x) / (2 * M_PI);
        off -= round(off);
        /* Within a triangle at a border, a corner may stand for the border's point: the tolerance is 1/8 of a right
         * angle. */
        assert_true(fabs(off) < (fabs(z) < 0.8 ? 0.05 : 1));
        if (fabs(z) < 0.8 && fabs(z) > 0.3 && x > 0) {
          assert_true(fabs(off) < 2e-3 && fabs(glb_value(&file, uv, v, 1) - z) < 0.02);
          checked++;
        }
        assert_true(m == 1 ? z > -0.25 : z < 0.25);
      }
      assert_true(polar > 0.8 || high - low < 0.1);
    }
  }
  assert_true(checked > 100);
  glb_close(&file);
  orb_buffer_free(ctx, &bytes);
  synthetic_free(ctx, &made);
  synthetic_free(ctx, &fine);
}

typedef struct failing {
  int left;
} failing;
static void *failing_alloc(void *user, size_t size) {
  failing *f = user;
  return f->left-- > 0 ? malloc(size) : NULL;
}
static void failing_free(void *user, void *block) {
  (void)user;
  free(block);
}

/* Whenever memory runs out, the call reports it and leaves nothing behind (the context asserts that at its end). */
static void running_out_of_memory_is_an_error(void **state) {
  (void)state;
  int failed = 0;
  for (int n = 0;; n++) {
    failing f = {1 << 20};
    orb_context_options with = {.threads = 1, .allocator = {failing_alloc, failing_free, &f}};
    orb_context *ctx;
    assert_int_equal(orb_context_create(&with, &ctx), ORB_OK);
    synthetic made = synthetic_make(ctx, 1, 3, ellipsoid);
    paint(ctx, &made.shapes[0].mesh, made.supermesh.points);
    orb_asset_options options;
    orb_asset_defaults(&options);
    options.path = ORB_PATH_RIGID;
    options.path_steps = 1;
    options.fit = ORB_FIT_RIGID;
    orb_buffer bytes = {0};
    f.left = n;
    orb_status status = orb_asset_write(ctx, &made.supermesh, made.shapes, asset_names, &options, NULL, &bytes);
    f.left = 1 << 20;
    orb_buffer_free(ctx, &bytes);
    synthetic_free(ctx, &made);
    orb_context_destroy(ctx);
    if (status == ORB_OK) {
      break;
    }
    assert_int_equal(status, ORB_E_NO_MEMORY);
    failed++;
  }
  assert_true(failed > 50);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test_setup_teardown(two_shapes_are_base_and_target, asset_setup, asset_teardown),
      cmocka_unit_test_setup_teardown(animation_shows_every_shape_alone, asset_setup, asset_teardown),
      cmocka_unit_test_setup_teardown(hard_edges_split_vertices, asset_setup, asset_teardown),
      cmocka_unit_test_setup_teardown(coinciding_vertices_are_kept_apart, asset_setup, asset_teardown),
      cmocka_unit_test_setup_teardown(crowds_are_kept_apart, asset_setup, asset_teardown),
      cmocka_unit_test_setup_teardown(larger_crowds_are_refused, asset_setup, asset_teardown),
      cmocka_unit_test_setup_teardown(texture_seams_are_not_crossed, asset_setup, asset_teardown),
      cmocka_unit_test(threads_do_not_matter),
      cmocka_unit_test(running_out_of_memory_is_an_error),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
