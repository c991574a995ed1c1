#include "carry/check.h"

#include <string.h>

#include "base/check.h"
#include "base/error.h"
#include "base/memory.h"
#include "carry/bake.h"
#include "carry/texels.h"
#include "format/gltf_add.h"
#include "format/gltf_given.h"
#include "transfer/template.h"

static const char *const names[] = {"skin", "color", "texcoord", "targets", "texture"};
static const char *const titles[] = {"no skin on its closed surface", "no colours of vertices",
                                     "no texture coordinates", "no morph targets", "no base colour texture"};

const char *orb_carry_name(orb_carry_what what) {
  return (unsigned)what < ORB_CARRY_COUNT ? names[what] : NULL;
}

orb_status orb_carry_blame(orb_context *ctx, orb_status status, int32_t shape, int32_t number) {
  if (status == ORB_E_BAD_OPTION || status == ORB_E_MALFORMED_MESH || status == ORB_E_TOO_LARGE) {
    orb_error *error = orb_context_error_edit(ctx);
    error->shape = error->shape >= 0 ? error->shape : shape;
    error->transfer = number;
  }
  return status;
}

orb_status orb_carry_refuse(orb_context *ctx, const orb_carry *carries, int32_t number) {
  const orb_carry *carry = &carries[number];
  orb_status status = orb_fail(ctx, ORB_E_BAD_OPTION,
                               "\"transfer\" takes \"%s\" from shape %d, which has %s. Omit it, or name another "
                               "shape.",
                               orb_carry_name(carry->what), (int)carry->from, titles[carry->what]);
  return orb_carry_blame(ctx, status, carry->from, number);
}

static orb_status check_texture(orb_context *ctx, const orb_carry *carry, int32_t number) {
  if (carry->from == 0) {
    return orb_fail(ctx, ORB_E_BAD_OPTION,
                    "Entry %d of \"transfer\" takes a texture from the first shape, whose materials the asset has "
                    "already. Name a later shape.",
                    (int)number);
  }
  if (carry->resolution != 0 && (carry->resolution < ORB_BAKE_LEAST || carry->resolution > ORB_BAKE_MOST)) {
    return orb_fail(ctx, ORB_E_BAD_OPTION,
                    "The resolution of entry %d of \"transfer\" is %d texels a side; %d to %d are possible.",
                    (int)number, (int)carry->resolution, (int)ORB_BAKE_LEAST, (int)ORB_BAKE_MOST);
  }
  return ORB_OK;
}

orb_status orb_carry_entries(orb_context *ctx, const orb_carry *carries, int32_t count, int32_t shape_count) {
  int32_t skins = 0;
  for (int32_t i = 0; i < count; i++) {
    const orb_carry *carry = &carries[i];
    if ((unsigned)carry->what >= ORB_CARRY_COUNT || carry->from < 0 || carry->from >= shape_count ||
        count > ORB_CARRY_MAX) {
      orb_status status = orb_fail(ctx, ORB_E_BAD_OPTION, "Entry %d of \"transfer\" is out of range.", (int)i);
      return orb_carry_blame(ctx, status, -1, i);
    }
    if (carry->what == ORB_CARRY_TEXTURE) {
      ORB_TRY(orb_carry_blame(ctx, check_texture(ctx, carry, i), carry->from, i));
    }
    if (carry->what == ORB_CARRY_SKIN && skins++ > 0) {
      orb_status status = orb_fail(ctx, ORB_E_BAD_OPTION, "An asset can have one skin; \"transfer\" asks for more.");
      return orb_carry_blame(ctx, status, carry->from, i);
    }
  }
  return ORB_OK;
}

