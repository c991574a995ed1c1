/* Refinement in place. A split touches a constant number of triangles: old ones keep their numbers and shrink, new ones
 * are appended, so numbers that were handed out stay valid. Attributes belong to corners and are interpolated. */
#include "align/sheet/sheet.h"

#include <string.h>

#include "base/check.h"
#include "base/error.h"
#include "base/memory.h"
#include "numeric/vec3.h"

orb_status orb_sheet_create(orb_context *ctx, const orb_mesh *mesh, const double *points, orb_sheet *out) {
  memset(out, 0, sizeof *out);
  orb_status status = orb_mesh_copy(ctx, mesh, &out->shape.mesh);
  if (status != ORB_OK) {
    return status;
  }
  int32_t vertices = mesh->vertex_count, triangles = mesh->triangle_count;
  out->given_vertices = vertices;
  out->given = mesh->triangles;
  out->vertex_capacity = vertices;
  out->triangle_capacity = triangles;
  out->shape.points = ORB_NEW(ctx, double, 3 * (size_t)vertices);
  out->shape.parent = ORB_NEW(ctx, int32_t, triangles);
  out->twin = ORB_NEW(ctx, int32_t, 3 * (size_t)triangles);
  out->corner = ORB_NEW(ctx, int32_t, vertices);
  out->origin = ORB_NEW(ctx, orb_origin, 0);
  if (!out->shape.points || !out->shape.parent || !out->twin || !out->corner || !out->origin) {
    status = ORB_E_NO_MEMORY;
    goto end;
  }
  ORB_GO(status, orb_mesh_twins(ctx, mesh->triangles, triangles, vertices, out->twin), end);
  memcpy(out->shape.points, points, 3 * (size_t)vertices * sizeof(double));
  for (int32_t t = 0; t < triangles; t++) {
    out->shape.parent[t] = t;
  }
  for (int32_t h = 3 * triangles - 1; h >= 0; h--) {
    out->corner[mesh->triangles[h]] = h;
  }
end:
  if (status != ORB_OK) {
    orb_sheet_free(ctx, out);
  }
  return status;
}

void orb_aligned_shape_free(orb_context *ctx, orb_aligned_shape *shape) {
  orb_mesh_free(ctx, &shape->mesh);
  orb_free(ctx, shape->parent);
  orb_free(ctx, shape->points);
  orb_free(ctx, shape->landmark_vertices);
  memset(shape, 0, sizeof *shape);
}

void orb_sheet_free(orb_context *ctx, orb_sheet *sheet) {
  orb_aligned_shape_free(ctx, &sheet->shape);
  orb_free(ctx, sheet->twin);
  orb_free(ctx, sheet->corner);
  orb_free(ctx, sheet->origin);
  memset(sheet, 0, sizeof *sheet);
}

void orb_sheet_release(orb_context *ctx, orb_sheet *sheet, orb_aligned_shape *out) {
  *out = sheet->shape;
  orb_free(ctx, sheet->twin);
  orb_free(ctx, sheet->corner);
  orb_free(ctx, sheet->origin);
  memset(sheet, 0, sizeof *sheet);
}

static void *copy_block(orb_context *ctx, const void *block, size_t count, size_t size) {
  void *copy = orb_alloc(ctx, count, size);
  if (copy) {
    memcpy(copy, block, count * size);
  }
  return copy;
}

