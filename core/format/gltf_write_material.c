#include "format/gltf_write_material.h"

#include <string.h>

#include "base/memory.h"
#include "format/material_table.h"

enum { FILTER_LINEAR = 9729, FILTER_LINEAR_MIPMAP_LINEAR = 9987, WRAP_REPEAT = 10497 };

static size_t or_else(int32_t value, size_t fallback) {
  return value ? (size_t)value : fallback;
}

/* The members of a sampler, with glTF's usual values where the material gives none. */
static void sampler_of(const orb_texture *t, size_t out[4]) {
  out[0] = or_else(t->mag_filter, FILTER_LINEAR);
  out[1] = or_else(t->min_filter, FILTER_LINEAR_MIPMAP_LINEAR);
  out[2] = or_else(t->wrap_s, WRAP_REPEAT);
  out[3] = or_else(t->wrap_t, WRAP_REPEAT);
}

/* The number of a texture, which is added if it is new. first, next: linked lists of the textures of each image. */
static int32_t find_texture(orb_gltf_textures *all, const orb_texture *texture, int32_t *first, int32_t *next) {
  orb_gltf_texture made = {.image = texture->image};
  if (texture->image < 0) {
    return -1;
  }
  sampler_of(texture, made.sampler);
  int32_t *link = &first[texture->image];
  while (*link >= 0) {
    if (memcmp(all->items[*link].sampler, made.sampler, sizeof made.sampler) == 0) {
      return *link;
    }
    link = &next[*link];
  }
  *link = all->count;
  next[all->count] = -1;
  all->items[all->count] = made;
  return all->count++;
}

orb_status orb_gltf_textures_collect(orb_context *ctx, const orb_gltf_scene *scene, orb_gltf_textures *out) {
  size_t materials = (size_t)scene->material_count, values = (size_t)scene->material_value_count;
  *out = (orb_gltf_textures){.items = ORB_NEW(ctx, orb_gltf_texture, materials + values),
                             .of_material = ORB_NEW(ctx, int32_t, materials),
                             .of_value = ORB_NEW(ctx, int32_t, values)};
  int32_t *first = ORB_NEW(ctx, int32_t, scene->image_count), *next = ORB_NEW(ctx, int32_t, materials + values);
  orb_status status = out->items && out->of_material && out->of_value && first && next ? ORB_OK : ORB_E_NO_MEMORY;
  for (int32_t i = 0; status == ORB_OK && i < scene->image_count; i++) {
    first[i] = -1;
  }
  for (int32_t i = 0; status == ORB_OK && i < scene->material_count; i++) {
    const orb_material *m = &scene->materials[i];
    out->of_material[i] = find_texture(out, &m->base_texture, first, next);
    for (int32_t v = m->first_value; v < m->first_value + m->value_count; v++) {
      const orb_material_value *value = &scene->material_values[v];
      int is_texture = orb_member_row_of(value->member)->kind == ORB_MEMBER_TEXTURE;
      out->of_value[v] = is_texture ? find_texture(out, &value->texture, first, next) : -1;
    }
  }
  orb_free(ctx, first);
  orb_free(ctx, next);
  if (status != ORB_OK) {
    orb_gltf_textures_free(ctx, out);
  }
  return status;
}

void orb_gltf_textures_free(orb_context *ctx, orb_gltf_textures *textures) {
  orb_free(ctx, textures->items);
  orb_free(ctx, textures->of_material);
  orb_free(ctx, textures->of_value);
  *textures = (orb_gltf_textures){0};
}