/* Tries a skin: copies its skeleton and the animations, and drops the copy. */
static orb_status try_skin(orb_context *ctx, const orb_given_file *file, int *has) {
  static const double identity[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  orb_given_skin skin;
  orb_status status = orb_given_skin_read(ctx, file, &skin);
  *has = status == ORB_OK && skin.skin >= 0;
  if (*has) {
    orb_added_skin copied = {.bytes = file->bytes, .size = file->size, .skin = skin.skin};
    memcpy(copied.place, skin.place, sizeof copied.place);
    memcpy(copied.moved, identity, sizeof copied.moved);
    status = orb_gltf_try_skin(ctx, &copied);
  }
  orb_given_skin_free(ctx, &skin);
  return status;
}

static orb_status try_sets(orb_context *ctx, const orb_given_file *file, const char *prefix, int *has) {
  orb_given_sets sets;
  orb_status status = orb_given_sets_read(ctx, file, prefix, &sets);
  *has = sets.count > 0;
  orb_given_sets_free(ctx, &sets);
  return status;
}

static orb_status try_targets(orb_context *ctx, const orb_given_file *file, int *has) {
  orb_given_targets targets = {0};
  orb_status status = orb_given_targets_read(ctx, file, &targets);
  *has = targets.count > 0;
  orb_given_targets_free(ctx, &targets);
  return status;
}

/* has: whether a glTF file has what is wanted. */
static orb_status try_document(orb_context *ctx, orb_carry_what what, const orb_given_file *file, int *has) {
  switch (what) {
    case ORB_CARRY_SKIN:
      return try_skin(ctx, file, has);
    case ORB_CARRY_TARGETS:
      return try_targets(ctx, file, has);
    default:
      return try_sets(ctx, file, what == ORB_CARRY_COLOR ? "COLOR_" : "TEXCOORD_", has);
  }
}

/* Whether the pictures of the shape can be read, and the first shape has room for them. */
static orb_status try_texture(orb_context *ctx, const orb_carry_wish *wish, const orb_mesh *mesh) {
  orb_texels texels = {0};
  if (!wish->given[0].mesh->texcoords) {
    return orb_bake_refuse(ctx);
  }
  orb_status status = orb_texels_open(ctx, mesh, &texels);
  orb_texels_close(ctx, &texels);
  return status;
}

/* Whether the document of the first shape can get a skin. */
static orb_status try_room(orb_context *ctx, const orb_carry_wish *wish) {
  const orb_mesh *file = wish->document, *repaired = wish->given[0].mesh;
  int32_t *on_surface = ORB_NEW(ctx, int32_t, file->file_vertex_count);
  if (!on_surface) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t v = 0; v < file->file_vertex_count; v++) {
    on_surface[v] = orb_repaired_vertex(repaired, file, v);
  }
  orb_status status =
      orb_gltf_try_room(ctx, wish->document_bytes, wish->document_size, on_surface, file->file_vertex_count);
  if (status == ORB_E_BAD_OPTION) {
    orb_context_error_edit(ctx)->shape = 0;
  }
  orb_free(ctx, on_surface);
  return status;
}

/* Whether the shape has what an entry names, and, unless the asset is that shape's document, can give it. */
static orb_status check_one(orb_context *ctx, const orb_carry_wish *wish, int32_t number) {
  const orb_carry *carry = &wish->carries[number];
  int is_there = wish->document && carry->from == 0;
  const orb_mesh *mesh = wish->given[carry->from].mesh;
  const orb_shape_file *from = &wish->files[carry->from];
  int has = carry->what == ORB_CARRY_TEXTURE    ? orb_texels_has(mesh)
            : carry->what == ORB_CARRY_COLOR    ? mesh->colors != NULL
            : carry->what == ORB_CARRY_TEXCOORD ? mesh->texcoords != NULL
                                                : 0;
  orb_status status = ORB_OK;
  if (from->bytes && carry->what != ORB_CARRY_TEXTURE) {
    unsigned char *used = ORB_NEW0(ctx, unsigned char, mesh->file_vertex_count);
    if (!used) {
      return ORB_E_NO_MEMORY;
    }
    for (int32_t v = 0; v < mesh->file_vertex_count; v++) {
      used[v] = (unsigned char)(mesh->vertex_of_source[v] >= 0);
    }
    orb_given_file file = {from->bytes, from->size, mesh->file_vertex_count, used};
    status = orb_carry_blame(ctx, try_document(ctx, carry->what, &file, &has), carry->from, number);
    orb_free(ctx, used);
    if (is_there && status == ORB_E_BAD_OPTION) {
      return ORB_OK; /* what cannot be copied, such as several skins, stays in the document all the same */
    }
  }
  if (status == ORB_OK && !has) {
    return orb_carry_refuse(ctx, wish->carries, number);
  }
  if (status != ORB_OK || is_there) {
    return status;
  }
  if (carry->what == ORB_CARRY_TEXTURE) {
    status = orb_carry_blame(ctx, try_texture(ctx, wish, mesh), carry->from, number);
  } else if (carry->what == ORB_CARRY_SKIN && wish->document) {
    status = orb_carry_blame(ctx, try_room(ctx, wish), 0, number);
  }
  return status;
}

orb_status orb_carry_check(orb_context *ctx, const orb_carry_wish *wish) {
  ORB_TRY(orb_carry_entries(ctx, wish->carries, wish->carry_count, wish->shape_count));
  for (int32_t i = 0; i < wish->carry_count; i++) {
    ORB_TRY(check_one(ctx, wish, i));
  }
  return ORB_OK;
}
