/* Profiles: the data that meshoptimizer's decoder makes of a profile are within the stated bounds of the float asset.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>
#include <meshoptimizer.h>

#include "base/memory.h"
#include "orbmorph/profile.h"
#include "support_supermesh.h"

static const char *const NAMES[] = {"one", "two", "three", "four"};

static int setup(void **state) {
  return orb_context_create(NULL, (orb_context **)state) == ORB_OK ? 0 : -1;
}
static int teardown(void **state) {
  orb_context_destroy(*state);
  return 0;
}

/* Ellipsoids far from the origin, each with other axes. */
static void ellipsoid(int32_t shape, const double p[3], double out[3]) {
  for (int c = 0; c < 3; c++) {
    out[c] = (c == shape ? 2.5 : 1) * p[c] + 3 * (c + 1);
  }
}

/* A ball and its copies rotated about an axis: the angle between the normals is 0 at the poles and the whole rotation
 * at the equator. */
static void turned(const double p[3], double turn, double out[3]) {
  double c = cos(turn), s = sin(turn);
  out[0] = c * p[0] - s * p[1];
  out[1] = s * p[0] + c * p[1];
  out[2] = p[2];
}
static void half_turned(int32_t shape, const double p[3], double out[3]) {
  turned(p, shape * M_PI, out);
}
static void nearly_half_turned(int32_t shape, const double p[3], double out[3]) {
  turned(p, shape * 3.13, out);
}
static void turned_by_150_degrees(int32_t shape, const double p[3], double out[3]) {
  turned(p, shape * 150 * M_PI / 180, out);
}

static orb_buffer write_asset(orb_context *ctx, int levels, int shapes, synthetic_map map) {
  synthetic made = synthetic_make(ctx, levels, shapes, map);
  orb_asset_options options;
  orb_buffer out = {0};
  orb_asset_defaults(&options);
  options.fit = ORB_FIT_NONE; /* or a rotated shape would be rotated back */
  assert_int_equal(orb_asset_write(ctx, &made.supermesh, made.shapes, NAMES, &options, NULL, &out), ORB_OK);
  synthetic_free(ctx, &made);
  return out;
}

static orb_buffer write_profile(orb_context *ctx, const orb_buffer *asset, orb_profile profile,
                                orb_profile_facts *facts) {
  orb_buffer out = {0};
  orb_status status = orb_profile_write(ctx, asset->data, asset->size, profile, facts, &out);
  if (status != ORB_OK) {
    fail_msg("%s", orb_context_error(ctx)->detail);
  }
  return out;
}

static double number_of(const cJSON *object, const char *name, double otherwise) {
  const cJSON *item = cJSON_GetObjectItemCaseSensitive(object, name);
  return item ? item->valuedouble : otherwise;
}

/* The decoded bytes of an accessor, from malloc(). */
static unsigned char *decode(const glb *file, int accessor, size_t *stride) {
  const cJSON *own = cJSON_GetArrayItem(cJSON_GetObjectItem(file->json, "accessors"), accessor);
  const cJSON *view =
      cJSON_GetArrayItem(cJSON_GetObjectItem(file->json, "bufferViews"), (int)number_of(own, "bufferView", -1));
  const cJSON *packed = cJSON_GetObjectItem(cJSON_GetObjectItem(view, "extensions"), "EXT_meshopt_compression");
  size_t count = (size_t)number_of(own, "count", 0), size = (size_t)number_of(view, "byteLength", 0);
  unsigned char *out = calloc(1, size);
  *stride = size / count;
  if (!packed) {
    memcpy(out, file->binary + (size_t)number_of(view, "byteOffset", 0), size);
    return out;
  }
  const unsigned char *from = file->binary + (size_t)number_of(packed, "byteOffset", 0);
  const char *mode = cJSON_GetObjectItem(packed, "mode")->valuestring;
  const cJSON *filter = cJSON_GetObjectItem(packed, "filter");
  size_t length = (size_t)number_of(packed, "byteLength", 0);
  assert_int_equal(number_of(packed, "byteStride", 0), *stride);
  assert_int_equal(number_of(packed, "count", 0), count);
  assert_int_equal(number_of(packed, "buffer", -1), 0);
  assert_int_equal(number_of(view, "buffer", -1), 1);
  if (strcmp(mode, "TRIANGLES") == 0) {
    assert_int_equal(from[0], 0xe1); /* the extension allows no other version */
    assert_int_equal(meshopt_decodeIndexBuffer(out, count, *stride, from, length), 0);
  } else {
    assert_string_equal(mode, "ATTRIBUTES");
    assert_int_equal(from[0], 0xa0);
    assert_int_equal(meshopt_decodeVertexBuffer(out, count, *stride, from, length), 0);
  }
  if (filter && strcmp(filter->valuestring, "OCTAHEDRAL") == 0) {
    meshopt_decodeFilterOct(out, count, *stride);
  } else if (filter) {
    assert_string_equal(filter->valuestring, "EXPONENTIAL");
    meshopt_decodeFilterExp(out, count, *stride);
  }
  return out;
}

