/* Reads alignments from bytes that may be anything. kept.h has the format. */
#include "merge/kept.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/error.h"
#include "base/grow.h"
#include "base/memory.h"

/* Takes bytes from the front. bad: something was wrong, and all later reads give zeros. */
typedef struct reader {
  const unsigned char *at;
  size_t left;
  int bad;
} reader;

static void take(reader *r, void *out, size_t size) {
  if (r->bad || size > r->left) {
    r->bad = 1;
    memset(out, 0, size);
    return;
  }
  memcpy(out, r->at, size);
  r->at += size;
  r->left -= size;
}

/* An integer from low to high. */
static int32_t take_integer(reader *r, int32_t low, int32_t high) {
  int32_t value;
  take(r, &value, sizeof value);
  r->bad |= value < low || value > high;
  return r->bad ? low : value;
}

/* Room for `count` elements, which are in the bytes; NULL with bad set if the bytes are too few. */
static void *take_array(orb_context *ctx, reader *r, size_t count, size_t size) {
  void *block = r->bad || count > r->left / size ? NULL : orb_alloc(ctx, count, size);
  if (!block) {
    r->bad = 1;
    return NULL;
  }
  take(r, block, count * size);
  return block;
}

/* Grows an array of the mesh, where there is one, to `count` elements. */
static int grow(orb_context *ctx, void *array, size_t count, size_t size) {
  void *block;
  memcpy(&block, array, sizeof block);
  return !block || orb_regrow(ctx, array, count, size);
}

static int grow_mesh(orb_context *ctx, orb_mesh *mesh, int32_t vertices, int32_t triangles) {
  const size_t v = (size_t)vertices, t = (size_t)triangles;
  const int grown =
      grow(ctx, &mesh->positions, 3 * v, sizeof(double)) && grow(ctx, &mesh->source, v, sizeof(int32_t)) &&
      grow(ctx, &mesh->triangles, 3 * t, sizeof(int32_t)) && grow(ctx, &mesh->source_triangle, t, sizeof(int32_t)) &&
      grow(ctx, &mesh->material, t, sizeof(int32_t)) && grow(ctx, &mesh->normals, 9 * t, sizeof(float)) &&
      grow(ctx, &mesh->texcoords, 6 * t, sizeof(float)) && grow(ctx, &mesh->colors, 12 * t, sizeof(float));
  mesh->vertex_count = vertices;
  mesh->triangle_count = triangles;
  return grown;
}

/* Triangles in rising order; those beyond the given mesh must all be there. */
static void take_triangles(reader *r, const orb_mesh *given, orb_aligned_shape *shape, int32_t changed) {
  orb_mesh *mesh = &shape->mesh;
  orb_kept_column columns[ORB_KEPT_COLUMNS];
  orb_kept_columns(mesh, columns);
  const int32_t materials = mesh->material_count > 0 ? mesh->material_count : 1;
  int32_t last = -1, added = 0;
  for (int32_t i = 0; i < changed && !r->bad; i++) {
    const int32_t t = take_integer(r, last + 1, mesh->triangle_count - 1);
    for (size_t k = 0; k < 3; k++) {
      mesh->triangles[3 * (size_t)t + k] = take_integer(r, 0, mesh->vertex_count - 1);
    }
    shape->parent[t] = take_integer(r, 0, given->triangle_count - 1);
    for (int c = 0; c < ORB_KEPT_COLUMNS; c++) {
      if (columns[c].data) {
        take(r, (char *)columns[c].data + (size_t)t * columns[c].size, columns[c].size);
      }
    }
    const int32_t material = mesh->material ? mesh->material[t] : 0;
    r->bad |= material < 0 || material >= materials;
    added += t >= given->triangle_count;
    last = t;
  }
  r->bad |= added != mesh->triangle_count - given->triangle_count;
}

/* Points are unit vectors. */
static int are_points(const double *points, int32_t count) {
  for (int32_t v = 0; v < count; v++) {
    const double *p = points + 3 * (size_t)v;
    if (!(fabs(p[0] * p[0] + p[1] * p[1] + p[2] * p[2] - 1) <= 1e-9)) { /* also NaN */
      return 0;
    }
  }
  return 1;
}

