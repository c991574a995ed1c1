/* Meshes as objects: free, copy, measure; places.
 *
 * In: a mesh as a reader left it. Out: one that can be embedded, or an error with the facts. Reading order of the
 * folder: repair.c (the sequence of repairs and checks), surface (the mesh with its twins, pieces, fans and loops),
 * edges (twins), edit (changes that keep attributes), weld, fill and polygon (seams, holes, polygons),
 * parts (pieces by size and name), dijkstra, labels, cycles and handles (handles: their loops, and how they are
 * closed), refuse (the errors). topology.c measures any index list, nearest.c finds nearest points, normals computes
 * normals, sort.h sorts.
 */
#include <string.h>

#include "base/check.h"
#include "base/error.h"
#include "numeric/vec3.h"
#include "orbmorph/mesh.h"

void orb_mesh_drop_attributes(orb_context *ctx, orb_mesh *mesh) {
  for (int32_t i = 0; mesh->images && i < mesh->image_count; i++) {
    orb_free(ctx, mesh->images[i].bytes);
  }
  void *blocks[] = {mesh->normals,   mesh->texcoords,       mesh->colors, mesh->material,
                    mesh->materials, mesh->material_values, mesh->images, mesh->dropped};
  for (size_t i = 0; i < sizeof blocks / sizeof *blocks; i++) {
    orb_free(ctx, blocks[i]);
  }
  mesh->normals = mesh->texcoords = mesh->colors = NULL;
  mesh->material = NULL;
  mesh->materials = NULL;
  mesh->material_values = NULL;
  mesh->images = NULL;
  mesh->dropped = NULL;
  mesh->material_count = mesh->material_value_count = mesh->image_count = mesh->dropped_count = 0;
}

void orb_mesh_free(orb_context *ctx, orb_mesh *mesh) {
  void *blocks[] = {mesh->positions,       mesh->triangles, mesh->source,        mesh->vertex_of_source,
                    mesh->source_triangle, mesh->handles,   mesh->loop_vertices, mesh->objects};
  orb_mesh_drop_attributes(ctx, mesh);
  for (size_t i = 0; i < sizeof blocks / sizeof *blocks; i++) {
    orb_free(ctx, blocks[i]);
  }
  memset(mesh, 0, sizeof *mesh);
}

/* A copy of a block that may be NULL; clears *good where memory runs out. */
static void *copy_block(orb_context *ctx, const void *block, size_t count, size_t size, int *good) {
  void *copy = block ? orb_alloc(ctx, count, size) : NULL;
  if (copy && count) {
    memcpy(copy, block, count * size);
  }
  *good &= !block || copy;
  return copy;
}

orb_status orb_mesh_copy(orb_context *ctx, const orb_mesh *mesh, orb_mesh *out) {
  size_t v = (size_t)mesh->vertex_count, t = (size_t)mesh->triangle_count;
  int good = 1;
  orb_mesh copy = *mesh;
  copy.positions = copy_block(ctx, mesh->positions, 3 * v, sizeof(double), &good);
  copy.triangles = copy_block(ctx, mesh->triangles, 3 * t, sizeof(int32_t), &good);
  copy.source = copy_block(ctx, mesh->source, v, sizeof(int32_t), &good);
  copy.vertex_of_source =
      copy_block(ctx, mesh->vertex_of_source, (size_t)mesh->file_vertex_count, sizeof(int32_t), &good);
  copy.source_triangle = copy_block(ctx, mesh->source_triangle, t, sizeof(int32_t), &good);
  copy.objects = copy_block(ctx, mesh->objects, (size_t)mesh->object_count, sizeof(orb_object), &good);
  copy.handles = copy_block(ctx, mesh->handles, (size_t)mesh->handle_count, sizeof(orb_handle), &good);
  copy.loop_vertices = copy_block(ctx, mesh->loop_vertices, (size_t)mesh->loop_vertex_count, sizeof(int32_t), &good);
  copy.normals = copy_block(ctx, mesh->normals, 9 * t, sizeof(float), &good);
  copy.texcoords = copy_block(ctx, mesh->texcoords, 6 * t, sizeof(float), &good);
  copy.colors = copy_block(ctx, mesh->colors, 12 * t, sizeof(float), &good);
  copy.material = copy_block(ctx, mesh->material, t, sizeof(int32_t), &good);
  copy.materials = copy_block(ctx, mesh->materials, (size_t)mesh->material_count, sizeof(orb_material), &good);
  copy.material_values =
      copy_block(ctx, mesh->material_values, (size_t)mesh->material_value_count, sizeof(orb_material_value), &good);
  copy.dropped = copy_block(ctx, mesh->dropped, (size_t)mesh->dropped_count, sizeof(orb_dropped), &good);
  copy.images = copy_block(ctx, mesh->images, (size_t)mesh->image_count, sizeof(orb_image), &good);
  for (int32_t i = 0; copy.images && i < copy.image_count; i++) {
    copy.images[i].bytes = good ? copy_block(ctx, mesh->images[i].bytes, mesh->images[i].size, 1, &good) : NULL;
  }
  if (!good) {
    orb_mesh_free(ctx, &copy);
    return ORB_E_NO_MEMORY;
  }
  *out = copy;
  return ORB_OK;
}