/* An accessor as doubles, from malloc(). */
static double *values_of(const glb *file, int accessor) {
  const cJSON *own = cJSON_GetArrayItem(cJSON_GetObjectItem(file->json, "accessors"), accessor);
  const char *type = cJSON_GetObjectItem(own, "type")->valuestring;
  int components = type[0] == 'S' ? 1 : type[3] - '0', kind = (int)number_of(own, "componentType", 0);
  int normalized = cJSON_IsTrue(cJSON_GetObjectItem(own, "normalized")), count = glb_count(file, accessor);
  size_t stride;
  unsigned char *bytes = decode(file, accessor, &stride);
  double *out = calloc((size_t)(count * components), sizeof *out);
  for (int i = 0; i < count * components; i++) {
    const unsigned char *p = bytes + (size_t)(i / components) * stride;
    uint16_t u16;
    int16_t i16;
    uint32_t u32;
    float f32;
    if (kind == 5120) {
      out[i] = (double)(signed char)p[i % components] / 127;
      assert_true(normalized);
      continue;
    }
    memcpy(&u16, p + 2 * (i % components), sizeof u16);
    memcpy(&i16, p + 2 * (i % components), sizeof i16);
    if (kind == 5122 || kind == 5123) {
      out[i] = kind == 5122 ? i16 / (normalized ? 32767.0 : 1) : u16 / (normalized ? 65535.0 : 1);
      continue;
    }
    memcpy(&u32, p + 4 * (i % components), sizeof u32);
    memcpy(&f32, p + 4 * (i % components), sizeof f32);
    assert_true(kind == 5125 || kind == 5126);
    out[i] = kind == 5125 ? (double)u32 : (double)f32;
  }
  free(bytes);
  return out;
}

/* The places and normals of a primitive: base, then each target at full weight. */
typedef struct shown {
  int count, frames, triangles;
  double *places[4], *normals[4], *indices;
} shown;

static void add_base(double *values, const double *base, int count) {
  for (int i = 0; base && i < 3 * count; i++) {
    values[i] += base[i];
  }
}