orb_status orb_sheet_copy(orb_context *ctx, const orb_sheet *sheet, orb_sheet *out) {
  memset(out, 0, sizeof *out);
  const orb_mesh *mesh = &sheet->shape.mesh;
  orb_status status = orb_mesh_copy(ctx, mesh, &out->shape.mesh);
  if (status != ORB_OK) {
    return status;
  }
  size_t vertices = (size_t)mesh->vertex_count, triangles = (size_t)mesh->triangle_count;
  out->given_vertices = sheet->given_vertices;
  out->given = sheet->given;
  out->vertex_capacity = mesh->vertex_count;
  out->triangle_capacity = mesh->triangle_count;
  out->shape.points = copy_block(ctx, sheet->shape.points, 3 * vertices, sizeof(double));
  out->shape.parent = copy_block(ctx, sheet->shape.parent, triangles, sizeof(int32_t));
  out->twin = copy_block(ctx, sheet->twin, 3 * triangles, sizeof(int32_t));
  out->corner = copy_block(ctx, sheet->corner, vertices, sizeof(int32_t));
  int failed = !out->shape.points || !out->shape.parent || !out->twin || !out->corner;
  if (sheet->origin) {
    out->origin = copy_block(ctx, sheet->origin, vertices - (size_t)sheet->given_vertices, sizeof(orb_origin));
    failed |= !out->origin;
  }
  if (sheet->shape.landmark_vertices && !failed) {
    out->landmark_count = sheet->landmark_count;
    out->shape.landmark_vertices =
        copy_block(ctx, sheet->shape.landmark_vertices, (size_t)sheet->landmark_count, sizeof(int32_t));
    failed = !out->shape.landmark_vertices;
  }
  if (failed) {
    orb_sheet_free(ctx, out);
    return ORB_E_NO_MEMORY;
  }
  return ORB_OK;
}

/* Grows an array to `capacity` elements; NULL stays NULL. */
static int grow(orb_context *ctx, void *array, size_t capacity, size_t size) {
  void **slot = array, *block;
  memcpy(&block, slot, sizeof block);
  if (!block) {
    return 1;
  }
  block = orb_realloc(ctx, block, capacity, size);
  if (!block) {
    return 0;
  }
  memcpy(slot, &block, sizeof block);
  return 1;
}

static int32_t larger(int32_t capacity) {
  return capacity > INT32_MAX / 4 ? -1 : capacity + capacity / 2 + 64;
}

/* Room for one vertex and two triangles more. */
static orb_status make_room(orb_context *ctx, orb_sheet *s) {
  orb_mesh *mesh = &s->shape.mesh;
  if (mesh->vertex_count == s->vertex_capacity) {
    int32_t capacity = larger(s->vertex_capacity);
    if (capacity < 0) {
      return orb_fail(ctx, ORB_E_TOO_LARGE, "A mesh grew beyond what its index type holds; send a smaller one.");
    }
    if (!grow(ctx, &mesh->positions, 3 * (size_t)capacity, sizeof(double)) ||
        !grow(ctx, &mesh->source, (size_t)capacity, sizeof(int32_t)) ||
        !grow(ctx, &s->shape.points, 3 * (size_t)capacity, sizeof(double)) ||
        !grow(ctx, &s->origin, (size_t)(capacity - s->given_vertices), sizeof(orb_origin)) ||
        !grow(ctx, &s->corner, (size_t)capacity, sizeof(int32_t))) {
      return ORB_E_NO_MEMORY;
    }
    s->vertex_capacity = capacity;
  }
  if (mesh->triangle_count > s->triangle_capacity - 2) {
    int32_t capacity = larger(s->triangle_capacity);
    if (capacity < 0 || capacity > INT32_MAX / 3) {
      return orb_fail(ctx, ORB_E_TOO_LARGE, "A mesh grew beyond what its index type holds; send a smaller one.");
    }
    size_t corners = 3 * (size_t)capacity;
    if (!grow(ctx, &mesh->triangles, corners, sizeof(int32_t)) || !grow(ctx, &s->twin, corners, sizeof(int32_t)) ||
        !grow(ctx, &mesh->normals, 3 * corners, sizeof(float)) ||
        !grow(ctx, &mesh->texcoords, 2 * corners, sizeof(float)) ||
        !grow(ctx, &mesh->colors, 4 * corners, sizeof(float)) ||
        !grow(ctx, &mesh->material, (size_t)capacity, sizeof(int32_t)) ||
        !grow(ctx, &mesh->source_triangle, (size_t)capacity, sizeof(int32_t)) ||
        !grow(ctx, &s->shape.parent, (size_t)capacity, sizeof(int32_t))) {
      return ORB_E_NO_MEMORY;
    }
    s->triangle_capacity = capacity;
  }
  return ORB_OK;
}

/* The attributes of one corner, held while a triangle is rewritten. */
typedef struct corner_values {
  float normal[3], texcoord[2], color[4];
} corner_values;

