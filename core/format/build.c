#include "format/build.h"

#include <math.h>
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
#include "mesh/polygon.h"
#include "numeric/vec3.h"

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
  for (size_t at = 0, out = 0; at < length;) {
    size_t n = sequence(name + at, length - at);
    if (out + (n ? n : 1) >= sizeof object->name) {
      break;
    }
    if (n == 0 || name[at] < 0x20 || name[at] == 0x7f) {
      object->name[out++] = '?';
      at++;
      continue;
    }
    memcpy(object->name + out, name + at, n);
    out += n;
    at += n;
  }
  return ORB_OK;
}

static orb_status check_indices(orb_build *build, int is_text, int64_t end) {
  if (build->faces == 0) {
    return orb_build_malformed(build->ctx, is_text, end, "The file holds no faces; send a surface of polygons.");
  }
  if (build->highest_vertex >= build->vertices) {
    return orb_build_malformed(build->ctx, is_text, build->highest_vertex_where,
                               "A face names vertex %lld (counted from 0), but the file has %lld vertices.",
                               (long long)build->highest_vertex, (long long)build->vertices);
  }
  if (build->highest_texcoord >= build->texcoord_count) {
    return orb_build_malformed(build->ctx, is_text, build->highest_texcoord_where,
                               "A face names texture coordinate %lld (counted from 0), but the file has %lld.",
                               (long long)build->highest_texcoord, (long long)build->texcoord_count);
  }
  if (build->highest_normal >= build->normal_count) {
    return orb_build_malformed(build->ctx, is_text, build->highest_normal_where,
                               "A face names normal %lld (counted from 0), but the file has %lld.",
                               (long long)build->highest_normal, (long long)build->normal_count);
  }
  return ORB_OK;
}

/* False for NaN. */
static int is_usable(double x) {
  return fabs(x) <= ORB_COORDINATE_MAX;
}

static orb_status check_coordinates(orb_build *build, const orb_mesh *mesh) {
  const double *p = build->positions;
  int64_t bad = 0;
  for (int64_t i = 0; i < 3 * build->vertices; i++) {
    bad += !is_usable(p[i]);
  }
  if (bad == 0) {
    return ORB_OK;
  }
  orb_error *error = NULL;
  unsigned char *seen = ORB_NEW0(build->ctx, unsigned char, build->vertices);
  if (!seen) {
    return ORB_E_NO_MEMORY;
  }
  for (int64_t h = 0; h < 3 * (int64_t)mesh->triangle_count; h++) {
    int32_t v = mesh->triangles[h];
    const double *at = p + 3 * (size_t)v;
    if (seen[v] || (is_usable(at[0]) && is_usable(at[1]) && is_usable(at[2]))) {
      continue;
    }
    seen[v] = 1;
    if (!error) {
      int finite = isfinite(at[0]) && isfinite(at[1]) && isfinite(at[2]);
      (void)orb_fail(build->ctx, ORB_E_NOT_FINITE,
                     finite ? "Vertex %d (counted from 0) has a coordinate beyond 1e30; scale the mesh down."
                            : "Vertex %d (counted from 0) has a coordinate that is not a finite number; correct it "
                              "or remove its faces.",
                     v);
      error = orb_context_error_edit(build->ctx);
    }
    error->vertex_total++;
    if (error->vertex_count < ORB_ERROR_ITEMS) {
      error->vertices[error->vertex_count++] = v;
    }
  }
  orb_free(build->ctx, seen);
  return error ? ORB_E_NOT_FINITE : ORB_OK;
}

/* The indices of a corner's vertex and attributes. */
static orb_corner corner_of(const orb_build *build, int64_t c) {
  orb_corner corner = build->corner_more ? build->corner_more[c] : (orb_corner){build->corner_vertex[c], -1, -1};
  if (build->by_vertex) {
    corner.texcoord = build->texcoord_count ? corner.vertex : -1;
    corner.normal = build->normal_count ? corner.vertex : -1;
  }
  return corner;
}

float orb_srgb_to_linear(float c) {
  return c <= 0.04045f ? c / 12.92f : powf((c + 0.055f) / 1.055f, 2.4f);
}

