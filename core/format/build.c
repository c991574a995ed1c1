#include "format/build.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "base/check.h"
#include "base/context.h"
#include "base/error.h"
#include "base/grow.h"
#include "base/hash.h"
#include "base/memory.h"
#include "mesh/dropped.h"

enum { MATERIAL_SLOTS = 2 * ORB_MATERIALS_MAX }; /* of the hash table: at most half of them are used */
static const int64_t INDEX_MAX = 700000000;      /* vertices or triangles: 3 numbers for each still fit an int32 */

void orb_build_init(orb_build *build, orb_context *ctx) {
  *build = (orb_build){.ctx = ctx, .material = -1};
  build->highest_vertex = build->highest_texcoord = build->highest_normal = -1;
  build->max_triangles = orb_context_max_triangles(ctx) < INDEX_MAX ? orb_context_max_triangles(ctx) : INDEX_MAX;
}

void orb_build_free(orb_build *build) {
  void *blocks[] = {build->positions,     build->colors,         build->normals,         build->texcoords,
                    build->corner_vertex, build->corner_more,    build->face_size,       build->face_material,
                    build->materials,     build->material_slots, build->material_values, build->dropped,
                    build->objects};
  for (size_t i = 0; i < sizeof blocks / sizeof *blocks; i++) {
    orb_free(build->ctx, blocks[i]);
  }
  *build = (orb_build){0};
}

orb_status orb_build_malformed(orb_context *ctx, int is_text, int64_t where, const char *format, ...) {
  char detail[400];
  va_list args;
  va_start(args, format);
  vsnprintf(detail, sizeof detail, format, args);
  va_end(args);
  (void)orb_fail(ctx, ORB_E_MALFORMED_MESH, "%s", detail);
  if (is_text) {
    orb_context_error_edit(ctx)->line = where;
  } else {
    orb_context_error_edit(ctx)->offset = where;
  }
  return ORB_E_MALFORMED_MESH;
}

orb_status orb_build_grow(orb_context *ctx, void *array, int64_t *room, int64_t need, size_t element) {
  if (need <= *room) {
    return ORB_OK;
  }
  if (need > INDEX_MAX * 3) {
    return orb_fail(ctx, ORB_E_TOO_LARGE, "The file has more than %lld elements of one kind; decimate the mesh first.",
                    (long long)INDEX_MAX);
  }
  ORB_TRY(orb_context_check(ctx));
  int64_t wanted = *room + *room / 2 < 1024 ? 1024 : *room + *room / 2;
  if (wanted < need) {
    wanted = need;
  }
  if (!orb_regrow(ctx, array, (size_t)wanted, element)) {
    return ORB_E_NO_MEMORY;
  }
  *room = wanted;
  return ORB_OK;
}

orb_status orb_build_vertex(orb_build *build, const double position[3]) {
  if (build->vertices >= build->vertex_room) {
    if (build->vertices >= INDEX_MAX) {
      return orb_fail(build->ctx, ORB_E_TOO_LARGE, "The file has more than %lld vertices; decimate the mesh first.",
                      (long long)INDEX_MAX);
    }
    ORB_TRY(
        orb_build_grow(build->ctx, &build->positions, &build->vertex_room, build->vertices + 1, 3 * sizeof(double)));
  }
  memcpy(build->positions + 3 * build->vertices++, position, 3 * sizeof(double));
  return ORB_OK;
}

orb_status orb_build_color(orb_build *build, const double *rgba, int channels) {
  int64_t before = build->color_room, at = build->vertices - 1;
  ORB_TRY(orb_build_grow(build->ctx, &build->colors, &build->color_room, build->vertices, 4 * sizeof(float)));
  for (int64_t i = 4 * before; i < 4 * build->color_room; i++) {
    build->colors[i] = 1;
  }
  for (int k = 0; k < channels; k++) {
    build->colors[4 * at + k] = (float)rgba[k];
  }
  return ORB_OK;
}

orb_status orb_build_normal(orb_build *build, const double normal[3]) {
  ORB_TRY(orb_build_grow(build->ctx, &build->normals, &build->normal_room, build->normal_count + 1, 3 * sizeof(float)));
  for (int k = 0; k < 3; k++) {
    build->normals[3 * build->normal_count + k] = (float)normal[k];
  }
  build->normal_count++;
  return ORB_OK;
}

