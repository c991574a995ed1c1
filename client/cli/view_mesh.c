#include "view_mesh.h"

#include <stdlib.h>
#include <string.h>

#include "view_glb.h"

/* The mesh to draw, and its first target that is a shape: an uploaded document to which targets were added may have
 * others before it. */
static const cJSON *find_mesh(const glb_file *r, uint32_t *first) {
  const cJSON *mesh;
  cJSON_ArrayForEach(mesh, cJSON_GetObjectItemCaseSensitive(r->json, "meshes")) {
    const cJSON *extras = cJSON_GetObjectItemCaseSensitive(mesh, "extras");
    if (cJSON_GetObjectItemCaseSensitive(extras, "firstShape")) {
      *first = (uint32_t)glb_code(extras, "firstShape", 0);
      return mesh;
    }
  }
  *first = 0;
  return glb_entry(r, "meshes", 0);
}

static int count_all(glb_file *r, const cJSON *primitives, uint32_t first, view_mesh *out) {
  const cJSON *primitive;
  uint64_t vertices = 0, indices = 0;
  cJSON_ArrayForEach(primitive, primitives) {
    glb_span s;
    const cJSON *attributes = cJSON_GetObjectItemCaseSensitive(primitive, "attributes");
    if (glb_number(primitive, "mode", 4) != 4 || glb_open(r, glb_number(attributes, "POSITION", -1), &s) != 0) {
      return glb_refuse(r, "cannot draw primitives other than triangles with positions");
    }
    vertices += s.count;
    if (glb_open(r, glb_number(primitive, "indices", -1), &s) != 0 || s.kind == GLB_FLOAT || s.count % 3 != 0) {
      return glb_refuse(r, "cannot draw triangles without indices");
    }
    indices += s.count;
    uint32_t targets = (uint32_t)cJSON_GetArraySize(cJSON_GetObjectItemCaseSensitive(primitive, "targets"));
    out->target_count = targets > first ? targets - first : 0;
  }
  if (vertices == 0 || vertices > UINT32_MAX / 16 || indices > UINT32_MAX / 2) {
    return glb_refuse(r, "the mesh is empty or too large");
  }
  out->vertex_count = (uint32_t)vertices;
  out->index_count = (uint32_t)indices;
  return 0;
}

/* White under a texture or a coloured material; a tone of clay under a grey material. */
static void base_colors(const view_mesh *mesh, int32_t material, uint32_t first, uint32_t count) {
  const view_material *paint = &mesh->materials.list[material];
  int gray = paint->texture < 0 && paint->factor[0] == paint->factor[1] && paint->factor[1] == paint->factor[2];
  for (size_t i = 0; i < 3 * (size_t)count; i++) {
    mesh->colors[3 * (size_t)first + i] = gray ? 0.9f - 0.05f * (float)(i % 3) : 1;
  }
}

static int read_indices(glb_file *r, const cJSON *primitive, view_mesh *out, uint32_t vertex, uint32_t count,
                        uint32_t *index) {
  glb_span s;
  if (glb_open(r, glb_number(primitive, "indices", -1), &s) != 0) {
    return -1;
  }
  for (uint32_t i = 0; i < s.count; i++) {
    uint32_t value = glb_index(&s, i);
    if (value >= count) {
      return glb_refuse(r, "an index is out of range");
    }
    out->indices[*index + i] = vertex + value;
  }
  *index += s.count;
  return 0;
}

