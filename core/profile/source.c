#include "profile/source.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/error.h"
#include "base/memory.h"
#include "format/bytes.h"
#include "format/gltf_write.h"
#include "format/json_check.h"

enum {
  GLB_HEADER = 12,
  CHUNK_HEADER = 8,
  GLB_MAGIC = 0x46546c67,
  CHUNK_JSON = 0x4e4f534a,
  CHUNK_BINARY = 0x004e4942,
};

orb_status orb_source_corrupt(orb_context *ctx) {
  return orb_fail(ctx, ORB_E_CORRUPT, "The stored asset is damaged or was not written by this program.");
}

/* A number of an object that is whole and at least 0; −1: absent or something else. */
static int64_t whole(const cJSON *object, const char *name) {
  const cJSON *item = cJSON_GetObjectItemCaseSensitive(object, name);
  double value = cJSON_IsNumber(item) ? item->valuedouble : -1;
  return value >= 0 && value < 0x1p40 && floor(value) == value ? (int64_t)value : -1;
}

int32_t orb_source_number(const cJSON *object, const char *name) {
  int64_t number = whole(object, name);
  return number <= INT32_MAX ? (int32_t)number : -1;
}

/* The bytes of one component; 0: no such type. */
static int32_t component_size(int32_t type) {
  return type == 5120 || type == 5121                      ? 1
         : type == 5122 || type == ORB_GLTF_USHORT         ? 2
         : type == ORB_GLTF_UINT || type == ORB_GLTF_FLOAT ? 4
                                                           : 0;
}

static int32_t components_of(const cJSON *accessor) {
  static const char *const types[] = {"SCALAR", "VEC2", "VEC3", "VEC4"};
  const cJSON *type = cJSON_GetObjectItemCaseSensitive(accessor, "type");
  for (int32_t i = 0; i < 4; i++) {
    if (cJSON_IsString(type) && strcmp(type->valuestring, types[i]) == 0) {
      return i + 1;
    }
  }
  return 0;
}

/* The chunks of the container. 1, or 0: not a GLB with both. */
static int find_chunks(const unsigned char *bytes, size_t size, const char **json, size_t *json_size,
                       const unsigned char **binary, size_t *binary_size) {
  const size_t heads = GLB_HEADER + 2 * CHUNK_HEADER;
  if (size < heads || orb_read_u32(bytes, 0) != GLB_MAGIC || orb_read_u32(bytes + GLB_HEADER + 4, 0) != CHUNK_JSON) {
    return 0;
  }
  *json_size = orb_read_u32(bytes + GLB_HEADER, 0);
  if (*json_size > size - heads) {
    return 0;
  }
  *json = (const char *)bytes + GLB_HEADER + CHUNK_HEADER;
  const unsigned char *head = bytes + GLB_HEADER + CHUNK_HEADER + *json_size;
  *binary = head + CHUNK_HEADER;
  *binary_size = orb_read_u32(head, 0);
  return orb_read_u32(head + 4, 0) == CHUNK_BINARY && *binary_size <= size - heads - *json_size;
}

static int read_view(const cJSON *json, const unsigned char *binary, size_t size, orb_source_view *out) {
  int64_t offset = whole(json, "byteOffset"), length = whole(json, "byteLength");
  offset = cJSON_HasObjectItem(json, "byteOffset") ? offset : 0;
  if (whole(json, "buffer") != 0 || offset < 0 || length < 1 || (size_t)offset > size ||
      (size_t)length > size - (size_t)offset) {
    return 0;
  }
  *out = (orb_source_view){.bytes = binary + offset, .size = (size_t)length, .accessor = -1};
  return 1;
}

/* number: that of the accessor. Each has a view of its own, from its start. */
static int read_accessor(const cJSON *json, int32_t number, orb_source *source, orb_source_accessor *out) {
  *out = (orb_source_accessor){.view = orb_source_number(json, "bufferView"),
                               .count = orb_source_number(json, "count"),
                               .components = components_of(json),
                               .component_type = orb_source_number(json, "componentType")};
  int32_t width = component_size(out->component_type) * out->components;
  if (out->view < 0 || out->view >= source->view_count || out->count < 1 || width == 0 ||
      cJSON_HasObjectItem(json, "sparse") || cJSON_HasObjectItem(json, "byteOffset")) {
    return 0;
  }
  orb_source_view *view = &source->views[out->view];
  if (view->accessor >= 0 || (size_t)out->count > view->size / (size_t)width) {
    return 0;
  }
  view->accessor = number;
  out->bytes = view->bytes;
  out->stride = width;
  return 1;
}