orb_status orb_build_texcoord(orb_build *build, const double texcoord[2]) {
  ORB_TRY(orb_build_grow(build->ctx, &build->texcoords, &build->texcoord_room, build->texcoord_count + 1,
                         2 * sizeof(float)));
  for (int k = 0; k < 2; k++) {
    build->texcoords[2 * build->texcoord_count + k] = (float)texcoord[k];
  }
  build->texcoord_count++;
  return ORB_OK;
}

/* Converts plain corners to corners with attributes when the first corner with attributes arrives. */
static orb_status widen_corners(orb_build *build) {
  ORB_TRY(orb_build_grow(build->ctx, &build->corner_more, &build->more_room, build->corners + 1, sizeof(orb_corner)));
  for (int64_t i = 0; i < build->corners; i++) {
    build->corner_more[i] = (orb_corner){build->corner_vertex[i], -1, -1};
  }
  orb_free(build->ctx, build->corner_vertex);
  build->corner_vertex = NULL;
  build->corner_room = 0;
  return ORB_OK;
}

orb_status orb_build_corner(orb_build *build, orb_corner corner, int64_t where) {
  if (corner.vertex > build->highest_vertex) {
    build->highest_vertex = corner.vertex;
    build->highest_vertex_where = where;
  }
  if ((corner.texcoord >= 0 || corner.normal >= 0) && !build->corner_more) {
    ORB_TRY(widen_corners(build));
  }
  if (build->corner_more) {
    if (corner.texcoord > build->highest_texcoord) {
      build->highest_texcoord = corner.texcoord;
      build->highest_texcoord_where = where;
    }
    if (corner.normal > build->highest_normal) {
      build->highest_normal = corner.normal;
      build->highest_normal_where = where;
    }
    if (build->corners >= build->more_room) {
      ORB_TRY(
          orb_build_grow(build->ctx, &build->corner_more, &build->more_room, build->corners + 1, sizeof(orb_corner)));
    }
    build->corner_more[build->corners++] = corner;
    return ORB_OK;
  }
  if (build->corners >= build->corner_room) {
    ORB_TRY(
        orb_build_grow(build->ctx, &build->corner_vertex, &build->corner_room, build->corners + 1, sizeof(int32_t)));
  }
  build->corner_vertex[build->corners++] = corner.vertex;
  return ORB_OK;
}

orb_status orb_build_face_end(orb_build *build, int64_t corners) {
  ORB_ASSERT(corners >= 3);
  build->triangles += corners - 2;
  if (corners > ORB_FACE_CORNERS_MAX) {
    return orb_fail(build->ctx, ORB_E_TOO_LARGE,
                    "A face has %lld corners, and at most %d are accepted; cut it into triangles before the export.",
                    (long long)corners, ORB_FACE_CORNERS_MAX);
  }
  if (build->triangles > build->max_triangles) {
    return orb_fail(build->ctx, ORB_E_TOO_LARGE, "The mesh has more than %lld triangles, the limit; decimate it first.",
                    (long long)build->max_triangles);
  }
  if (corners != 3 && !build->face_size) {
    ORB_TRY(orb_build_grow(build->ctx, &build->face_size, &build->size_room, build->faces + 1, sizeof(int32_t)));
    for (int64_t i = 0; i < build->faces; i++) {
      build->face_size[i] = 3;
    }
  }
  if (build->face_size) {
    ORB_TRY(orb_build_grow(build->ctx, &build->face_size, &build->size_room, build->faces + 1, sizeof(int32_t)));
    build->face_size[build->faces] = (int32_t)corners;
  }
  if (build->material >= 0 && !build->face_material) {
    ORB_TRY(
        orb_build_grow(build->ctx, &build->face_material, &build->material_room, build->faces + 1, sizeof(int32_t)));
    for (int64_t i = 0; i < build->faces; i++) {
      build->face_material[i] = -1;
    }
  }
  if (build->face_material) {
    ORB_TRY(
        orb_build_grow(build->ctx, &build->face_material, &build->material_room, build->faces + 1, sizeof(int32_t)));
    build->face_material[build->faces] = build->material;
  }
  if (corners > build->largest_face) {
    build->largest_face = (int32_t)corners;
  }
  build->faces++;
  return ORB_OK;
}