static int read_primitive(glb_file *r, const cJSON *primitive, uint32_t skip, view_mesh *out, uint32_t *vertex,
                          uint32_t *index) {
  const cJSON *attributes = cJSON_GetObjectItemCaseSensitive(primitive, "attributes");
  glb_span s;
  if (glb_open(r, glb_number(attributes, "POSITION", -1), &s) != 0) {
    return -1;
  }
  uint32_t count = s.count, first = *index;
  size_t at = 3 * (size_t)*vertex;
  double named = glb_number(primitive, "material", -1);
  int32_t material = named >= 0 && named < out->materials.count - 1 ? (int32_t)named : out->materials.count - 1;
  base_colors(out, material, *vertex, count);
  if (glb_copy(r, attributes, "POSITION", count, 3, out->positions + at) != 0 ||
      glb_copy(r, attributes, "NORMAL", count, 3, out->normals + at) != 0 ||
      glb_copy(r, attributes, "COLOR_0", count, 3, out->colors + at) != 0 ||
      glb_copy(r, attributes, "TEXCOORD_0", count, 2, out->texcoords + 2 * (size_t)*vertex) != 0) {
    return -1;
  }
  view_material_move(&out->materials.list[material], out->texcoords + 2 * (size_t)*vertex, count);
  const cJSON *target = cJSON_GetObjectItemCaseSensitive(primitive, "targets");
  target = target ? target->child : NULL;
  for (; skip > 0 && target; skip--) {
    target = target->next;
  }
  for (uint32_t k = 0; k < out->target_count && target; k++, target = target->next) {
    size_t delta = 3 * (size_t)k * out->vertex_count + at;
    if (glb_copy(r, target, "POSITION", count, 3, out->delta_positions + delta) != 0 ||
        glb_copy(r, target, "NORMAL", count, 3, out->delta_normals + delta) != 0) {
      return -1;
    }
  }
  if (read_indices(r, primitive, out, *vertex, count, index) != 0) {
    return -1;
  }
  int flat = !cJSON_GetObjectItemCaseSensitive(attributes, "NORMAL");
  for (uint32_t i = first / 3; i < *index / 3; i++) {
    out->painted[i] = material;
    out->flat[i] = (unsigned char)flat;
  }
  *vertex += count;
  return 0;
}

static int allocate(view_mesh *out) {
  size_t floats = 3 * (size_t)out->vertex_count;
  out->positions = calloc(floats, sizeof(float));
  out->normals = calloc(floats, sizeof(float));
  out->colors = calloc(floats, sizeof(float));
  out->texcoords = calloc(floats, sizeof(float));
  out->delta_positions = calloc(floats * out->target_count + 1, sizeof(float));
  out->delta_normals = calloc(floats * out->target_count + 1, sizeof(float));
  out->indices = calloc(out->index_count + 1, sizeof(uint32_t));
  out->painted = calloc(out->index_count / 3 + 1, sizeof(int32_t));
  out->flat = calloc(out->index_count / 3 + 1, 1);
  return out->positions && out->normals && out->colors && out->texcoords && out->delta_positions &&
                 out->delta_normals && out->indices && out->painted && out->flat
             ? 0
             : -1;
}

static int read_mesh(glb_file *r, view_mesh *out) {
  uint32_t first;
  const cJSON *mesh = find_mesh(r, &first);
  const cJSON *primitives = cJSON_GetObjectItemCaseSensitive(mesh, "primitives"), *primitive;
  if (count_all(r, primitives, first, out) != 0 || view_materials_read(r, &out->materials) != 0) {
    return -1;
  }
  if (allocate(out) != 0) {
    return glb_refuse(r, "not enough memory");
  }
  double between = glb_number(cJSON_GetObjectItemCaseSensitive(mesh, "extras"), "inBetweens", 0);
  out->between = between < out->target_count ? (uint32_t)between : 0;
  uint32_t vertex = 0, index = 0;
  cJSON_ArrayForEach(primitive, primitives) {
    if (read_primitive(r, primitive, first, out, &vertex, &index) != 0) {
      return -1;
    }
  }
  return 0;
}

int view_mesh_read(const char *path, view_mesh *out, char *error, size_t error_size) {
  glb_file r = {.error = error, .error_size = error_size};
  memset(out, 0, sizeof *out);
  int rc = glb_load(&r, path) == 0 ? read_mesh(&r, out) : -1;
  glb_free(&r);
  if (rc != 0) {
    view_mesh_free(out);
  }
  return rc;
}

void view_mesh_free(view_mesh *mesh) {
  view_materials_free(&mesh->materials);
  free(mesh->painted);
  free(mesh->flat);
  free(mesh->positions);
  free(mesh->normals);
  free(mesh->colors);
  free(mesh->texcoords);
  free(mesh->delta_positions);
  free(mesh->delta_normals);
  free(mesh->indices);
  memset(mesh, 0, sizeof *mesh);
}

int view_shape_count(const view_mesh *mesh) {
  return (int)(mesh->target_count / (mesh->between + 1)) + 1;
}