void orb_mesh_extent(const orb_mesh *mesh, orb_extent *out) {
  memset(out, 0, sizeof *out);
  if (mesh->vertex_count == 0) {
    return;
  }
  memcpy(out->min, mesh->positions, sizeof out->min);
  memcpy(out->max, mesh->positions, sizeof out->max);
  for (int32_t v = 1; v < mesh->vertex_count; v++) {
    for (int k = 0; k < 3; k++) {
      double x = mesh->positions[3 * (size_t)v + (size_t)k];
      out->min[k] = x < out->min[k] ? x : out->min[k];
      out->max[k] = x > out->max[k] ? x : out->max[k];
    }
  }
  double centre[3]; /* volumes are measured from here, so that a distant origin costs no digits */
  for (int k = 0; k < 3; k++) {
    centre[k] = 0.5 * out->min[k] + 0.5 * out->max[k];
  }
  double area = 0, volume = 0;
  for (int32_t t = 0; t < mesh->triangle_count; t++) {
    const int32_t *c = mesh->triangles + 3 * (size_t)t;
    double p[3], u[3], w[3], n[3];
    orb_sub(mesh->positions + 3 * (size_t)c[0], centre, p);
    orb_sub(mesh->positions + 3 * (size_t)c[1], mesh->positions + 3 * (size_t)c[0], u);
    orb_sub(mesh->positions + 3 * (size_t)c[2], mesh->positions + 3 * (size_t)c[0], w);
    orb_cross(u, w, n);
    area += orb_length(n);
    volume += orb_dot(p, n);
  }
  out->area = 0.5 * area;
  out->volume = volume / 6;
  out->diagonal = sqrt(orb_distance2(out->min, out->max));
}

void orb_place_position(const orb_mesh *mesh, const orb_place *place, double out[3]) {
  const int32_t *c = mesh->triangles + 3 * (size_t)place->triangle;
  for (int k = 0; k < 3; k++) {
    if (place->at[k] == 1.0) { /* a vertex: exactly its position */
      memcpy(out, mesh->positions + 3 * (size_t)c[k], 3 * sizeof(double));
      return;
    }
  }
  for (size_t i = 0; i < 3; i++) {
    out[i] = place->at[0] * mesh->positions[3 * (size_t)c[0] + i] +
             place->at[1] * mesh->positions[3 * (size_t)c[1] + i] +
             place->at[2] * mesh->positions[3 * (size_t)c[2] + i];
  }
}

orb_status orb_place_of_vertex(orb_context *ctx, const orb_mesh *mesh, int32_t vertex, orb_place *out) {
  for (int32_t h = 0; h < 3 * mesh->triangle_count; h++) {
    if (mesh->triangles[h] == vertex) {
      *out = (orb_place){.triangle = h / 3};
      out->at[h % 3] = 1;
      return ORB_OK;
    }
  }
  return orb_fail(ctx, ORB_E_BAD_OPTION, "Vertex %d belongs to no triangle.", vertex);
}