/* Colours above 1 are taken for bytes, 0 to 255. */
static void colors_to_linear(orb_build *build) {
  float most = 0;
  for (int64_t i = 0; i < 4 * build->vertices; i++) {
    if ((i & 3) != 3 && build->colors[i] > most) {
      most = build->colors[i];
    }
  }
  float scale = most > 1 ? 1.0f / 255 : 1;
  for (int64_t i = 0; i < 4 * build->vertices; i++) {
    float c = build->colors[i];
    if ((i & 3) == 3) {
      c = c > 1 ? c / 255 : c;
    } else {
      c *= scale;
    }
    c = c > 0 ? (c < 1 ? c : 1) : 0; /* NaN: 0 */
    build->colors[i] = (i & 3) == 3 || !build->colors_are_srgb ? c : orb_srgb_to_linear(c);
  }
}

static void fill_normals(const orb_build *build, orb_mesh *mesh, int64_t t, const orb_corner corner[3]) {
  double u[3], w[3], flat[3];
  const double *a = mesh->positions + 3 * (size_t)corner[0].vertex;
  orb_sub(mesh->positions + 3 * (size_t)corner[1].vertex, a, u);
  orb_sub(mesh->positions + 3 * (size_t)corner[2].vertex, a, w);
  orb_cross(u, w, flat);
  orb_normalize(flat);
  for (int k = 0; k < 3; k++) {
    double n[3] = {flat[0], flat[1], flat[2]};
    if (corner[k].normal >= 0) {
      const float *given = build->normals + 3 * (size_t)corner[k].normal;
      double g[3] = {(double)given[0], (double)given[1], (double)given[2]};
      double length = orb_normalize(g);
      if (length > 0 && isfinite(length)) {
        memcpy(n, g, sizeof n);
      }
    }
    if (!(orb_dot(n, n) > 0.5)) {
      n[0] = n[1] = 0;
      n[2] = 1; /* a face without area: any unit vector */
    }
    for (int i = 0; i < 3; i++) {
      mesh->normals[9 * t + 3 * k + i] = (float)n[i];
    }
  }
}

static void fill_triangle(const orb_build *build, orb_mesh *mesh, int64_t t, int64_t face, const int64_t corners[3]) {
  orb_corner corner[3];
  for (int k = 0; k < 3; k++) {
    corner[k] = corner_of(build, corners[k]);
    mesh->triangles[3 * t + k] = corner[k].vertex;
    if (mesh->texcoords && corner[k].texcoord >= 0) {
      mesh->texcoords[6 * t + 2 * k] = build->texcoords[2 * (size_t)corner[k].texcoord];
      float v = build->texcoords[2 * (size_t)corner[k].texcoord + 1];
      mesh->texcoords[6 * t + 2 * k + 1] = build->texcoords_v_down ? v : 1 - v;
    }
    if (mesh->colors) {
      memcpy(mesh->colors + 12 * t + 4 * k, build->colors + 4 * (size_t)corner[k].vertex, 4 * sizeof(float));
    }
  }
  if (mesh->normals) {
    fill_normals(build, mesh, t, corner);
  }
  if (mesh->material) {
    mesh->material[t] = build->face_material[face] < 0 ? (int32_t)build->material_count : build->face_material[face];
  }
}

static orb_status fill_triangles(orb_build *build, orb_mesh *mesh) {
  orb_context *ctx = build->ctx;
  orb_status status = ORB_OK;
  orb_polygon polygon = {0};
  int32_t *vertex = NULL, *cut = NULL;
  int64_t first = 0, t = 0, polygons = 0;
  if (build->face_size) {
    vertex = ORB_NEW(ctx, int32_t, build->largest_face);
    cut = ORB_NEW(ctx, int32_t, 3 * (size_t)build->largest_face);
    status = vertex && cut ? orb_polygon_reserve(ctx, &polygon, build->largest_face) : ORB_E_NO_MEMORY;
  }
  for (int64_t f = 0; f < build->faces && status == ORB_OK; f++) {
    int32_t size = build->face_size ? build->face_size[f] : 3;
    if (size == 3) {
      fill_triangle(build, mesh, t++, f, (int64_t[3]){first, first + 1, first + 2});
    } else {
      for (int32_t i = 0; i < size; i++) {
        vertex[i] = corner_of(build, first + i).vertex;
      }
      orb_polygon_cut(&polygon, mesh->positions, vertex, size, cut);
      for (int32_t i = 0; i < size - 2; i++) {
        const int32_t *c = cut + 3 * (size_t)i;
        fill_triangle(build, mesh, t++, f, (int64_t[3]){first + c[0], first + c[1], first + c[2]});
      }
      polygons++;
    }
    first += size;
    if ((f & 8191) == 0 || size > 8192) {
      status = orb_context_check(ctx);
    }
  }
  if (polygons && status == ORB_OK) {
    mesh->repairs[mesh->repair_count++] = (orb_repair){"triangulate", polygons};
  }
  orb_polygon_free(ctx, &polygon);
  orb_free(ctx, vertex);
  orb_free(ctx, cut);
  return status;
}

