#include "mesh/edit.h"

#include <string.h>

#include "base/check.h"
#include "base/error.h"
#include "base/grow.h"
#include "base/memory.h"
#include "numeric/vec3.h"

static void move_face(orb_mesh *mesh, size_t from, size_t to) {
  if (from == to) {
    return;
  }
  memcpy(mesh->triangles + 3 * to, mesh->triangles + 3 * from, 3 * sizeof(int32_t));
  mesh->source_triangle[to] = mesh->source_triangle[from];
  if (mesh->normals) {
    memcpy(mesh->normals + 9 * to, mesh->normals + 9 * from, 9 * sizeof(float));
  }
  if (mesh->texcoords) {
    memcpy(mesh->texcoords + 6 * to, mesh->texcoords + 6 * from, 6 * sizeof(float));
  }
  if (mesh->colors) {
    memcpy(mesh->colors + 12 * to, mesh->colors + 12 * from, 12 * sizeof(float));
  }
  if (mesh->material) {
    mesh->material[to] = mesh->material[from];
  }
}

int32_t orb_mesh_drop_faces(orb_mesh *mesh, const unsigned char *drop) {
  int32_t kept = 0, before = mesh->triangle_count;
  for (int32_t t = 0; t < before; t++) {
    if (!drop[t]) {
      move_face(mesh, (size_t)t, (size_t)kept++);
    }
  }
  mesh->triangle_count = kept;
  return before - kept;
}

static void swap_floats(float *a, float *b, int count) {
  for (int i = 0; i < count; i++) {
    float x = a[i];
    a[i] = b[i];
    b[i] = x;
  }
}

void orb_mesh_reverse_face(orb_mesh *mesh, int32_t triangle) {
  size_t t = (size_t)triangle;
  int32_t *c = mesh->triangles + 3 * t, b = c[1];
  c[1] = c[2];
  c[2] = b;
  if (mesh->texcoords) {
    swap_floats(mesh->texcoords + 6 * t + 2, mesh->texcoords + 6 * t + 4, 2);
  }
  if (mesh->colors) {
    swap_floats(mesh->colors + 12 * t + 4, mesh->colors + 12 * t + 8, 4);
  }
  if (mesh->normals) {
    float *n = mesh->normals + 9 * t;
    swap_floats(n + 3, n + 6, 3);
    double u[3], w[3], face[3];
    orb_sub(mesh->positions + 3 * (size_t)c[1], mesh->positions + 3 * (size_t)c[0], u);
    orb_sub(mesh->positions + 3 * (size_t)c[2], mesh->positions + 3 * (size_t)c[0], w);
    orb_cross(u, w, face);
    for (int k = 0; k < 9; k += 3) {
      if ((double)n[k] * face[0] + (double)n[k + 1] * face[1] + (double)n[k + 2] * face[2] < 0) {
        n[k] = -n[k];
        n[k + 1] = -n[k + 1];
        n[k + 2] = -n[k + 2];
      }
    }
  }
}

static int regrow(orb_context *ctx, void *array, size_t count, size_t size, int wanted) {
  return !wanted || orb_regrow(ctx, array, count, size);
}

orb_status orb_mesh_reserve(orb_context *ctx, orb_mesh *mesh, int32_t more_vertices, int32_t more_triangles) {
  size_t v = (size_t)mesh->vertex_count + (size_t)more_vertices;
  size_t t = (size_t)mesh->triangle_count + (size_t)more_triangles;
  if (3 * v > INT32_MAX || 3 * t > INT32_MAX) {
    return orb_fail(ctx, ORB_E_TOO_LARGE, "The repaired mesh would be too large; decimate it first.");
  }
  int good = regrow(ctx, &mesh->positions, 3 * v, sizeof(double), more_vertices) &&
             regrow(ctx, &mesh->source, v, sizeof(int32_t), more_vertices) &&
             regrow(ctx, &mesh->triangles, 3 * t, sizeof(int32_t), more_triangles) &&
             regrow(ctx, &mesh->source_triangle, t, sizeof(int32_t), more_triangles) &&
             regrow(ctx, &mesh->normals, 9 * t, sizeof(float), more_triangles && mesh->normals) &&
             regrow(ctx, &mesh->texcoords, 6 * t, sizeof(float), more_triangles && mesh->texcoords) &&
             regrow(ctx, &mesh->colors, 12 * t, sizeof(float), more_triangles && mesh->colors) &&
             regrow(ctx, &mesh->material, t, sizeof(int32_t), more_triangles && mesh->material);
  return good ? ORB_OK : ORB_E_NO_MEMORY;
}

void orb_mesh_apply_weld(orb_mesh *mesh, const int32_t *stands) {
  for (int64_t h = 0; h < 3 * (int64_t)mesh->triangle_count; h++) {
    mesh->triangles[h] = stands[mesh->triangles[h]];
  }
  for (int32_t f = 0; f < mesh->file_vertex_count; f++) {
    mesh->vertex_of_source[f] = stands[mesh->vertex_of_source[f]];
  }
}