void orb_gltf_write_extensions(orb_glb_writer *w, const orb_gltf_scene *scene) {
  unsigned char used[ORB_MATERIAL_MEMBER_COUNT] = {0};
  int is_transformed = 0;
  const char *before = ",\"extensionsUsed\":[", *last = "";
  for (int32_t i = 0; i < scene->material_count; i++) {
    const orb_material *m = &scene->materials[i];
    is_transformed |= m->base_texture.image >= 0 && m->base_texture.is_transformed;
    for (int32_t v = m->first_value; v < m->first_value + m->value_count; v++) {
      const orb_material_value *value = &scene->material_values[v];
      used[value->member] = 1;
      is_transformed |= orb_member_row_of(value->member)->kind == ORB_MEMBER_TEXTURE && value->texture.is_transformed;
    }
  }
  for (int i = 0; i < ORB_MATERIAL_MEMBER_COUNT; i++) {
    const char *extension = orb_member_row_of((orb_material_member)i)->extension;
    if (used[i] && strcmp(extension, last) != 0) {
      orb_glb_quoted(w, before, extension);
      before = ",";
      last = extension;
    }
  }
  if (is_transformed) {
    orb_glb_quoted(w, before, "KHR_texture_transform");
    before = ",";
  }
  orb_glb_text(w, *before == ',' && before[1] == 0 ? "]" : "");
}

void orb_gltf_write_samplers(orb_glb_writer *w, const orb_gltf_textures *textures) {
  for (int32_t t = 0; t < textures->count; t++) {
    const size_t *sampler = textures->items[t].sampler;
    orb_glb_integer(w, t ? ",{\"magFilter\":" : ",\"samplers\":[{\"magFilter\":", sampler[0]);
    orb_glb_integer(w, ",\"minFilter\":", sampler[1]);
    orb_glb_integer(w, ",\"wrapS\":", sampler[2]);
    orb_glb_integer(w, ",\"wrapT\":", sampler[3]);
    orb_glb_text(w, t + 1 < textures->count ? "}" : "}]");
  }
}

void orb_gltf_write_textures(orb_glb_writer *w, const orb_gltf_textures *textures) {
  for (int32_t t = 0; t < textures->count; t++) {
    orb_glb_integer(w, t ? ",{\"sampler\":" : ",\"textures\":[{\"sampler\":", (size_t)t);
    orb_glb_integer(w, ",\"source\":", (size_t)textures->items[t].image);
    orb_glb_text(w, t + 1 < textures->count ? "}" : "}]");
  }
}

static void write_transform(orb_glb_writer *w, const orb_texture *texture) {
  const char *before = "{\"extensions\":{\"KHR_texture_transform\":{\"offset\":";
  orb_glb_numbers(w, before, texture->offset, 2);
  if (texture->rotation != 0) {
    orb_glb_number(w, ",\"rotation\":", texture->rotation);
  }
  orb_glb_numbers(w, ",\"scale\":", texture->scale, 2);
  orb_glb_text(w, "}}");
}

/* A reference to a texture. factor: the name of its number, or NULL. */
static void write_reference(orb_glb_writer *w, const orb_texture *texture, int32_t number, const char *factor,
                            double value) {
  if (texture->is_transformed) {
    write_transform(w, texture);
  }
  orb_glb_integer(w, texture->is_transformed ? ",\"index\":" : "{\"index\":", (size_t)number);
  if (factor && value != 1) {
    orb_glb_quoted(w, ",", factor);
    orb_glb_number(w, ":", value);
  }
  orb_glb_text(w, "}");
}

/* A member with its key; an extension's mere presence writes nothing. Returns whether it wrote. */
static int write_member(orb_glb_writer *w, const char *before, const orb_material_value *value, int32_t texture) {
  static const char *const modes[] = {"OPAQUE", "MASK", "BLEND"};
  const orb_member_row *row = orb_member_row_of(value->member);
  if (row->kind == ORB_MEMBER_PRESENCE) {
    return 0;
  }
  orb_glb_quoted(w, before, row->name);
  orb_glb_text(w, ":");
  if (row->kind == ORB_MEMBER_TEXTURE) {
    write_reference(w, &value->texture, texture, orb_member_factor(value->member), value->number[0]);
  } else if (row->kind == ORB_MEMBER_FLAG) {
    orb_glb_text(w, value->number[0] != 0 ? "true" : "false");
  } else if (row->kind == ORB_MEMBER_MODE) {
    orb_glb_quoted(w, "", modes[(int)value->number[0]]);
  } else if (row->kind == ORB_MEMBER_NUMBER) {
    orb_glb_number(w, "", value->number[0]);
  } else {
    orb_glb_numbers(w, "", value->number, orb_member_numbers(value->member));
  }
  return 1;
}

