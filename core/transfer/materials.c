#include "transfer/materials.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "format/material_table.h"
#include "mesh/dropped.h"

/* The material of a shape that has none: light grey, so that white light does not clip, and half matt. */
static const float PLAIN_TONE = 0.8f, PLAIN_ROUGHNESS = 0.6f;

static const char *image_kind(const orb_image *image) {
  static const unsigned char png[8] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
  if (image->size > 24 && memcmp(image->bytes, png, sizeof png) == 0) {
    return "image/png";
  }
  return image->size > 4 && image->bytes[0] == 0xff && image->bytes[1] == 0xd8 && image->bytes[2] == 0xff ? "image/jpeg"
                                                                                                          : NULL;
}

/* Why the asset cannot have a texture; NULL if it can. */
static const char *refusal(const orb_mesh *mesh, const orb_texture *texture, int needs_tangents,
                           const orb_asset_options *options) {
  if (texture->image < 0 || texture->image >= mesh->image_count || !image_kind(&mesh->images[texture->image])) {
    return "Its image is neither PNG nor JPEG.";
  }
  if (!mesh->texcoords) {
    return "The file has no texture coordinates for it.";
  }
  return needs_tangents && !options->normals ? "It needs normals, and the request asks for an asset without." : NULL;
}

static const char *value_refusal(const orb_mesh *mesh, const orb_material_value *value,
                                 const orb_asset_options *options) {
  const orb_member_row *row = orb_member_row_of(value->member);
  return row->kind == ORB_MEMBER_TEXTURE ? refusal(mesh, &value->texture, row->needs_tangents, options) : NULL;
}

const orb_texture *orb_material_tangents(const orb_mesh *mesh, int32_t material, const orb_asset_options *options) {
  const orb_material *m = &mesh->materials[material];
  for (int32_t v = m->first_value; v < m->first_value + m->value_count; v++) {
    const orb_material_value *value = &mesh->material_values[v];
    if (orb_member_row_of(value->member)->needs_tangents && !value_refusal(mesh, value, options)) {
      return &value->texture;
    }
  }
  return NULL;
}

static float clamped(float value, float otherwise) {
  return value >= 0 && value <= 1 ? value : otherwise;
}

static void clamp_material(orb_material *m) {
  for (int c = 0; c < 4; c++) {
    m->base_color[c] = clamped(m->base_color[c], m->base_color[c] > 1 ? 1 : 0);
  }
  m->metallic = clamped(m->metallic, 0);
  m->roughness = clamped(m->roughness, 1);
}

static int is_finite_transform(const orb_texture *t) {
  return isfinite(t->offset[0] + t->offset[1] + t->rotation + t->scale[0] + t->scale[1]);
}

/* Copies a texture with its new image number. number: of each image, −1: it is not in the asset. */
static void place_texture(orb_texture *texture, const int32_t *number) {
  texture->image = texture->image >= 0 ? number[texture->image] : -1;
  texture->is_transformed = texture->is_transformed && is_finite_transform(texture);
}

/* Copies the materials and the values that the asset can have; image numbers are still those of the mesh. */
static void copy_materials(const orb_mesh *mesh, const orb_asset_options *options, orb_draft_materials *out,
                           int32_t *value_count) {
  int32_t made = 0;
  for (int32_t m = 0; m < mesh->material_count; m++) {
    const orb_material *from = &mesh->materials[m];
    orb_material *to = &out->materials[m];
    *to = *from;
    to->first_value = made;
    clamp_material(to);
    if (refusal(mesh, &from->base_texture, 0, options)) {
      to->base_texture.image = -1;
    }
    for (int32_t v = from->first_value; v < from->first_value + from->value_count; v++) {
      orb_material_value value = mesh->material_values[v];
      if (!value_refusal(mesh, &value, options)) {
        for (int i = 0; i < orb_member_numbers(value.member); i++) {
          value.number[i] = orb_member_clamp(value.member, value.number[i]);
        }
        out->values[made++] = value;
      }
    }
    to->value_count = made - to->first_value;
  }
  *value_count = made;
}

static int is_texture(const orb_material_value *value) {
  return orb_member_row_of(value->member)->kind == ORB_MEMBER_TEXTURE;
}

/* Appends the images that are used, in the order of the mesh. number: room for one of each image. */
static orb_status add_images(orb_context *ctx, const orb_mesh *mesh, orb_buffer *binary, orb_draft_materials *made,
                             int32_t value_count, int32_t *number, int32_t *image_count) {
  static const unsigned char zeros[4];
  memset(number, -1, (size_t)mesh->image_count * sizeof *number);
  for (int32_t m = 0; m < mesh->material_count; m++) {
    if (made->materials[m].base_texture.image >= 0) {
      number[made->materials[m].base_texture.image] = 0;
    }
  }
  for (int32_t v = 0; v < value_count; v++) {
    if (is_texture(&made->values[v])) {
      number[made->values[v].texture.image] = 0;
    }
  }
  for (int32_t i = 0; i < mesh->image_count; i++) {
    if (number[i] < 0) {
      continue;
    }
    ORB_TRY(orb_buffer_append(ctx, binary, zeros, (4 - binary->size % 4) % 4));
    number[i] = *image_count;
    made->images[(*image_count)++] = (orb_gltf_image){binary->size, mesh->images[i].size, image_kind(&mesh->images[i])};
    ORB_TRY(orb_buffer_append(ctx, binary, mesh->images[i].bytes, mesh->images[i].size));
  }
  for (int32_t m = 0; m < mesh->material_count; m++) {
    place_texture(&made->materials[m].base_texture, number);
  }
  for (int32_t v = 0; v < value_count; v++) {
    if (is_texture(&made->values[v])) {
      place_texture(&made->values[v].texture, number);
    }
  }
  return ORB_OK;
}

