#include "view_material.h"

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

int view_materials_read(glb_file *r, view_materials *out) {
  const cJSON *materials = cJSON_GetObjectItemCaseSensitive(r->json, "materials"), *material;
  const cJSON *textures = cJSON_GetObjectItemCaseSensitive(r->json, "textures"), *texture;
  out->list = calloc((size_t)cJSON_GetArraySize(materials) + 1, sizeof *out->list);
  out->textures = calloc((size_t)cJSON_GetArraySize(textures) + 1, sizeof *out->textures);
  if (!out->list || !out->textures) {
    return glb_refuse(r, "not enough memory");
  }
  cJSON_ArrayForEach(texture, textures) {
    if (read_texture(r, texture, &out->textures[out->texture_count++]) != 0) {
      return -1;
    }
  }
  cJSON_ArrayForEach(material, materials) {
    const cJSON *surface = cJSON_GetObjectItemCaseSensitive(material, "pbrMetallicRoughness");
    view_material *paint = &out->list[out->count++];
    double index = glb_number(cJSON_GetObjectItemCaseSensitive(surface, "baseColorTexture"), "index", -1);
    paint->texture = index < out->texture_count ? (int32_t)index : -1;
    read_factor(surface, paint->factor);
  }
  out->list[out->count++] = (view_material){{1, 1, 1}, -1};
  return 0;
}

void view_materials_free(view_materials *materials) {
  for (int32_t i = 0; i < materials->texture_count; i++) {
    view_texture_free(&materials->textures[i]);
  }
  free(materials->textures);
  free(materials->list);
  memset(materials, 0, sizeof *materials);
}
