#include "view_material.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static void read_wrap(const glb_file *r, const cJSON *texture, int wrap[2]) {
  const cJSON *sampler = glb_entry(r, "samplers", glb_number(texture, "sampler", -1));
  wrap[0] = glb_code(sampler, "wrapS", VIEW_REPEAT);
  wrap[1] = glb_code(sampler, "wrapT", VIEW_REPEAT);
}

static int read_texture(glb_file *r, const cJSON *texture, view_texture *out) {
  const cJSON *image = glb_entry(r, "images", glb_number(texture, "source", -1));
  size_t size = 0;
  const unsigned char *bytes = glb_view(r, glb_number(image, "bufferView", -1), &size);
  if (!bytes || view_texture_decode(bytes, size, out) != 0) {
    return glb_refuse(r, "a texture is damaged, or is not a PNG or JPEG image within the file");
  }
  read_wrap(r, texture, out->wrap);
  return 0;
}

static void read_factor(const cJSON *surface, float factor[3]) {
  const cJSON *list = cJSON_GetObjectItemCaseSensitive(surface, "baseColorFactor");
  for (int c = 0; c < 3; c++) {
    const cJSON *item = cJSON_GetArrayItem(list, c);
    factor[c] = cJSON_IsNumber(item) ? (float)item->valuedouble : 1;
  }
}

static double item_of(const cJSON *object, const char *name, int index, double otherwise) {
  const cJSON *item = cJSON_GetArrayItem(cJSON_GetObjectItemCaseSensitive(object, name), index);
  return cJSON_IsNumber(item) ? item->valuedouble : otherwise;
}

static void read_transform(const cJSON *texture, float out[2][3]) {
  const cJSON *extensions = cJSON_GetObjectItemCaseSensitive(texture, "extensions");
  const cJSON *transform = cJSON_GetObjectItemCaseSensitive(extensions, "KHR_texture_transform");
  const cJSON *rotation = cJSON_GetObjectItemCaseSensitive(transform, "rotation");
  double angle = cJSON_IsNumber(rotation) ? rotation->valuedouble : 0, c = cos(angle), s = sin(angle);
  double x = item_of(transform, "scale", 0, 1), y = item_of(transform, "scale", 1, 1);
  const double moved[2][3] = {{c * x, s * y, item_of(transform, "offset", 0, 0)},
                              {-s * x, c * y, item_of(transform, "offset", 1, 0)}};
  for (int i = 0; i < 6; i++) {
    out[i / 3][i % 3] = (float)moved[i / 3][i % 3];
  }
}

void view_material_move(const view_material *material, float *texcoords, uint32_t count) {
  for (size_t i = 0; i < count; i++) {
    float *at = texcoords + 2 * i, u = at[0], v = at[1];
    for (int c = 0; c < 2; c++) {
      at[c] = material->uv[c][0] * u + material->uv[c][1] * v + material->uv[c][2];
    }
  }
}

/* Reads the textures of base colours; others are not drawn. */
static int read_textures(glb_file *r, const cJSON *textures, view_materials *out) {
  const cJSON *texture;
  unsigned char *used = calloc((size_t)cJSON_GetArraySize(textures) + 1, 1);
  int rc = used ? 0 : glb_refuse(r, "not enough memory");
  for (int32_t i = 0; used && i < out->count; i++) {
    if (out->list[i].texture >= 0) {
      used[out->list[i].texture] = 1;
    }
  }
  cJSON_ArrayForEach(texture, textures) {
    int32_t at = out->texture_count++;
    if (rc == 0 && used[at]) {
      rc = read_texture(r, texture, &out->textures[at]);
    }
  }
  free(used);
  return rc;
}

int view_materials_read(glb_file *r, view_materials *out) {
  const cJSON *materials = cJSON_GetObjectItemCaseSensitive(r->json, "materials"), *material;
  const cJSON *textures = cJSON_GetObjectItemCaseSensitive(r->json, "textures");
  out->list = calloc((size_t)cJSON_GetArraySize(materials) + 1, sizeof *out->list);
  out->textures = calloc((size_t)cJSON_GetArraySize(textures) + 1, sizeof *out->textures);
  if (!out->list || !out->textures) {
    return glb_refuse(r, "not enough memory");
  }
  cJSON_ArrayForEach(material, materials) {
    const cJSON *surface = cJSON_GetObjectItemCaseSensitive(material, "pbrMetallicRoughness");
    view_material *paint = &out->list[out->count++];
    const cJSON *texture = cJSON_GetObjectItemCaseSensitive(surface, "baseColorTexture");
    double index = glb_number(texture, "index", -1);
    paint->texture = index < cJSON_GetArraySize(textures) ? (int32_t)index : -1;
    read_transform(texture, paint->uv);
    read_factor(surface, paint->factor);
  }
  out->list[out->count++] = (view_material){{1, 1, 1}, -1, {{1, 0, 0}, {0, 1, 0}}};
  return read_textures(r, textures, out);
}

void view_materials_free(view_materials *materials) {
  for (int32_t i = 0; i < materials->texture_count; i++) {
    view_texture_free(&materials->textures[i]);
  }
  free(materials->textures);
  free(materials->list);
  memset(materials, 0, sizeof *materials);
}