static shown show(const glb *file) {
  const cJSON *node = cJSON_GetArrayItem(cJSON_GetObjectItem(file->json, "nodes"), 0);
  const cJSON *mesh = cJSON_GetArrayItem(cJSON_GetObjectItem(file->json, "meshes"), 0);
  const cJSON *primitive = cJSON_GetArrayItem(cJSON_GetObjectItem(mesh, "primitives"), 0), *target;
  const cJSON *scale = cJSON_GetObjectItem(node, "scale"), *shift = cJSON_GetObjectItem(node, "translation");
  const cJSON *base = cJSON_GetObjectItem(primitive, "attributes");
  shown out = {.count = glb_count(file, glb_attribute(base, "POSITION")), .frames = 1};
  out.indices = values_of(file, glb_attribute(primitive, "indices"));
  out.triangles = glb_count(file, glb_attribute(primitive, "indices")) / 3;
  out.places[0] = values_of(file, glb_attribute(base, "POSITION"));
  out.normals[0] = values_of(file, glb_attribute(base, "NORMAL"));
  cJSON_ArrayForEach(target, cJSON_GetObjectItem(primitive, "targets")) {
    int f = out.frames++;
    out.places[f] = values_of(file, glb_attribute(target, "POSITION"));
    out.normals[f] = values_of(file, glb_attribute(target, "NORMAL"));
    add_base(out.places[f], out.places[0], out.count);
    add_base(out.normals[f], out.normals[0], out.count);
  }
  for (int f = 0; f < out.frames; f++) {
    for (int i = 0; scale && i < 3 * out.count; i++) {
      out.places[f][i] = out.places[f][i] * cJSON_GetArrayItem(scale, i % 3)->valuedouble +
                         cJSON_GetArrayItem(shift, i % 3)->valuedouble;
    }
  }
  return out;
}

static void forget(shown *s) {
  for (int f = 0; f < s->frames; f++) {
    free(s->places[f]);
    free(s->normals[f]);
  }
  free(s->indices);
}

static double apart(const double *a, const double *b) {
  return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) + (a[2] - b[2]) * (a[2] - b[2]));
}