static int32_t *identity(orb_context *ctx, int64_t count) {
  int32_t *map = ORB_NEW(ctx, int32_t, count);
  for (int64_t i = 0; map && i < count; i++) {
    map[i] = (int32_t)i;
  }
  return map;
}

static orb_status move_materials(orb_build *build, orb_mesh *mesh) {
  mesh->dropped = build->dropped;
  mesh->dropped_count = build->dropped_count;
  build->dropped = NULL;
  mesh->objects = build->objects;
  mesh->object_count = (int32_t)build->object_count;
  build->objects = NULL;
  if (!build->face_material) {
    return ORB_OK;
  }
  /* a plain one more, for the faces before the first that names a material */
  ORB_TRY(orb_build_grow(build->ctx, &build->materials, &build->materials_room, build->material_count + 1,
                         sizeof(orb_material)));
  build->materials[build->material_count] =
      (orb_material){.base_color = {1, 1, 1, 1}, .metallic = 0, .roughness = 1, .base_texture.image = -1};
  int plain = 0;
  for (int64_t f = 0; f < build->faces; f++) {
    plain |= build->face_material[f] < 0;
  }
  mesh->materials = build->materials;
  mesh->material_count = (int32_t)build->material_count + plain;
  build->materials = NULL;
  mesh->material_values = build->material_values;
  mesh->material_value_count = (int32_t)build->value_count;
  build->material_values = NULL;
  return ORB_OK;
}

orb_status orb_build_finish(orb_build *build, int is_text, int64_t end, orb_mesh *out) {
  orb_context *ctx = build->ctx;
  ORB_TRY(check_indices(build, is_text, end));
  orb_mesh mesh = {0};
  size_t triangles = (size_t)build->triangles;
  mesh.vertex_count = mesh.file_vertex_count = (int32_t)build->vertices;
  mesh.triangle_count = mesh.file_triangle_count = (int32_t)build->triangles;
  mesh.positions = build->positions;
  build->positions = NULL;
  mesh.triangles = ORB_NEW(ctx, int32_t, 3 * triangles);
  mesh.source = identity(ctx, build->vertices);
  mesh.vertex_of_source = identity(ctx, build->vertices);
  mesh.source_triangle = identity(ctx, build->triangles);
  int has_normals = build->by_vertex ? build->normal_count > 0 : build->highest_normal >= 0;
  int has_texcoords = build->by_vertex ? build->texcoord_count > 0 : build->highest_texcoord >= 0;
  mesh.normals = has_normals ? ORB_NEW(ctx, float, 9 * triangles) : NULL;
  mesh.texcoords = has_texcoords ? ORB_NEW0(ctx, float, 6 * triangles) : NULL;
  mesh.colors = build->colors ? ORB_NEW(ctx, float, 12 * triangles) : NULL;
  mesh.material = build->face_material ? ORB_NEW(ctx, int32_t, triangles) : NULL;
  orb_status status = ORB_E_NO_MEMORY;
  if (!mesh.triangles || !mesh.source || !mesh.vertex_of_source || !mesh.source_triangle ||
      (has_normals && !mesh.normals) || (has_texcoords && !mesh.texcoords) || (build->colors && !mesh.colors) ||
      (build->face_material && !mesh.material)) {
    goto done;
  }
  if (build->colors) {
    if (build->color_room < build->vertices) { /* vertices after the last one with a colour are white */
      int64_t before = build->color_room;
      ORB_GO(status, orb_build_grow(ctx, &build->colors, &build->color_room, build->vertices, 4 * sizeof(float)), done);
      for (int64_t i = 4 * before; i < 4 * build->color_room; i++) {
        build->colors[i] = 1;
      }
    }
    colors_to_linear(build);
  }
  ORB_GO(status, fill_triangles(build, &mesh), done);
  build->positions = mesh.positions;
  status = check_coordinates(build, &mesh);
  build->positions = NULL;
  if (status == ORB_OK) {
    status = move_materials(build, &mesh);
  }

done:
  if (status == ORB_OK) {
    *out = mesh;
  } else {
    orb_mesh_free(ctx, &mesh);
  }
  return status;
}
