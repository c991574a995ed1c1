#include "transfer/template.h"

#include <stddef.h>
#include <string.h>

#include "base/check.h"
#include "base/context.h"
#include "base/error.h"
#include "base/memory.h"
#include "mesh/normals.h"
#include "numeric/rotate_along.h"

enum { CHECK_EVERY = 65536 }; /* corners or triangles between two checks for cancellation */

/* What a corner of the file has besides its vertex; a vertex whose corners differ gets copies. */
typedef struct corner_value {
  float normal[3], texcoord[2], color[4];
} corner_value;

/* A vertex of the asset: first those of the file, then the copies. */
typedef struct made_vertex {
  corner_value value;
  int32_t of, next; /* the vertex of the file; its next copy, −1: none, −2: it has no value yet */
} made_vertex;

typedef struct maker {
  orb_context *ctx;
  const orb_draft *draft;
  const orb_mesh *file;
  made_vertex *all;
  int32_t count, capacity;
} maker;

void orb_template_free(orb_context *ctx, orb_template *made) {
  orb_free(ctx, made->mesh.triangles);
  orb_free(ctx, made->on_supermesh);
}

static corner_value value_of(const orb_mesh *file, int64_t h) {
  corner_value value = {0};
  if (file->normals) {
    memcpy(value.normal, file->normals + 3 * h, sizeof value.normal);
  }
  if (file->texcoords) {
    memcpy(value.texcoord, file->texcoords + 2 * h, sizeof value.texcoord);
  }
  if (file->colors) {
    memcpy(value.color, file->colors + 4 * h, sizeof value.color);
  }
  return value;
}

/* The vertex made for a corner: the one with its values, or a new copy. −1 if out of memory. */
static int32_t vertex_for(maker *m, int32_t v, const corner_value *value) {
  if (m->all[v].next == -2) {
    m->all[v].value = *value;
    m->all[v].next = -1;
    return v;
  }
  int32_t at = v;
  for (;; at = m->all[at].next) {
    if (memcmp(&m->all[at].value, value, sizeof *value) == 0) {
      return at;
    }
    if (m->all[at].next < 0) {
      break;
    }
  }
  if (m->count == m->capacity) {
    int32_t more = m->capacity + m->capacity / 4 + 64;
    made_vertex *all = orb_realloc(m->ctx, m->all, (size_t)more, sizeof *all);
    if (!all) {
      return -1;
    }
    m->all = all;
    m->capacity = more;
  }
  m->all[at].next = m->count;
  m->all[m->count] = (made_vertex){*value, v, -1};
  return m->count++;
}

static orb_status too_large(orb_context *ctx, const char *what) {
  orb_status status = orb_fail(ctx, ORB_E_TOO_LARGE,
                               "The first shape has too many %s for the method 'template'; use 'adaptive'.", what);
  orb_context_error_edit(ctx)->shape = 0;
  return status;
}

/* Fills the triangles of `made`. After them come the vertices by number, so that 3 · triangles + v is a corner of v. */
static orb_status make_vertices(maker *m, orb_template *made) {
  int64_t corners = 3 * (int64_t)m->file->triangle_count;
  m->count = m->file->vertex_count;
  m->capacity = m->count + m->count / 8 + 64;
  m->all = ORB_NEW0(m->ctx, made_vertex, m->capacity);
  int32_t *triangles = ORB_NEW(m->ctx, int32_t, corners);
  orb_status status = m->all && triangles ? ORB_OK : ORB_E_NO_MEMORY;
  for (int32_t v = 0; status == ORB_OK && v < m->count; v++) {
    m->all[v].of = v;
    m->all[v].next = -2;
  }
  for (int64_t h = 0; status == ORB_OK && h < corners; h++) {
    corner_value value = value_of(m->file, h);
    triangles[h] = vertex_for(m, m->file->triangles[h], &value);
    status = triangles[h] < 0 ? ORB_E_NO_MEMORY : h % CHECK_EVERY == 0 ? orb_context_check(m->ctx) : ORB_OK;
  }
  if (status == ORB_OK && corners + m->count > INT32_MAX) {
    status = too_large(m->ctx, "triangles");
  }
  if (status == ORB_OK) {
    made->mesh.triangles = ORB_NEW(m->ctx, int32_t, corners + m->count);
    made->on_supermesh = ORB_NEW(m->ctx, int32_t, m->count);
    status = made->mesh.triangles && made->on_supermesh ? ORB_OK : ORB_E_NO_MEMORY;
  }
  if (status == ORB_OK) {
    memcpy(made->mesh.triangles, triangles, (size_t)corners * sizeof *triangles);
    for (int32_t v = 0; v < m->count; v++) {
      made->mesh.triangles[corners + v] = v;
    }
    made->mesh.vertex_count = m->count;
    made->mesh.triangle_count = m->file->triangle_count;
    made->mesh.shape_count = m->draft->shape_count;
  }
  orb_free(m->ctx, triangles);
  return status;
}