static orb_status read_tables(orb_context *ctx, orb_source *source, const unsigned char *binary, size_t size) {
  const cJSON *accessors = cJSON_GetObjectItemCaseSensitive(source->document, "accessors"),
              *views = cJSON_GetObjectItemCaseSensitive(source->document, "bufferViews"), *item;
  source->view_count = cJSON_GetArraySize(views);
  source->accessor_count = cJSON_GetArraySize(accessors);
  source->views = ORB_NEW0(ctx, orb_source_view, source->view_count);
  source->accessors = ORB_NEW0(ctx, orb_source_accessor, source->accessor_count);
  if (!source->views || !source->accessors) {
    return ORB_E_NO_MEMORY;
  }
  int32_t i = 0;
  cJSON_ArrayForEach(item, views) {
    if (cJSON_HasObjectItem(item, "byteStride") || !read_view(item, binary, size, &source->views[i++])) {
      return orb_source_corrupt(ctx);
    }
  }
  i = 0;
  cJSON_ArrayForEach(item, accessors) {
    if (!read_accessor(item, i, source, &source->accessors[i])) {
      return orb_source_corrupt(ctx);
    }
    i++;
  }
  return ORB_OK;
}

/* Whether a mesh has such a member in its extras. */
static int has_extra(const cJSON *document, const char *name) {
  const cJSON *mesh;
  cJSON_ArrayForEach(mesh, cJSON_GetObjectItemCaseSensitive(document, "meshes")) {
    if (cJSON_GetObjectItemCaseSensitive(cJSON_GetObjectItemCaseSensitive(mesh, "extras"), name)) {
      return 1;
    }
  }
  return 0;
}

orb_status orb_source_open(orb_context *ctx, const unsigned char *bytes, size_t size, orb_source *out) {
  const char *json;
  const unsigned char *binary;
  size_t json_size, binary_size;
  *out = (orb_source){0};
  if (!find_chunks(bytes, size, &json, &json_size, &binary, &binary_size)) {
    return orb_source_corrupt(ctx);
  }
  out->document = cJSON_ParseWithLength(json, json_size);
  if (!out->document && orb_json_begins(json, json_size)) {
    return orb_fail(ctx, ORB_E_NO_MEMORY, "There is not enough memory to read the asset.");
  }
  if (has_extra(out->document, "firstShape")) { /* see orb_asset_write_document() */
    return orb_fail(ctx, ORB_E_BAD_OPTION,
                    "This asset is the uploaded document with targets, which has the profile float only.");
  }
  if (has_extra(out->document, "transferred")) { /* see orb_carry */
    return orb_fail(ctx, ORB_E_BAD_OPTION,
                    "This asset has what \"transfer\" took from its shapes, so it has the profile float only.");
  }
  return out->document ? read_tables(ctx, out, binary, binary_size) : orb_source_corrupt(ctx);
}

void orb_source_close(orb_context *ctx, orb_source *source) {
  cJSON_Delete(source->document);
  orb_free(ctx, source->accessors);
  orb_free(ctx, source->views);
  *source = (orb_source){0};
}

int orb_source_is_floats(const orb_source *source, int32_t accessor, int32_t components, int32_t count) {
  if (accessor < 0 || accessor >= source->accessor_count) {
    return 0;
  }
  const orb_source_accessor *a = &source->accessors[accessor];
  return a->component_type == ORB_GLTF_FLOAT && a->components == components && a->count == count;
}

void orb_source_floats(const orb_source *source, int32_t accessor, const uint32_t *order, float *out) {
  const orb_source_accessor *a = &source->accessors[accessor];
  for (int32_t i = 0; i < a->count; i++) {
    float *to = out + (size_t)a->components * (order ? order[i] : (uint32_t)i);
    for (int32_t c = 0; c < a->components; c++) {
      to[c] = (float)orb_read_f32(a->bytes + (size_t)i * (size_t)a->stride + 4 * (size_t)c, 0);
    }
  }
}
