/* Reading a morphing GLB for the view: what orbmorph writes, every offset checked. */
#include <cjson/cJSON.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "view.h"

enum { USHORT = 5123, UINT = 5125, FLOAT = 5126, UBYTE = 5121 };

typedef struct reader {
  unsigned char *bytes;
  size_t size;
  const unsigned char *binary;
  size_t binary_size;
  cJSON *json;
  char *error;
  size_t error_size;
} reader;

static int refuse(reader *r, const char *format, ...) __attribute__((format(printf, 2, 3)));
static int refuse(reader *r, const char *format, ...) {
  va_list args;
  va_start(args, format);
  vsnprintf(r->error, r->error_size, format, args);
  va_end(args);
  return -1;
}

static uint32_t word(const unsigned char *p) {
  return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

static int load(reader *r, const char *path) {
  FILE *file = fopen(path, "rb");
  if (!file) {
    return refuse(r, "%s cannot be opened", path);
  }
  long size = fseek(file, 0, SEEK_END) == 0 ? ftell(file) : -1;
  rewind(file);
  r->bytes = size > 0 ? malloc((size_t)size) : NULL;
  r->size = r->bytes ? fread(r->bytes, 1, (size_t)size, file) : 0;
  fclose(file);
  if (!r->bytes || r->size != (size_t)size) {
    return refuse(r, "%s cannot be read", path);
  }
  size_t json_size = r->size >= 28 && memcmp(r->bytes, "glTF", 4) == 0 ? word(r->bytes + 12) : 0;
  if (json_size == 0 || json_size > r->size - 28 || memcmp(r->bytes + 16, "JSON", 4) != 0) {
    return refuse(r, "%s is no binary glTF with data", path);
  }
  r->json = cJSON_ParseWithLength((const char *)r->bytes + 20, json_size);
  r->binary = r->bytes + 28 + json_size;
  r->binary_size = word(r->bytes + 20 + json_size);
  if (!r->json || r->binary_size > r->size - 28 - json_size) {
    return refuse(r, "%s is cut off or damaged", path);
  }
  return 0;
}

static double number(const cJSON *object, const char *name, double otherwise) {
  const cJSON *item = cJSON_GetObjectItemCaseSensitive(object, name);
  return cJSON_IsNumber(item) && item->valuedouble >= 0 && item->valuedouble < 4294967296.0 ? item->valuedouble
                                                                                            : otherwise;
}

static const cJSON *entry(const reader *r, const char *list, double index) {
  return index >= 0 ? cJSON_GetArrayItem(cJSON_GetObjectItemCaseSensitive(r->json, list), (int)index) : NULL;
}

/* An accessor's bytes, or NULL where they do not lie in the file. */
typedef struct span {
  const unsigned char *bytes;
  uint32_t count;
  int kind, components, normalized;
  size_t stride;
} span;

static int open_accessor(const reader *r, double index, span *out) {
  const cJSON *accessor = entry(r, "accessors", index);
  const cJSON *view = entry(r, "bufferViews", number(accessor, "bufferView", -1));
  const cJSON *type = cJSON_GetObjectItemCaseSensitive(accessor, "type");
  if (!view || !cJSON_IsString(type)) {
    return -1;
  }
  out->components = type->valuestring[0] == 'S' ? 1 : type->valuestring[3] - '0';
  out->kind = (int)number(accessor, "componentType", 0);
  out->count = (uint32_t)number(accessor, "count", 0);
  out->normalized = cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(accessor, "normalized"));
  size_t size = out->kind == UBYTE ? 1 : out->kind == USHORT ? 2 : out->kind == UINT || out->kind == FLOAT ? 4 : 0;
  if (size == 0 || out->components < 1 || out->components > 4 || out->count == 0) {
    return -1;
  }
  size_t element = size * (size_t)out->components;
  out->stride = (size_t)number(view, "byteStride", (double)element);
  double at = number(view, "byteOffset", 0) + number(accessor, "byteOffset", 0);
  if (at + (double)out->stride * (out->count - 1) + (double)element > (double)r->binary_size) {
    return -1;
  }
  out->bytes = r->binary + (size_t)at;
  return 0;
}

static float component(const span *s, uint32_t element, int c) {
  const unsigned char *p = s->bytes + element * s->stride;
  float value;
  uint32_t bits;
  switch (s->kind) {
    case UBYTE:
      return (float)p[c] / 255.0f;
    case USHORT:
      return (float)(p[2 * c] | p[2 * c + 1] << 8) / 65535.0f;
    default:
      bits = word(p + 4 * c);
      memcpy(&value, &bits, sizeof value);
      return isfinite(value) ? value : 0;
  }
}

/* Copies `count` vectors of three from an accessor; leaves `out` as it is where there is none. */
static int copy3(reader *r, const cJSON *attributes, const char *name, uint32_t count, float *out) {
  double index = number(attributes, name, -1);
  span s;
  if (index < 0) {
    return 0;
  }
  if (open_accessor(r, index, &s) != 0 || s.count != count || s.components < 3) {
    return refuse(r, "the accessor of %s is not what it should be", name);
  }
  for (uint32_t i = 0; i < count; i++) {
    for (int c = 0; c < 3; c++) {
      out[3 * (size_t)i + (size_t)c] = component(&s, i, c);
    }
  }
  return 0;
}