orb_status orb_mesh_compact(orb_context *ctx, orb_mesh *mesh, int64_t *dropped) {
  *dropped = 0;
  int32_t *number = ORB_NEW0(ctx, int32_t, mesh->vertex_count);
  if (!number) {
    return ORB_E_NO_MEMORY;
  }
  int64_t half_edges = 3 * (int64_t)mesh->triangle_count;
  for (int64_t h = 0; h < half_edges; h++) {
    number[mesh->triangles[h]] = 1;
  }
  int32_t kept = 0;
  for (int32_t v = 0; v < mesh->vertex_count; v++) {
    number[v] = number[v] ? kept++ : -1;
  }
  if (kept < mesh->vertex_count) {
    for (int32_t v = 0; v < mesh->vertex_count; v++) {
      if (number[v] < 0) {
        *dropped += mesh->vertex_of_source[mesh->source[v]] == v;
      } else if (number[v] != v) {
        memcpy(mesh->positions + 3 * (size_t)number[v], mesh->positions + 3 * (size_t)v, 3 * sizeof(double));
        mesh->source[number[v]] = mesh->source[v];
      }
    }
    for (int64_t h = 0; h < half_edges; h++) {
      mesh->triangles[h] = number[mesh->triangles[h]];
    }
    for (int32_t f = 0; f < mesh->file_vertex_count; f++) {
      mesh->vertex_of_source[f] = mesh->vertex_of_source[f] < 0 ? -1 : number[mesh->vertex_of_source[f]];
    }
    mesh->vertex_count = kept;
  }
  orb_free(ctx, number);
  return ORB_OK;
}

int32_t orb_mesh_flag_degenerate(const orb_mesh *mesh, unsigned char *drop) {
  int32_t count = 0;
  for (int32_t t = 0; t < mesh->triangle_count; t++) {
    const int32_t *c = mesh->triangles + 3 * (size_t)t;
    drop[t] = c[0] == c[1] || c[1] == c[2] || c[2] == c[0];
    count += drop[t];
  }
  return count;
}

/* The k-th smallest of a face's labels. */
static int32_t label_of(const orb_mesh *mesh, const int32_t *label, int32_t t, int k) {
  const int32_t *c = mesh->triangles + 3 * (size_t)t;
  int32_t a = label ? label[c[0]] : c[0], b = label ? label[c[1]] : c[1], d = label ? label[c[2]] : c[2];
  int32_t low = a < b ? a : b, high = a < b ? b : a;
  if (k == 0) {
    return low < d ? low : d;
  }
  if (k == 2) {
    return high > d ? high : d;
  }
  return d < low ? low : d > high ? high : d;
}

orb_status orb_mesh_flag_duplicates(orb_context *ctx, const orb_mesh *mesh, const int32_t *label,
                                    const unsigned char *candidate, unsigned char *drop, int32_t *first,
                                    int32_t *count) {
  *count = 0;
  int32_t n = 0, faces = mesh->triangle_count, labels = mesh->vertex_count;
  int32_t *order = ORB_NEW(ctx, int32_t, faces), *other = ORB_NEW(ctx, int32_t, faces);
  int32_t *start = ORB_NEW(ctx, int32_t, (size_t)labels + 1);
  orb_status status = order && other && start ? ORB_OK : ORB_E_NO_MEMORY;
  for (int32_t t = 0; t < faces && status == ORB_OK; t++) {
    drop[t] = 0;
    if (first) {
      first[t] = t;
    }
    if (!candidate || candidate[t]) {
      order[n++] = t;
    }
  }
  for (int k = 2; k >= 0 && status == ORB_OK; k--) { /* stable counting sorts, the last label first */
    memset(start, 0, ((size_t)labels + 1) * sizeof *start);
    for (int32_t i = 0; i < n; i++) {
      start[label_of(mesh, label, order[i], k) + 1]++;
    }
    for (int32_t v = 0; v < labels; v++) {
      start[v + 1] += start[v];
    }
    for (int32_t i = 0; i < n; i++) {
      other[start[label_of(mesh, label, order[i], k)]++] = order[i];
    }
    int32_t *swap = order;
    order = other;
    other = swap;
    status = orb_context_check(ctx);
  }
  for (int32_t i = 1, lead = 0; i < n && status == ORB_OK; i++) {
    int32_t a = order[lead], b = order[i];
    int same = 1;
    for (int k = 0; k < 3; k++) {
      same &= label_of(mesh, label, a, k) == label_of(mesh, label, b, k);
    }
    if (same) {
      drop[b] = 1;
      ++*count;
      if (first) {
        first[b] = a;
      }
    } else {
      lead = i;
    }
  }
  orb_free(ctx, order);
  orb_free(ctx, other);
  orb_free(ctx, start);
  return status;
}

void orb_mesh_note(orb_mesh *mesh, const char *kind, int64_t count) {
  if (count <= 0) {
    return;
  }
  for (int32_t i = 0; i < mesh->repair_count; i++) {
    if (strcmp(mesh->repairs[i].kind, kind) == 0) {
      mesh->repairs[i].count += count;
      return;
    }
  }
  ORB_ASSERT(mesh->repair_count < ORB_REPAIR_KINDS_MAX);
  mesh->repairs[mesh->repair_count++] = (orb_repair){kind, count};
}