typedef struct material_writer {
  orb_glb_writer *w;
  const orb_material *material;
  const orb_material_value *values; /* of this material */
  const int32_t *textures;          /* of these values */
  const char *before;               /* the next member */
} material_writer;

/* Members of glTF itself whose names lie between two texts, but for those of pbrMetallicRoughness. */
static void write_own(material_writer *m, const char *after, const char *until) {
  for (int32_t v = 0; v < m->material->value_count; v++) {
    const orb_member_row *row = orb_member_row_of(m->values[v].member);
    if (!*row->extension && m->values[v].member != ORB_MATERIAL_METALLIC_ROUGHNESS_TEXTURE &&
        strcmp(row->name, after) > 0 && strcmp(row->name, until) < 0) {
      write_member(m->w, m->before, &m->values[v], m->textures[v]);
      m->before = ",";
    }
  }
}

static void write_extensions(material_writer *m) {
  const char *open = "";
  const char *before = "";
  for (int32_t v = 0; v < m->material->value_count; v++) {
    const char *extension = orb_member_row_of(m->values[v].member)->extension;
    if (!*extension) {
      continue;
    }
    if (strcmp(extension, open) != 0) {
      if (!*open) {
        orb_glb_quoted(m->w, m->before, "extensions");
        m->before = ",";
      }
      orb_glb_quoted(m->w, *open ? "}," : ":{", extension);
      orb_glb_text(m->w, ":{");
      open = extension;
      before = "";
    }
    before = write_member(m->w, before, &m->values[v], m->textures[v]) ? "," : before;
  }
  orb_glb_text(m->w, *open ? "}}" : "");
}

static void write_surface(material_writer *m, int32_t base_texture) {
  const orb_material *material = m->material;
  double color[4];
  for (int c = 0; c < 4; c++) {
    color[c] = (double)material->base_color[c];
  }
  orb_glb_text(m->w, m->before);
  orb_glb_numbers(m->w, "\"pbrMetallicRoughness\":{\"baseColorFactor\":", color, 4);
  if (base_texture >= 0) {
    orb_glb_text(m->w, ",\"baseColorTexture\":");
    write_reference(m->w, &material->base_texture, base_texture, NULL, 1);
  }
  orb_glb_number(m->w, ",\"metallicFactor\":", (double)material->metallic);
  for (int32_t v = 0; v < material->value_count; v++) {
    if (m->values[v].member == ORB_MATERIAL_METALLIC_ROUGHNESS_TEXTURE) {
      write_member(m->w, ",", &m->values[v], m->textures[v]);
    }
  }
  orb_glb_number(m->w, ",\"roughnessFactor\":", (double)material->roughness);
  orb_glb_text(m->w, "}}");
}

void orb_gltf_write_materials(orb_glb_writer *w, const orb_gltf_scene *scene, const orb_gltf_textures *textures) {
  orb_glb_text(w, ",\"materials\":");
  for (int32_t i = 0; i < scene->material_count; i++) {
    const orb_material *material = &scene->materials[i];
    material_writer m = {w, material, NULL, NULL, i ? ",{" : "[{"};
    if (material->value_count) {
      m.values = scene->material_values + material->first_value;
      m.textures = textures->of_value + material->first_value;
    }
    write_own(&m, "", "extensions");
    write_extensions(&m);
    if (material->name[0]) {
      orb_glb_quoted(w, m.before, "name");
      orb_glb_quoted(w, ":", material->name);
      m.before = ",";
    }
    write_own(&m, "name", "pbr");
    write_surface(&m, textures->of_material[i]);
  }
  orb_glb_text(w, "]");
}