static void corner_load(const orb_mesh *mesh, int32_t h, corner_values *out) {
  if (mesh->normals) {
    memcpy(out->normal, mesh->normals + 3 * (size_t)h, sizeof out->normal);
  }
  if (mesh->texcoords) {
    memcpy(out->texcoord, mesh->texcoords + 2 * (size_t)h, sizeof out->texcoord);
  }
  if (mesh->colors) {
    memcpy(out->color, mesh->colors + 4 * (size_t)h, sizeof out->color);
  }
}

static void corner_store(orb_mesh *mesh, int32_t h, const corner_values *values) {
  if (mesh->normals) {
    memcpy(mesh->normals + 3 * (size_t)h, values->normal, sizeof values->normal);
  }
  if (mesh->texcoords) {
    memcpy(mesh->texcoords + 2 * (size_t)h, values->texcoord, sizeof values->texcoord);
  }
  if (mesh->colors) {
    memcpy(mesh->colors + 4 * (size_t)h, values->color, sizeof values->color);
  }
}

static void blend(const float *a, const float *b, const float *c, const double w[3], int n, float *out) {
  for (int k = 0; k < n; k++) {
    out[k] = (float)(w[0] * (double)a[k] + w[1] * (double)b[k] + w[2] * (double)c[k]);
  }
}

static void corner_blend(const orb_mesh *mesh, const corner_values v[3], const double w[3], corner_values *out) {
  if (mesh->normals) {
    blend(v[0].normal, v[1].normal, v[2].normal, w, 3, out->normal);
    double n[3] = {(double)out->normal[0], (double)out->normal[1], (double)out->normal[2]};
    if (orb_normalize(n) > 0) {
      for (int k = 0; k < 3; k++) {
        out->normal[k] = (float)n[k];
      }
    }
  }
  if (mesh->texcoords) {
    blend(v[0].texcoord, v[1].texcoord, v[2].texcoord, w, 2, out->texcoord);
  }
  if (mesh->colors) {
    blend(v[0].color, v[1].color, v[2].color, w, 4, out->color);
  }
}

static void origin_add(orb_origin *o, int32_t vertex, double weight) {
  int k = 0;
  while (k < 2 && o->vertex[k] >= 0 && o->vertex[k] != vertex) {
    k++;
  }
  ORB_ASSERT(o->vertex[k] < 0 || o->vertex[k] == vertex);
  o->vertex[k] = vertex;
  o->weight[k] += weight;
}

/* The mix of three vertices of one triangle, over the corners of that triangle's parent. */
static void origin_mix(const orb_sheet *s, const int32_t v[3], const double w[3], orb_origin *out) {
  *out = (orb_origin){{-1, -1, -1}, {0, 0, 0}};
  for (int i = 0; i < 3; i++) {
    if (w[i] == 0) {
      continue;
    }
    if (v[i] < s->given_vertices) {
      origin_add(out, v[i], w[i]);
      continue;
    }
    const orb_origin *from = &s->origin[v[i] - s->given_vertices];
    for (int k = 0; k < 3 && from->vertex[k] >= 0; k++) {
      origin_add(out, from->vertex[k], w[i] * from->weight[k]);
    }
  }
}

/* A new vertex at a barycentric mix of three old ones. */
static int32_t add_vertex(orb_sheet *s, const int32_t v[3], const double w[3]) {
  orb_mesh *mesh = &s->shape.mesh;
  int32_t m = mesh->vertex_count++;
  if (s->origin) {
    origin_mix(s, v, w, &s->origin[m - s->given_vertices]);
  }
  double *x = mesh->positions + 3 * (size_t)m, *p = s->shape.points + 3 * (size_t)m;
  for (int k = 0; k < 3; k++) {
    x[k] = p[k] = 0;
    for (int i = 0; i < 3; i++) {
      x[k] += w[i] * mesh->positions[3 * (size_t)v[i] + (size_t)k];
      p[k] += w[i] * s->shape.points[3 * (size_t)v[i] + (size_t)k];
    }
  }
  orb_normalize(p);
  if (mesh->source) {
    mesh->source[m] = -1;
  }
  return m;
}

static int32_t add_triangle(orb_sheet *s, int32_t like) {
  orb_mesh *mesh = &s->shape.mesh;
  int32_t t = mesh->triangle_count++;
  s->shape.parent[t] = s->shape.parent[like];
  if (mesh->material) {
    mesh->material[t] = mesh->material[like];
  }
  if (mesh->source_triangle) {
    mesh->source_triangle[t] = mesh->source_triangle[like];
  }
  return t;
}

