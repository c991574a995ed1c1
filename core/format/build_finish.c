#include "format/build_finish.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/context.h"
#include "base/error.h"
#include "base/memory.h"
#include "mesh/polygon.h"
#include "numeric/vec3.h"

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