/* The supermesh of the method has the vertices of the repaired mesh, in their order. */
int32_t orb_repaired_vertex(const orb_mesh *repaired, const orb_mesh *file, int32_t v) {
  int32_t number = file->source[v];
  return number >= 0 && number < repaired->file_vertex_count ? repaired->vertex_of_source[number] : -1;
}

int32_t orb_template_vertex(const orb_draft *draft, const orb_mesh *file, int32_t v) {
  int32_t at = orb_repaired_vertex(&draft->shapes[0].mesh, file, v);
  return at < draft->supermesh->vertex_count ? at : -1;
}

static void find_on_supermesh(const maker *m, orb_template *made) {
  for (int32_t v = 0; v < m->count; v++) {
    made->on_supermesh[v] = orb_template_vertex(m->draft, m->file, m->all[v].of);
  }
}

/* Positions as float32: the base is the file's, exactly where that has float32; the others are differences to it. A
 * vertex that a repair has moved onto another keeps its distance to that. */
static orb_status make_positions(const maker *m, const orb_template *made, orb_draft *out) {
  const orb_draft *draft = m->draft;
  out->base = ORB_NEW(m->ctx, float, 3 * (int64_t)m->count);
  out->deltas = ORB_NEW0(m->ctx, float *, draft->frame_count);
  if (!out->base || !out->deltas) {
    return ORB_E_NO_MEMORY;
  }
  for (int64_t i = 0; i < 3 * (int64_t)m->count; i++) {
    out->base[i] = (float)m->file->positions[3 * (int64_t)m->all[i / 3].of + i % 3];
  }
  for (int32_t f = 1; f < draft->frame_count; f++) {
    float *deltas = out->deltas[f - 1] = ORB_NEW0(m->ctx, float, 3 * (int64_t)m->count);
    if (!deltas) {
      return ORB_E_NO_MEMORY;
    }
    for (int64_t i = 0; i < 3 * (int64_t)m->count; i++) {
      int64_t at = made->on_supermesh[i / 3];
      if (at >= 0) {
        double rounded = (double)out->base[i] - m->file->positions[3 * (int64_t)m->all[i / 3].of + i % 3];
        deltas[i] = (float)(draft->positions[f][3 * at + i % 3] - draft->positions[0][3 * at + i % 3] - rounded);
      }
    }
  }
  return ORB_OK;
}

/* Rotates `normal` as the shortest rotation from `before` to `after` does; unit vectors. */
static void rotate_along(const double before[3], const double after[3], const float normal[3], float out[3]) {
  double n[3] = {(double)normal[0], (double)normal[1], (double)normal[2]}, rotated[3];
  orb_rotate_along(before, after, n, rotated);
  orb_normalize(rotated);
  for (int k = 0; k < 3; k++) {
    out[k] = (float)rotated[k];
  }
}

static orb_status make_normals(const maker *m, const orb_template *made, orb_draft *out) {
  const orb_draft *draft = m->draft;
  const orb_supermesh *mesh = draft->supermesh;
  double *first = ORB_NEW(m->ctx, double, 3 * (int64_t)mesh->vertex_count);
  double *other = ORB_NEW(m->ctx, double, 3 * (int64_t)mesh->vertex_count);
  out->normals = ORB_NEW0(m->ctx, orb_wedges, draft->frame_count);
  orb_status status = first && other && out->normals ? ORB_OK : ORB_E_NO_MEMORY;
  for (int32_t f = 0; status == ORB_OK && f < draft->frame_count; f++) {
    orb_wedges *normals = &out->normals[f];
    *normals = (orb_wedges){.width = 3, .value_count = m->count};
    normals->values = ORB_NEW0(m->ctx, float, 3 * (int64_t)m->count);
    status = normals->values ? orb_smooth_normals(m->ctx, draft->positions[f], mesh->vertex_count, mesh->triangles,
                                                  mesh->triangle_count, f ? other : first)
                             : ORB_E_NO_MEMORY;
    for (int32_t v = 0; status == ORB_OK && v < m->count; v++) {
      float *to = normals->values + 3 * (int64_t)v;
      int64_t at = made->on_supermesh[v];
      const float *before = f ? out->normals[0].values + 3 * (int64_t)v : m->all[v].value.normal;
      memcpy(to, before, 3 * sizeof *to);
      if (f == 0 && !m->file->normals && at >= 0) {
        for (int k = 0; k < 3; k++) {
          to[k] = (float)first[3 * at + k];
        }
      } else if (f > 0 && at >= 0 && orb_dot(other + 3 * at, other + 3 * at) > 0) {
        rotate_along(first + 3 * at, other + 3 * at, before, to);
      }
      if (f == 0 && to[0] == 0 && to[1] == 0 && to[2] == 0) {
        to[2] = 1; /* a normal must have unit length; no triangle shows this one */
      }
    }
  }
  orb_free(m->ctx, first);
  orb_free(m->ctx, other);
  return status;
}