static orb_status take_shape(orb_context *ctx, reader *r, const orb_mesh *given, int32_t landmarks,
                             orb_aligned_shape *out) {
  enum { MOST = 400 * 1000 * 1000 };
  const int32_t vertices = take_integer(r, given->vertex_count, MOST);
  const int32_t triangles = take_integer(r, given->triangle_count, MOST);
  const int32_t changed = take_integer(r, 0, triangles);
  if (r->bad || (size_t)vertices > r->left / (3 * sizeof(double)) || triangles - given->triangle_count > changed ||
      (size_t)changed > r->left / (5 * sizeof(int32_t))) {
    r->bad = 1;
    return ORB_OK;
  }
  ORB_TRY(orb_mesh_copy(ctx, given, &out->mesh));
  out->points = take_array(ctx, r, 3 * (size_t)vertices, sizeof(double));
  out->parent = ORB_NEW(ctx, int32_t, triangles);
  if (!grow_mesh(ctx, &out->mesh, vertices, triangles) || !out->points || !out->parent) {
    return r->bad && out->parent ? ORB_OK : ORB_E_NO_MEMORY;
  }
  const size_t first = (size_t)given->vertex_count, added = (size_t)vertices - first;
  take(r, out->mesh.positions + 3 * first, 3 * added * sizeof(double));
  if (out->mesh.source) {
    take(r, out->mesh.source + first, added * sizeof(int32_t));
  }
  for (int32_t t = 0; t < triangles; t++) {
    out->parent[t] = t;
  }
  take_triangles(r, given, out, changed);
  if (take_integer(r, 0, 1)) {
    out->landmark_vertices = take_array(ctx, r, (size_t)landmarks, sizeof(int32_t));
  }
  for (int32_t l = 0; out->landmark_vertices && l < landmarks; l++) {
    r->bad |= out->landmark_vertices[l] < -1 || out->landmark_vertices[l] >= vertices;
  }
  for (size_t v = first; out->mesh.source && v < (size_t)vertices && !r->bad; v++) {
    r->bad |= out->mesh.source[v] < -1 || out->mesh.source[v] >= given->file_vertex_count;
  }
  if (r->bad || !are_points(out->points, vertices)) {
    r->bad = 1;
    return ORB_OK;
  }
  ORB_TRY(orb_certify(ctx, out->points, vertices, out->mesh.triangles, triangles, &out->certificate));
  r->bad |= !out->certificate.valid;
  return ORB_OK;
}

/* Places on the shapes, one shape after the other. */
static void take_places(reader *r, const orb_align_shape *shapes, size_t shape_count, orb_place *out, size_t count) {
  for (size_t i = 0; i < count; i++) {
    out[i].triangle = take_integer(r, 0, shapes[i % shape_count].mesh->triangle_count - 1);
    take(r, out[i].at, sizeof out[i].at);
  }
}

static orb_status take_match(orb_context *ctx, reader *r, const orb_align_shape *shapes, orb_alignment *out) {
  out->match.is_measured = take_integer(r, 0, 1);
  if (out->match.is_measured) {
    out->match.is_part = take_integer(r, 0, 1);
    take(r, &out->match.bend, sizeof out->match.bend);
    take(r, &out->match.clear, sizeof out->match.clear);
    take(r, &out->match.lead, sizeof out->match.lead);
    take(r, &out->match.confidence, sizeof out->match.confidence);
  }
  const int32_t count = take_integer(r, 0, out->shape_count > 1 ? ORB_ALTERNATIVES_MAX : 0);
  if (count == 0) {
    return ORB_OK;
  }
  out->alternatives = ORB_NEW0(ctx, orb_alternative, ORB_ALTERNATIVES_MAX);
  if (!out->alternatives) {
    return ORB_E_NO_MEMORY;
  }
  out->alternative_count = count;
  for (int32_t i = 0; i < count; i++) {
    orb_alternative *one = &out->alternatives[i];
    take(r, &one->cost, sizeof one->cost);
    one->shape = take_integer(r, 1, out->shape_count - 1);
    one->count = take_integer(r, 0, ORB_ALTERNATIVE_PAIRS);
    const size_t places = (size_t)one->count * (size_t)out->shape_count;
    one->at = ORB_NEW0(ctx, orb_place, places);
    if (!one->at) {
      return ORB_E_NO_MEMORY;
    }
    take_places(r, shapes, (size_t)out->shape_count, one->at, places);
  }
  return ORB_OK;
}

static orb_status take_suspects(orb_context *ctx, reader *r, const orb_align_shape *shapes, orb_alignment *out) {
  const int32_t count = take_integer(r, 0, out->shape_count > 1 && out->landmark_count > 0 ? ORB_SUSPECTS_MAX : 0);
  if (count == 0) {
    return ORB_OK;
  }
  out->suspects = ORB_NEW0(ctx, orb_suspect, ORB_SUSPECTS_MAX);
  if (!out->suspects) {
    return ORB_E_NO_MEMORY;
  }
  out->suspect_count = count;
  for (int32_t i = 0; i < count; i++) {
    orb_suspect *one = &out->suspects[i];
    one->landmark = take_integer(r, 0, out->landmark_count - 1);
    one->shape = take_integer(r, 1, out->shape_count - 1);
    take(r, &one->share, sizeof one->share);
    take(r, &one->distance, sizeof one->distance);
    take_places(r, shapes + one->shape, 1, &one->at, 1);
  }
  return ORB_OK;
}