static int count_all(reader *r, const cJSON *primitives, view_mesh *out) {
  const cJSON *primitive;
  uint64_t vertices = 0, indices = 0;
  cJSON_ArrayForEach(primitive, primitives) {
    span s;
    const cJSON *attributes = cJSON_GetObjectItemCaseSensitive(primitive, "attributes");
    if (number(primitive, "mode", 4) != 4 || open_accessor(r, number(attributes, "POSITION", -1), &s) != 0) {
      return refuse(r, "only triangles with positions can be drawn");
    }
    vertices += s.count;
    if (open_accessor(r, number(primitive, "indices", -1), &s) != 0 || s.count % 3 != 0) {
      return refuse(r, "only indexed triangles can be drawn");
    }
    indices += s.count;
    out->target_count = (uint32_t)cJSON_GetArraySize(cJSON_GetObjectItemCaseSensitive(primitive, "targets"));
  }
  if (vertices == 0 || vertices > UINT32_MAX / 16 || indices > UINT32_MAX / 2) {
    return refuse(r, "the mesh is empty or too large");
  }
  out->vertex_count = (uint32_t)vertices;
  out->index_count = (uint32_t)indices;
  return 0;
}

static int read_primitive(reader *r, const cJSON *primitive, view_mesh *out, uint32_t *vertex, uint32_t *index) {
  const cJSON *attributes = cJSON_GetObjectItemCaseSensitive(primitive, "attributes");
  span s;
  if (open_accessor(r, number(attributes, "POSITION", -1), &s) != 0) {
    return -1;
  }
  uint32_t count = s.count;
  size_t at = 3 * (size_t)*vertex;
  if (copy3(r, attributes, "POSITION", count, out->positions + at) != 0 ||
      copy3(r, attributes, "NORMAL", count, out->normals + at) != 0 ||
      copy3(r, attributes, "COLOR_0", count, out->colors + at) != 0) {
    return -1;
  }
  const cJSON *targets = cJSON_GetObjectItemCaseSensitive(primitive, "targets");
  for (uint32_t k = 0; k < out->target_count; k++) {
    const cJSON *target = cJSON_GetArrayItem(targets, (int)k);
    size_t delta = 3 * (size_t)k * out->vertex_count + at;
    if (copy3(r, target, "POSITION", count, out->delta_positions + delta) != 0 ||
        copy3(r, target, "NORMAL", count, out->delta_normals + delta) != 0) {
      return -1;
    }
  }
  if (open_accessor(r, number(primitive, "indices", -1), &s) != 0 || s.kind == FLOAT) {
    return refuse(r, "the indices are not what they should be");
  }
  for (uint32_t i = 0; i < s.count; i++) {
    const unsigned char *p = s.bytes + i * s.stride;
    uint32_t value = s.kind == UBYTE ? p[0] : s.kind == USHORT ? (uint32_t)(p[0] | p[1] << 8) : word(p);
    if (value >= count) {
      return refuse(r, "an index is out of range");
    }
    out->indices[*index + i] = *vertex + value;
  }
  *index += s.count;
  *vertex += count;
  return 0;
}

static int read_mesh(reader *r, view_mesh *out) {
  const cJSON *mesh = entry(r, "meshes", 0);
  const cJSON *primitives = cJSON_GetObjectItemCaseSensitive(mesh, "primitives"), *primitive;
  if (count_all(r, primitives, out) != 0) {
    return -1;
  }
  const cJSON *extras = cJSON_GetObjectItemCaseSensitive(mesh, "extras");
  out->between = (uint32_t)number(extras, "inBetweens", 0);
  size_t floats = 3 * (size_t)out->vertex_count;
  out->positions = calloc(floats, sizeof(float));
  out->normals = calloc(floats, sizeof(float));
  out->colors = calloc(floats, sizeof(float));
  out->delta_positions = calloc(floats * out->target_count + 1, sizeof(float));
  out->delta_normals = calloc(floats * out->target_count + 1, sizeof(float));
  out->indices = calloc(out->index_count + 1, sizeof(uint32_t));
  if (!out->positions || !out->normals || !out->colors || !out->delta_positions || !out->delta_normals ||
      !out->indices) {
    return refuse(r, "there is not enough memory");
  }
  for (size_t i = 0; i < floats; i++) {
    out->colors[i] = 0.72f - 0.04f * (float)(i % 3); /* clay, where the file has no colours */
  }
  uint32_t vertex = 0, index = 0;
  cJSON_ArrayForEach(primitive, primitives) {
    if (read_primitive(r, primitive, out, &vertex, &index) != 0) {
      return -1;
    }
  }
  return 0;
}

int view_mesh_read(const char *path, view_mesh *out, char *error, size_t error_size) {
  reader r = {.error = error, .error_size = error_size};
  memset(out, 0, sizeof *out);
  int rc = load(&r, path) == 0 ? read_mesh(&r, out) : -1;
  cJSON_Delete(r.json);
  free(r.bytes);
  if (rc != 0) {
    view_mesh_free(out);
  }
  return rc;
}

void view_mesh_free(view_mesh *mesh) {
  free(mesh->positions);
  free(mesh->normals);
  free(mesh->colors);
  free(mesh->delta_positions);
  free(mesh->delta_normals);
  free(mesh->indices);
  memset(mesh, 0, sizeof *mesh);
}