/* One value of `width` floats per vertex made. */
static orb_status make_attribute(const maker *m, int32_t width, size_t offset, orb_wedges *out) {
  *out = (orb_wedges){.width = width, .value_count = m->count};
  out->values = ORB_NEW(m->ctx, float, (int64_t)width * m->count);
  for (int32_t v = 0; out->values && v < m->count; v++) {
    memcpy(out->values + (int64_t)width * v, (const char *)&m->all[v].value + offset, (size_t)width * sizeof(float));
  }
  return out->values ? ORB_OK : ORB_E_NO_MEMORY;
}

static orb_status make_attributes(const maker *m, orb_draft *out) {
  if (m->file->texcoords) {
    ORB_TRY(make_attribute(m, 2, offsetof(corner_value, texcoord), &out->texcoords));
  }
  if (m->file->colors) {
    out->colors = ORB_NEW0(m->ctx, orb_wedges, m->draft->frame_count);
    if (!out->colors) {
      return ORB_E_NO_MEMORY;
    }
    out->color_count = 1;
    ORB_TRY(make_attribute(m, 4, offsetof(corner_value, color), &out->colors[0]));
  }
  return ORB_OK;
}

static int32_t material_of(const maker *m, int32_t t) {
  int32_t count = m->draft->shapes[0].mesh.material_count, material = m->file->material ? m->file->material[t] : 0;
  return material >= 0 && material < count ? material : 0;
}

/* Adds an empty part for each material that triangles have. part_of: receives the part of each material. */
static orb_status add_parts(const maker *m, int32_t material_count, int32_t *part_of, orb_draft *out) {
  int32_t *used = ORB_NEW0(m->ctx, int32_t, material_count);
  orb_status status = used ? ORB_OK : ORB_E_NO_MEMORY;
  for (int32_t t = 0; status == ORB_OK && t < m->file->triangle_count; t++) {
    used[material_of(m, t)]++;
  }
  for (int32_t k = 0; status == ORB_OK && k < material_count; k++) {
    if (used[k] > 0) {
      orb_draft_part *part = &out->parts[out->part_count];
      part_of[k] = out->part_count++;
      part->material = k;
      part->vertex_count = m->count;
      part->indices = ORB_NEW(m->ctx, uint32_t, 3 * (int64_t)used[k]);
      status = part->indices ? ORB_OK : ORB_E_NO_MEMORY;
    }
  }
  orb_free(m->ctx, used);
  return status;
}

/* The corners of all vertices, which all parts share: so the asset has each vertex once, in the order of the file. */
static orb_status make_corners(const maker *m, const orb_template *made, orb_draft *out) {
  int32_t *corners = out->parts[0].corners = ORB_NEW(m->ctx, int32_t, m->count);
  for (int32_t v = 0; corners && v < m->count; v++) {
    corners[v] = 3 * made->mesh.triangle_count + v;
  }
  for (int32_t p = 1; p < out->part_count; p++) {
    out->parts[p].corners = corners;
  }
  out->shares_vertices = 1;
  return corners ? ORB_OK : ORB_E_NO_MEMORY;
}

static orb_status make_parts(const maker *m, const orb_template *made, orb_draft *out) {
  int32_t materials = m->draft->shapes[0].mesh.material_count > 0 ? m->draft->shapes[0].mesh.material_count : 1;
  int32_t *part_of = ORB_NEW(m->ctx, int32_t, materials);
  out->parts = ORB_NEW0(m->ctx, orb_draft_part, materials);
  orb_status status = part_of && out->parts ? add_parts(m, materials, part_of, out) : ORB_E_NO_MEMORY;
  for (int32_t t = 0; status == ORB_OK && t < made->mesh.triangle_count; t++) {
    orb_draft_part *part = &out->parts[part_of[material_of(m, t)]];
    uint32_t *to = part->indices + 3 * (int64_t)part->triangle_count++;
    for (int k = 0; k < 3; k++) {
      to[k] = (uint32_t)made->mesh.triangles[3 * (int64_t)t + k];
    }
    status = t % CHECK_EVERY == 0 ? orb_context_check(m->ctx) : ORB_OK;
  }
  if (status == ORB_OK && (int64_t)out->part_count * m->count > INT32_MAX) { /* what lists them has one a part */
    status = too_large(m->ctx, "materials");
  }
  orb_free(m->ctx, part_of);
  return status == ORB_OK ? make_corners(m, made, out) : status;
}

orb_status orb_template_draft(orb_context *ctx, const orb_draft *draft, const orb_mesh *file, orb_template *made,
                              orb_draft *out) {
  maker m = {.ctx = ctx, .draft = draft, .file = file};
  orb_status status = make_vertices(&m, made);
  *out = (orb_draft){.supermesh = &made->mesh,
                     .shapes = draft->shapes,
                     .options = draft->options,
                     .shape_count = draft->shape_count,
                     .frame_count = draft->frame_count,
                     .between_count = draft->between_count};
  if (status == ORB_OK) {
    find_on_supermesh(&m, made);
    ORB_GO(status, make_positions(&m, made, out), done);
    if (draft->options->normals) {
      ORB_GO(status, make_normals(&m, made, out), done);
    }
    ORB_GO(status, make_attributes(&m, out), done);
    ORB_GO(status, make_parts(&m, made, out), done);
  }
done:
  orb_free(ctx, m.all);
  return status;
}