static orb_status take_rims(orb_context *ctx, reader *r, const orb_align_shape *shapes, orb_alignment *out) {
  enum { BYTES = 5 * sizeof(int32_t) + 3 * sizeof(double) }; /* of an entry */
  const int32_t count = take_integer(r, 0, out->shape_count > 1 ? INT32_MAX : 0);
  if (count == 0 || (size_t)count > r->left / BYTES) {
    r->bad |= count > 0;
    return ORB_OK;
  }
  out->rims = ORB_NEW0(ctx, orb_rim_match, count);
  if (!out->rims) {
    return ORB_E_NO_MEMORY;
  }
  out->rim_count = count;
  for (int32_t i = 0; i < count; i++) {
    orb_rim_match *one = &out->rims[i];
    one->shape = take_integer(r, 1, out->shape_count - 1);
    for (int k = 0; k < 2; k++) {
      const int32_t most = shapes[k == 0 ? 0 : one->shape].mesh->triangle_count;
      one->hole[k] = take_integer(r, 0, most);
      one->edges[k] = take_integer(r, 0, most);
      take(r, &one->length_relative[k], sizeof one->length_relative[k]);
    }
    take(r, &one->off_relative, sizeof one->off_relative);
  }
  return ORB_OK;
}

static orb_status take_found(orb_context *ctx, reader *r, const orb_align_shape *shapes, orb_alignment *out) {
  const size_t found = (size_t)out->found_count, places = found * (size_t)out->shape_count;
  out->found = ORB_NEW0(ctx, orb_place, places);
  if (!out->found) {
    return ORB_E_NO_MEMORY;
  }
  take_places(r, shapes, (size_t)out->shape_count, out->found, places);
  out->found_points = take_array(ctx, r, 3 * found, sizeof(double));
  out->confidence = take_array(ctx, r, found, sizeof(double));
  return ORB_OK;
}

static orb_status take_all(orb_context *ctx, reader *r, const orb_align_shape *shapes, int32_t shape_count,
                           orb_alignment *out) {
  char head[sizeof orb_kept_magic];
  take(r, head, sizeof head);
  r->bad |= memcmp(head, orb_kept_magic, sizeof orb_kept_magic) != 0;
  (void)take_integer(r, ORB_KEPT_VERSION, ORB_KEPT_VERSION);
  (void)take_integer(r, ORB_KEPT_BYTE_ORDER, ORB_KEPT_BYTE_ORDER);
  (void)take_integer(r, shape_count, shape_count);
  const int32_t landmarks = take_integer(r, 0, 1 << 20), found = take_integer(r, 0, ORB_FOUND_MAX);
  out->has_followed = take_integer(r, 0, 1);
  take(r, &out->energy, sizeof out->energy);
  if (r->bad) {
    return ORB_OK;
  }
  out->shapes = ORB_NEW0(ctx, orb_aligned_shape, shape_count);
  if (!out->shapes) {
    return ORB_E_NO_MEMORY;
  }
  out->shape_count = shape_count;
  for (int32_t s = 0; s < shape_count; s++) {
    uint64_t digest[2], kept[2];
    orb_kept_digest(shapes[s].mesh, digest);
    take(r, kept, sizeof kept);
    r->bad |= memcmp(digest, kept, sizeof kept) != 0;
  }
  out->landmark_count = landmarks;
  out->found_count = found;
  ORB_TRY(take_match(ctx, r, shapes, out));
  ORB_TRY(take_suspects(ctx, r, shapes, out));
  if (take_integer(r, 0, landmarks > 0)) {
    out->landmark_shares = take_array(ctx, r, (size_t)landmarks, sizeof *out->landmark_shares);
  }
  ORB_TRY(take_rims(ctx, r, shapes, out));
  if (found > 0) {
    ORB_TRY(take_found(ctx, r, shapes, out));
  }
  for (int32_t s = 0; s < shape_count && !r->bad; s++) {
    ORB_TRY(take_shape(ctx, r, shapes[s].mesh, landmarks, &out->shapes[s]));
  }
  r->bad |= r->left != 0;
  return ORB_OK;
}

orb_status orb_alignment_read(orb_context *ctx, const void *bytes, size_t size, const orb_align_shape *shapes,
                              int32_t shape_count, orb_alignment *out) {
  reader r = {bytes, size, 0};
  memset(out, 0, sizeof *out);
  orb_status status = take_all(ctx, &r, shapes, shape_count, out);
  if (status == ORB_OK && r.bad) {
    status = orb_fail(ctx, ORB_E_BAD_OPTION, "The bytes are not an alignment of these shapes.");
  }
  if (status != ORB_OK) {
    orb_alignment_free(ctx, out);
  }
  return status;
}