static double degrees(const double *a, const double *b) {
  double c[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
  double none[3] = {0};
  return atan2(apart(c, none), a[0] * b[0] + a[1] * b[1] + a[2] * b[2]) * 180 / M_PI;
}

static void between(const double *a, const double *b, double w, double out[3]) {
  for (int c = 0; c < 3; c++) {
    out[c] = (1 - w) * a[c] + w * b[c];
  }
}

/* The vertex of the float asset nearest on the base, where no two coincide. */
static int find(const shown *from, const double *place) {
  int best = 0;
  for (int i = 1; i < from->count; i++) {
    best = apart(from->places[0] + 3 * i, place) < apart(from->places[0] + 3 * best, place) ? i : best;
  }
  return best;
}

static void compare(const shown *wanted, const shown *got, const orb_profile_facts *facts) {
  double far = 0, turn = 0, none[3] = {0};
  assert_int_equal(got->count, wanted->count);
  assert_int_equal(got->frames, wanted->frames);
  assert_int_equal(got->triangles, wanted->triangles);
  char *seen = calloc(1, (size_t)wanted->count);
  for (int i = 0; i < got->count; i++) {
    int v = find(wanted, got->places[0] + 3 * i);
    assert_false(seen[v]);
    seen[v] = 1;
    for (int f = 1; f < got->frames; f++) {
      for (int step = 0; step <= 16; step++) {
        double a[3], b[3], w = step / 16.0;
        between(wanted->places[0] + 3 * v, wanted->places[f] + 3 * v, w, a);
        between(got->places[0] + 3 * i, got->places[f] + 3 * i, w, b);
        far = fmax(far, apart(a, b));
        between(wanted->normals[0] + 3 * v, wanted->normals[f] + 3 * v, w, a);
        between(got->normals[0] + 3 * i, got->normals[f] + 3 * i, w, b);
        if (apart(a, none) > 1e-6) { /* else the float asset has no normal there */
          turn = fmax(turn, degrees(a, b));
        }
      }
    }
  }
  free(seen);
  assert_true(far <= facts->position_error);
  assert_true(turn <= facts->normal_degrees + 1e-4);
  assert_true(facts->normal_degrees < 1);
}

static void check_profiles(orb_context *ctx, int levels, int shapes, synthetic_map map) {
  orb_buffer asset = write_asset(ctx, levels, shapes, map);
  glb file = glb_open(&asset);
  shown wanted = show(&file);
  orb_profile_facts facts, only;
  for (int p = ORB_PROFILE_QUANTIZED; p < ORB_PROFILES; p++) {
    orb_buffer out = write_profile(ctx, &asset, (orb_profile)p, &facts);
    glb packed = glb_open(&out);
    shown got = show(&packed);
    assert_int_equal(orb_profile_write(ctx, asset.data, asset.size, (orb_profile)p, &only, NULL), ORB_OK);
    assert_true(out.size < asset.size);
    compare(&wanted, &got, &facts);
    /* The bound is at most half the diagonal of a cell of the grid plus the rounding of float32 arithmetic. */
    double step = cJSON_GetArrayItem(
                      cJSON_GetObjectItem(cJSON_GetArrayItem(cJSON_GetObjectItem(packed.json, "nodes"), 0), "scale"), 0)
                      ->valuedouble;
    assert_true(facts.position_error < step + 1e-5);
    assert_true(facts.position_error == only.position_error && facts.normal_degrees == only.normal_degrees);
    forget(&got);
    glb_close(&packed);
    orb_buffer_free(ctx, &out);
  }
  forget(&wanted);
  glb_close(&file);
  orb_buffer_free(ctx, &asset);
}

static void ellipsoids_stay_within_the_bounds(void **state) {
  check_profiles(*state, 3, 3, ellipsoid);
}
static void normals_that_turn_stay_within_a_degree(void **state) {
  check_profiles(*state, 3, 2, turned_by_150_degrees);
  check_profiles(*state, 3, 2, nearly_half_turned);
  check_profiles(*state, 3, 2, half_turned);
}

static void compression_saves_most_of_the_bytes(void **state) {
  orb_context *ctx = *state;
  orb_buffer asset = write_asset(ctx, 5, 2, ellipsoid);
  orb_buffer out = write_profile(ctx, &asset, ORB_PROFILE_MESHOPT, NULL);
  assert_true(10 * out.size < 3 * asset.size);
  orb_buffer_free(ctx, &out);
  orb_buffer_free(ctx, &asset);
}

static int normal_type(orb_context *ctx, synthetic_map map, int of_target, double *share) {
  orb_buffer asset = write_asset(ctx, 5, 2, map), out = write_profile(ctx, &asset, ORB_PROFILE_QUANTIZED, NULL);
  glb file = glb_open(&out);
  const cJSON *mesh = cJSON_GetArrayItem(cJSON_GetObjectItem(file.json, "meshes"), 0);
  const cJSON *primitive = cJSON_GetArrayItem(cJSON_GetObjectItem(mesh, "primitives"), 0);
  const cJSON *target = cJSON_GetArrayItem(cJSON_GetObjectItem(primitive, "targets"), 0);
  int accessor = glb_attribute(of_target ? target : cJSON_GetObjectItem(primitive, "attributes"), "NORMAL");
  int type =
      (int)number_of(cJSON_GetArrayItem(cJSON_GetObjectItem(file.json, "accessors"), accessor), "componentType", 0);
  *share = (double)out.size / (double)asset.size;
  glb_close(&file);
  orb_buffer_free(ctx, &out);
  orb_buffer_free(ctx, &asset);
  return type;
}

/* Of 60 bytes per vertex and its two triangles 36 are left, or 44 if a normal rotates too far for integers. */
static void quantized_normals_are_bytes(void **state) {
  double share;
  assert_int_equal(normal_type(*state, ellipsoid, 0, &share), 5120);
  assert_int_equal(normal_type(*state, ellipsoid, 1, &share), 5120);
  assert_true(share < 0.61);
  assert_int_equal(normal_type(*state, turned_by_150_degrees, 0, &share), 5120);
  assert_int_equal(normal_type(*state, turned_by_150_degrees, 1, &share), 5126);
  assert_true(share < 0.75);
}

static void equal_assets_give_equal_bytes(void **state) {
  orb_context *ctx = *state;
  orb_buffer asset = write_asset(ctx, 3, 3, ellipsoid);
  for (int p = ORB_PROFILE_QUANTIZED; p < ORB_PROFILES; p++) {
    orb_buffer one = write_profile(ctx, &asset, (orb_profile)p, NULL),
               two = write_profile(ctx, &asset, (orb_profile)p, NULL);
    assert_int_equal(one.size, two.size);
    assert_memory_equal(one.data, two.data, one.size);
    orb_buffer_free(ctx, &one);
    orb_buffer_free(ctx, &two);
  }
  orb_buffer_free(ctx, &asset);
}

/* Any damage to the stored bytes is an error and never a read beyond them (the sanitizers see that). */
static void damaged_assets_are_refused(void **state) {
  orb_context *ctx = *state;
  orb_buffer asset = write_asset(ctx, 1, 2, ellipsoid), out = {0};
  int refused = 0;
  for (size_t size = 0; size < asset.size; size += size < 4000 ? 7 : 97) {
    unsigned char *cut = malloc(size ? size : 1);
    memcpy(cut, asset.data, size);
    assert_int_equal(orb_profile_write(ctx, cut, size, ORB_PROFILE_MESHOPT, NULL, &out), ORB_E_CORRUPT);
    free(cut);
  }
  uint32_t json = (uint32_t)asset.data[12] | (uint32_t)asset.data[13] << 8;
  for (size_t at = 12; at < 20 + json; at++) {
    unsigned char was = asset.data[at];
    asset.data[at] = was == '9' ? '1' : '9';
    orb_status status = orb_profile_write(ctx, asset.data, asset.size, ORB_PROFILE_MESHOPT, NULL, &out);
    refused += status != ORB_OK;
    asset.data[at] = was;
    orb_buffer_free(ctx, &out);
  }
  assert_true(refused > 100);
  assert_int_equal(orb_profile_write(ctx, asset.data, asset.size, ORB_PROFILE_FLOAT, NULL, &out), ORB_E_BAD_OPTION);
  orb_buffer_free(ctx, &asset);
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

static void running_out_of_memory_is_an_error(void **state) {
  int failed = 0;
  orb_buffer asset = write_asset(*state, 1, 2, ellipsoid);
  for (int n = 0;; n++) {
    failing f = {1 << 20};
    orb_context_options with = {.threads = 1, .allocator = {failing_alloc, failing_free, &f}};
    orb_context *ctx;
    orb_buffer out = {0};
    assert_int_equal(orb_context_create(&with, &ctx), ORB_OK);
    f.left = n;
    orb_status status = orb_profile_write(ctx, asset.data, asset.size, ORB_PROFILE_MESHOPT, NULL, &out);
    orb_buffer_free(ctx, &out);
    orb_context_destroy(ctx);
    if (status == ORB_OK) {
      break;
    }
    assert_int_equal(status, ORB_E_NO_MEMORY);
    failed++;
  }
  assert_true(failed > 30);
  orb_buffer_free(*state, &asset);
}

static void a_deadline_ends_the_work(void **state) {
  orb_buffer asset = write_asset(*state, 3, 2, ellipsoid), out = {0};
  orb_context_options late = {.threads = 1, .deadline_ms = 1};
  orb_context *ctx;
  assert_int_equal(orb_context_create(&late, &ctx), ORB_OK);
  assert_int_equal(orb_profile_write(ctx, asset.data, asset.size, ORB_PROFILE_MESHOPT, NULL, &out), ORB_E_TIMEOUT);
  orb_buffer_free(ctx, &out);
  orb_context_destroy(ctx);
  orb_buffer_free(*state, &asset);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test_setup_teardown(ellipsoids_stay_within_the_bounds, setup, teardown),
      cmocka_unit_test_setup_teardown(normals_that_turn_stay_within_a_degree, setup, teardown),
      cmocka_unit_test_setup_teardown(compression_saves_most_of_the_bytes, setup, teardown),
      cmocka_unit_test_setup_teardown(quantized_normals_are_bytes, setup, teardown),
      cmocka_unit_test_setup_teardown(equal_assets_give_equal_bytes, setup, teardown),
      cmocka_unit_test_setup_teardown(damaged_assets_are_refused, setup, teardown),
      cmocka_unit_test_setup_teardown(running_out_of_memory_is_an_error, setup, teardown),
      cmocka_unit_test_setup_teardown(a_deadline_ends_the_work, setup, teardown),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
