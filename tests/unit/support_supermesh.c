#include "support_supermesh.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#include "base/memory.h"
#include "support_shapes.h"

synthetic synthetic_make(orb_context *ctx, int levels, int32_t shape_count, synthetic_map map) {
  synthetic made;
  memset(&made, 0, sizeof made);
  orb_mesh ball = shape_ball(ctx, levels);
  orb_supermesh *supermesh = &made.supermesh;
  int32_t vertices = ball.vertex_count, triangles = ball.triangle_count;
  supermesh->vertex_count = vertices;
  supermesh->triangle_count = triangles;
  supermesh->shape_count = shape_count;
  supermesh->degree = 1;
  supermesh->triangles = ORB_NEW(ctx, int32_t, 3 * triangles);
  supermesh->points = ORB_NEW(ctx, double, 3 * vertices);
  supermesh->places = ORB_NEW0(ctx, orb_place, shape_count * vertices);
  supermesh->landmark_vertices = ORB_NEW0(ctx, int32_t, 0);
  supermesh->error_bound = ORB_NEW0(ctx, double, shape_count);
  memcpy(supermesh->triangles, ball.triangles, 3 * (size_t)triangles * sizeof(int32_t));
  memcpy(supermesh->points, ball.positions, 3 * (size_t)vertices * sizeof(double));
  for (int32_t s = 0; s < shape_count; s++) {
    assert_int_equal(orb_mesh_copy(ctx, &ball, &made.shapes[s].mesh), ORB_OK);
    made.shapes[s].points = ORB_NEW(ctx, double, 3 * vertices);
    memcpy(made.shapes[s].points, ball.positions, 3 * (size_t)vertices * sizeof(double));
    for (int32_t v = 0; v < vertices; v++) {
      map(s, ball.positions + 3 * v, made.shapes[s].mesh.positions + 3 * v);
    }
    for (int32_t h = 0; h < 3 * triangles; h++) {
      orb_place *place = &supermesh->places[s * vertices + ball.triangles[h]];
      *place = (orb_place){.triangle = h / 3};
      place->at[h % 3] = 1;
    }
  }
  shape_free(ctx, &ball);
  return made;
}

void synthetic_free(orb_context *ctx, synthetic *made) {
  orb_supermesh *supermesh = &made->supermesh;
  for (int32_t s = 0; s < supermesh->shape_count; s++) {
    orb_mesh_free(ctx, &made->shapes[s].mesh);
    orb_free(ctx, made->shapes[s].points);
  }
  orb_free(ctx, supermesh->triangles);
  orb_free(ctx, supermesh->points);
  orb_free(ctx, supermesh->places);
  orb_free(ctx, supermesh->landmark_vertices);
  orb_free(ctx, supermesh->error_bound);
}

static uint32_t word_at(const unsigned char *p) {
  return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

glb glb_open(const orb_buffer *bytes) {
  const unsigned char *p = bytes->data;
  assert_true(bytes->size >= 28);
  assert_memory_equal(p, "glTF", 4);
  assert_int_equal(word_at(p + 4), 2);
  assert_int_equal(word_at(p + 8), bytes->size);
  uint32_t json_size = word_at(p + 12);
  assert_int_equal(json_size % 4, 0);
  assert_memory_equal(p + 16, "JSON", 4);
  glb file = {cJSON_ParseWithLength((const char *)p + 20, json_size), p + 28 + json_size, word_at(p + 20 + json_size)};
  assert_non_null(file.json);
  assert_memory_equal(p + 24 + json_size, "BIN\0", 4);
  assert_int_equal(28 + json_size + file.binary_size, bytes->size);
  return file;
}

void glb_close(glb *file) {
  cJSON_Delete(file->json);
}

static int number_of(const cJSON *object, const char *name, int otherwise) {
  const cJSON *item = cJSON_GetObjectItemCaseSensitive(object, name);
  return item ? item->valueint : otherwise;
}

static const cJSON *item_of(const glb *file, const char *list, int index) {
  const cJSON *item = cJSON_GetArrayItem(cJSON_GetObjectItemCaseSensitive(file->json, list), index);
  assert_non_null(item);
  return item;
}

int glb_count(const glb *file, int accessor) {
  return number_of(item_of(file, "accessors", accessor), "count", -1);
}

double glb_value(const glb *file, int accessor, int element, int component) {
  const cJSON *from = item_of(file, "accessors", accessor);
  const cJSON *view = item_of(file, "bufferViews", number_of(from, "bufferView", -1));
  const char *type = cJSON_GetObjectItemCaseSensitive(from, "type")->valuestring;
  int components = type[0] == 'S' ? 1 : type[3] - '0', kind = number_of(from, "componentType", 0);
  size_t size = kind == 5123 ? 2 : 4;
  size_t at = (size_t)number_of(view, "byteOffset", 0) + size * (size_t)(element * components + component);
  assert_true(component < components && at + size <= file->binary_size && at % size == 0);
  const unsigned char *p = file->binary + at;
  if (kind == 5123) {
    return p[0] | p[1] << 8;
  }
  uint32_t word = word_at(p);
  float value;
  memcpy(&value, &word, sizeof value);
  return kind == 5126 ? (double)value : (double)word;
}

int glb_attribute(const cJSON *attributes, const char *name) {
  return number_of(attributes, name, -1);
}
