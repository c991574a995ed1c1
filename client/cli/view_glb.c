#include "view_glb.h"

#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int glb_refuse(glb_file *r, const char *format, ...) {
  va_list args;
  va_start(args, format);
  vsnprintf(r->error, r->error_size, format, args);
  va_end(args);
  return -1;
}

static uint32_t word(const unsigned char *p) {
  return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

int glb_load(glb_file *r, const char *path) {
  FILE *file = fopen(path, "rb");
  if (!file) {
    return glb_refuse(r, "%s: %s", path, strerror(errno));
  }
  long size = fseek(file, 0, SEEK_END) == 0 ? ftell(file) : -1;
  rewind(file);
  r->bytes = size > 0 ? malloc((size_t)size) : NULL;
  r->size = r->bytes ? fread(r->bytes, 1, (size_t)size, file) : 0;
  fclose(file);
  if (!r->bytes || r->size != (size_t)size) {
    return glb_refuse(r, "cannot read %s, or it is empty", path);
  }
  if (r->size < 20 || memcmp(r->bytes, "glTF", 4) != 0 || memcmp(r->bytes + 16, "JSON", 4) != 0) {
    return glb_refuse(r, "%s is not a GLB file (binary glTF); view draws files that 'orbmorph morph' made", path);
  }
  size_t json_size = word(r->bytes + 12);
  if (r->size < 28 || json_size == 0 || json_size > r->size - 28) {
    return glb_refuse(r, "%s is truncated or damaged", path);
  }
  r->json = cJSON_ParseWithLength((const char *)r->bytes + 20, json_size);
  r->binary = r->bytes + 28 + json_size;
  r->binary_size = word(r->bytes + 20 + json_size);
  if (!r->json || r->binary_size > r->size - 28 - json_size) {
    return glb_refuse(r, "%s is truncated or damaged", path);
  }
  const cJSON *needed = cJSON_GetArrayItem(cJSON_GetObjectItemCaseSensitive(r->json, "extensionsRequired"), 0);
  if (cJSON_IsString(needed)) {
    return glb_refuse(r, "%s needs %.60s, which view does not know; download the asset with --profile float", path,
                      needed->valuestring);
  }
  return 0;
}

void glb_free(glb_file *r) {
  cJSON_Delete(r->json);
  free(r->bytes);
}

double glb_number(const cJSON *object, const char *name, double otherwise) {
  const cJSON *item = cJSON_GetObjectItemCaseSensitive(object, name);
  return cJSON_IsNumber(item) && item->valuedouble >= 0 && item->valuedouble < 4294967296.0 ? item->valuedouble
                                                                                            : otherwise;
}

int glb_code(const cJSON *object, const char *name, int otherwise) {
  double value = glb_number(object, name, otherwise);
  return value <= INT_MAX ? (int)value : otherwise;
}

const cJSON *glb_entry(const glb_file *r, const char *list, double index) {
  return index >= 0 && index <= INT_MAX
             ? cJSON_GetArrayItem(cJSON_GetObjectItemCaseSensitive(r->json, list), (int)index)
             : NULL;
}

const unsigned char *glb_view(const glb_file *r, double index, size_t *size) {
  const cJSON *view = glb_entry(r, "bufferViews", index);
  double at = glb_number(view, "byteOffset", 0), length = glb_number(view, "byteLength", 0);
  if (!view || length < 1 || at + length > (double)r->binary_size) {
    return NULL;
  }
  *size = (size_t)length;
  return r->binary + (size_t)at;
}

int glb_open(const glb_file *r, double index, glb_span *out) {
  const cJSON *accessor = glb_entry(r, "accessors", index);
  const cJSON *view = glb_entry(r, "bufferViews", glb_number(accessor, "bufferView", -1));
  const cJSON *type = cJSON_GetObjectItemCaseSensitive(accessor, "type");
  if (!view || !cJSON_IsString(type)) {
    return -1;
  }
  out->components = type->valuestring[0] == 'S'            ? 1
                    : strncmp(type->valuestring, "VEC", 3) ? 0
                                                           : type->valuestring[3] - '0';
  out->kind = glb_code(accessor, "componentType", 0);
  out->count = (uint32_t)glb_number(accessor, "count", 0);
  size_t size = out->kind == GLB_UBYTE                            ? 1
                : out->kind == GLB_USHORT                         ? 2
                : out->kind == GLB_UINT || out->kind == GLB_FLOAT ? 4
                                                                  : 0;
  if (size == 0 || out->components < 1 || out->components > 4 || out->count == 0) {
    return -1;
  }
  size_t element = size * (size_t)out->components;
  out->stride = (size_t)glb_number(view, "byteStride", (double)element);
  if (out->stride < element) { /* elements would overlap, and there could be more of them than the file has bytes */
    return -1;
  }
  double at = glb_number(view, "byteOffset", 0) + glb_number(accessor, "byteOffset", 0);
  if (at + (double)out->stride * (out->count - 1) + (double)element > (double)r->binary_size) {
    return -1;
  }
  out->bytes = r->binary + (size_t)at;
  return 0;
}

uint32_t glb_index(const glb_span *s, uint32_t element) {
  const unsigned char *p = s->bytes + element * s->stride;
  return s->kind == GLB_UBYTE ? p[0] : s->kind == GLB_USHORT ? (uint32_t)(p[0] | p[1] << 8) : word(p);
}

/* Integers are normalized: colours and texture coordinates are fractions. */
static float component(const glb_span *s, uint32_t element, int c) {
  const unsigned char *p = s->bytes + element * s->stride;
  float value;
  uint32_t bits;
  switch (s->kind) {
    case GLB_UBYTE:
      return (float)p[c] / 255.0f;
    case GLB_USHORT:
      return (float)(p[2 * c] | p[2 * c + 1] << 8) / 65535.0f;
    default:
      bits = word(p + 4 * c);
      memcpy(&value, &bits, sizeof value);
      return isfinite(value) ? value : 0;
  }
}

int glb_copy(glb_file *r, const cJSON *attributes, const char *name, uint32_t count, int components, float *out) {
  double index = glb_number(attributes, name, -1);
  glb_span s;
  if (index < 0) {
    return 0;
  }
  if (glb_open(r, index, &s) != 0 || s.count != count || s.components < components) {
    return glb_refuse(r, "the accessor of %s has the wrong type or count", name);
  }
  for (uint32_t i = 0; i < count; i++) {
    for (int c = 0; c < components; c++) {
      out[(size_t)components * i + (size_t)c] = component(&s, i, c);
    }
  }
  return 0;
}