orb_status orb_draft_materials_add(orb_context *ctx, const orb_draft *draft, orb_buffer *binary,
                                   orb_draft_materials *out, orb_gltf_scene *scene) {
  const orb_mesh *mesh = &draft->shapes[0].mesh;
  orb_status status = ORB_E_NO_MEMORY;
  int32_t *number = ORB_NEW(ctx, int32_t, mesh->image_count);
  *out = (orb_draft_materials){.materials = ORB_NEW(ctx, orb_material, mesh->material_count + 1),
                               .values = ORB_NEW(ctx, orb_material_value, mesh->material_value_count),
                               .images = ORB_NEW(ctx, orb_gltf_image, mesh->image_count)};
  if (!number || !out->materials || !out->values || !out->images) {
    goto done;
  }
  status = ORB_OK;
  scene->materials = out->materials;
  scene->material_values = out->values;
  scene->images = out->images;
  scene->material_count = mesh->material_count;
  if (mesh->material_count > 0) {
    copy_materials(mesh, draft->options, out, &scene->material_value_count);
    status = add_images(ctx, mesh, binary, out, scene->material_value_count, number, &scene->image_count);
  } else {
    float tone = draft->color_count > 0 ? 1.0f : PLAIN_TONE;
    scene->material_count = 1;
    out->materials[0] = (orb_material){.name = "plain",
                                       .base_color = {tone, tone, tone, 1},
                                       .metallic = 0,
                                       .roughness = PLAIN_ROUGHNESS,
                                       .base_texture.image = -1};
  }
done:
  orb_free(ctx, number);
  return status;
}

void orb_draft_materials_free(orb_context *ctx, orb_draft_materials *materials) {
  orb_free(ctx, materials->materials);
  orb_free(ctx, materials->values);
  orb_free(ctx, materials->images);
}

static orb_status drop_textures(orb_context *ctx, const orb_mesh *mesh, const orb_asset_options *options,
                                orb_dropped **list, int32_t *count) {
  for (int32_t m = 0; m < mesh->material_count; m++) {
    const orb_material *material = &mesh->materials[m];
    char where[ORB_NAME_MAX + 32];
    (void)snprintf(where, sizeof where, *material->name ? "materials[%d] \"%s\"" : "materials[%d]", m, material->name);
    const char *why = material->base_texture.image >= 0 ? refusal(mesh, &material->base_texture, 0, options) : NULL;
    if (why) {
      ORB_TRY(orb_dropped_add(ctx, list, count, "baseColorTexture", where, why));
    }
    for (int32_t v = material->first_value; v < material->first_value + material->value_count; v++) {
      why = value_refusal(mesh, &mesh->material_values[v], options);
      if (why) {
        const char *what = orb_member_row_of(mesh->material_values[v].member)->name;
        ORB_TRY(orb_dropped_add(ctx, list, count, what, where, why));
      }
    }
  }
  return ORB_OK;
}

/* Whether a file has textures; those of a 3MF are not read, which its mesh notes. */
static int has_textures(const orb_mesh *mesh) {
  int found = mesh->image_count > 0;
  for (int32_t i = 0; i < mesh->dropped_count; i++) {
    found = found || strcmp(mesh->dropped[i].what, "texture2dgroup") == 0;
  }
  return found;
}

orb_status orb_dropped_later(orb_context *ctx, const orb_aligned_shape *shapes, int32_t shape_count, orb_dropped **list,
                             int32_t *count) {
  for (int32_t s = 1; s < shape_count; s++) {
    char where[32];
    (void)snprintf(where, sizeof where, "shapes[%d]", s);
    if (has_textures(&shapes[s].mesh)) {
      ORB_TRY(
          orb_dropped_add(ctx, list, count, "textures", where, "The materials of the asset are the first shape's."));
    }
  }
  return ORB_OK;
}

orb_status orb_asset_dropped(orb_context *ctx, const orb_aligned_shape *shapes, int32_t shape_count,
                             const orb_asset_options *options, orb_dropped **list, int32_t *count) {
  const orb_mesh *mesh = &shapes[0].mesh;
  *list = NULL;
  *count = 0;
  for (int32_t i = 0; i < mesh->dropped_count; i++) {
    ORB_TRY(orb_dropped_add(ctx, list, count, mesh->dropped[i].what, mesh->dropped[i].where, mesh->dropped[i].why));
  }
  ORB_TRY(drop_textures(ctx, mesh, options, list, count));
  return orb_dropped_later(ctx, shapes, shape_count, list, count);
}