orb_status orb_build_use_material(orb_build *build, const unsigned char *name, size_t length) {
  if (!build->material_slots) {
    build->material_slots = ORB_NEW0(build->ctx, int32_t, MATERIAL_SLOTS);
    if (!build->material_slots) {
      return ORB_E_NO_MEMORY;
    }
  }
  char key[ORB_NAME_MAX] = {0};
  memcpy(key, name, length < sizeof key - 1 ? length : sizeof key - 1);
  int32_t *slots = build->material_slots;
  uint64_t slot = orb_hash(build->ctx, key, strlen(key)) % MATERIAL_SLOTS;
  for (; slots[slot]; slot = (slot + 1) % MATERIAL_SLOTS) {
    if (strcmp(build->materials[slots[slot] - 1].name, key) == 0) {
      build->material = slots[slot] - 1;
      return ORB_OK;
    }
  }
  if (build->material_count >= ORB_MATERIALS_MAX) {
    return orb_fail(build->ctx, ORB_E_TOO_LARGE, "The file names more than %d materials; export it with fewer.",
                    ORB_MATERIALS_MAX);
  }
  ORB_TRY(orb_build_grow(build->ctx, &build->materials, &build->materials_room, build->material_count + 1,
                         sizeof(orb_material)));
  orb_material *made = &build->materials[build->material_count];
  *made = (orb_material){.base_color = {1, 1, 1, 1}, .metallic = 0, .roughness = 1, .base_texture.image = -1};
  memcpy(made->name, key, sizeof key);
  build->material = (int32_t)build->material_count++;
  slots[slot] = build->material + 1;
  return ORB_OK;
}

orb_status orb_build_drop(orb_build *build, const char *what, const char *where, const char *why) {
  return orb_dropped_add(build->ctx, &build->dropped, &build->dropped_count, what, where, why);
}

/* The length of the UTF-8 sequence at p, 0 where there is none. */
static size_t sequence(const unsigned char *p, size_t left) {
  size_t n = *p < 0x80                 ? 1
             : *p >= 0xc2 && *p < 0xe0 ? 2
             : *p >= 0xe0 && *p < 0xf0 ? 3
             : *p >= 0xf0 && *p < 0xf5 ? 4
                                       : 0;
  if (n == 0 || n > left) {
    return 0;
  }
  for (size_t i = 1; i < n; i++) {
    if ((p[i] & 0xc0) != 0x80) {
      return 0;
    }
  }
  int bad = (p[0] == 0xe0 && p[1] < 0xa0) || (p[0] == 0xed && p[1] > 0x9f) || (p[0] == 0xf0 && p[1] < 0x90) ||
            (p[0] == 0xf4 && p[1] > 0x8f);
  return bad ? 0 : n;
}

static void copy_name(const unsigned char *name, size_t length, char out_name[ORB_PART_NAME]) {
  for (size_t at = 0, out = 0; at < length;) {
    size_t n = sequence(name + at, length - at);
    if (out + (n ? n : 1) >= ORB_PART_NAME) {
      break;
    }
    if (n == 0 || name[at] < 0x20 || name[at] == 0x7f) {
      out_name[out++] = '?';
      at++;
      continue;
    }
    memcpy(out_name + out, name + at, n);
    out += n;
    at += n;
  }
}

orb_status orb_build_object(orb_build *build, const unsigned char *name, size_t length) {
  if (build->object_count > 0 && build->objects[build->object_count - 1].first_triangle == build->triangles) {
    build->object_count--; /* it has no faces */
  }
  if (build->object_count > ORB_OBJECTS_MAX) {
    return ORB_OK;
  }
  if (build->object_count == ORB_OBJECTS_MAX) {
    length = 0; /* all further faces belong to one without a name */
    if (!build->objects_dropped) {
      ORB_TRY(orb_build_drop(build, "names of objects", "", "A mesh keeps the names of its first 65,536 objects."));
      build->objects_dropped = 1;
    }
  }
  ORB_TRY(
      orb_build_grow(build->ctx, &build->objects, &build->object_room, build->object_count + 1, sizeof(orb_object)));
  orb_object *object = &build->objects[build->object_count++];
  *object = (orb_object){.first_triangle = (int32_t)build->triangles};
  copy_name(name, length, object->name);
  return ORB_OK;
}

void orb_build_object_node(orb_build *build, const unsigned char *name, size_t length) {
  if (build->object_count > 0 && build->object_count <= ORB_OBJECTS_MAX) {
    copy_name(name, length, build->objects[build->object_count - 1].node);
  }
}