static void link(orb_sheet *s, int32_t g, int32_t h) {
  s->twin[g] = h;
  s->twin[h] = g;
}

/* One side of an edge split: the triangle (a, b, c) of h becomes (a, m, c), and (m, b, c) is new. Returns the half-edge
 * of the new triangle from m to b. */
static int32_t split_side(orb_sheet *s, int32_t h, double t, int32_t m) {
  orb_mesh *mesh = &s->shape.mesh;
  int32_t next = orb_next(h), prev = orb_prev(h), far = s->twin[next];
  corner_values v[3], mid;
  corner_load(mesh, h, &v[0]);
  corner_load(mesh, next, &v[1]);
  corner_load(mesh, prev, &v[2]);
  corner_blend(mesh, v, (const double[3]){1 - t, t, 0}, &mid);
  int32_t n = 3 * add_triangle(s, h / 3) + h % 3;
  int32_t n1 = orb_next(n), n2 = orb_prev(n);
  mesh->triangles[n] = m;
  mesh->triangles[n1] = mesh->triangles[next];
  mesh->triangles[n2] = mesh->triangles[prev];
  mesh->triangles[next] = m;
  corner_store(mesh, next, &mid);
  corner_store(mesh, n, &mid);
  corner_store(mesh, n1, &v[1]);
  corner_store(mesh, n2, &v[2]);
  link(s, n1, far);
  link(s, n2, next);
  s->corner[mesh->triangles[n1]] = n1;
  return n;
}

orb_status orb_sheet_split_edge(orb_context *ctx, orb_sheet *s, int32_t h, double t, int32_t *vertex) {
  ORB_TRY(make_room(ctx, s));
  orb_mesh *mesh = &s->shape.mesh;
  int32_t g = s->twin[h], a = mesh->triangles[h], b = mesh->triangles[g];
  int32_t m = add_vertex(s, (const int32_t[3]){a, b, a}, (const double[3]){1 - t, t, 0});
  int32_t mb = split_side(s, h, t, m), ma = split_side(s, g, 1 - t, m);
  link(s, h, ma);
  link(s, g, mb);
  s->corner[m] = mb;
  s->corner[a] = h;
  s->corner[b] = g;
  *vertex = m;
  return ORB_OK;
}

orb_status orb_sheet_split_triangle(orb_context *ctx, orb_sheet *s, int32_t triangle, const double at[3],
                                    int32_t *vertex) {
  ORB_TRY(make_room(ctx, s));
  orb_mesh *mesh = &s->shape.mesh;
  int32_t h = 3 * triangle, far[3] = {s->twin[h], s->twin[h + 1], s->twin[h + 2]}, v[3];
  corner_values values[3], mid;
  for (int k = 0; k < 3; k++) {
    v[k] = mesh->triangles[h + k];
    corner_load(mesh, h + k, &values[k]);
  }
  corner_blend(mesh, values, at, &mid);
  int32_t m = add_vertex(s, v, at);
  int32_t part[3] = {h, 3 * add_triangle(s, triangle), 3 * add_triangle(s, triangle)};
  for (int k = 0; k < 3; k++) {
    int32_t p = part[k], next = (k + 1) % 3;
    mesh->triangles[p] = v[k];
    mesh->triangles[p + 1] = v[next];
    mesh->triangles[p + 2] = m;
    corner_store(mesh, p, &values[k]);
    corner_store(mesh, p + 1, &values[next]);
    corner_store(mesh, p + 2, &mid);
    link(s, p, far[k]);
    s->corner[v[k]] = p;
  }
  for (int k = 0; k < 3; k++) {
    link(s, part[k] + 1, part[(k + 1) % 3] + 2);
  }
  s->corner[m] = h + 2;
  *vertex = m;
  return ORB_OK;
}

int32_t orb_sheet_edge(const orb_sheet *s, int32_t a, int32_t b) {
  int32_t start = s->corner[a], h = start;
  do {
    if (s->shape.mesh.triangles[orb_next(h)] == b) {
      return h;
    }
    h = orb_sheet_swing(s, h);
  } while (h != start);
  return -1;
}
