/* Writes alignments as bytes. kept.h has the format. */
#include "merge/kept.h"

#include <string.h>

#include "base/check.h"
#include "base/error.h"
#include "base/memory.h"

/* Whether triangle t of the aligned shape is that of the given mesh. */
static int is_same(const orb_mesh *given, const orb_aligned_shape *shape, int32_t t) {
  const orb_mesh *mesh = &shape->mesh;
  orb_kept_column before[ORB_KEPT_COLUMNS], now[ORB_KEPT_COLUMNS];
  const size_t at = (size_t)t;
  if (t >= given->triangle_count || shape->parent[t] != t ||
      memcmp(given->triangles + 3 * at, mesh->triangles + 3 * at, 3 * sizeof(int32_t)) != 0) {
    return 0;
  }
  orb_kept_columns(given, before);
  orb_kept_columns(mesh, now);
  for (int c = 0; c < ORB_KEPT_COLUMNS; c++) {
    if (now[c].data && memcmp((char *)before[c].data + at * before[c].size, (char *)now[c].data + at * now[c].size,
                              now[c].size) != 0) {
      return 0;
    }
  }
  return 1;
}

/* Whether the aligned shape keeps the vertices of the given mesh, and has the same arrays. */
static int keeps(const orb_mesh *given, const orb_mesh *mesh) {
  const size_t n = (size_t)given->vertex_count;
  orb_kept_column before[ORB_KEPT_COLUMNS], now[ORB_KEPT_COLUMNS];
  orb_kept_columns(given, before);
  orb_kept_columns(mesh, now);
  int same = mesh->vertex_count >= given->vertex_count && mesh->triangle_count >= given->triangle_count &&
             !mesh->source == !given->source &&
             memcmp(mesh->positions, given->positions, 3 * n * sizeof(double)) == 0 &&
             (!mesh->source || memcmp(mesh->source, given->source, n * sizeof(int32_t)) == 0);
  for (int c = 0; c < ORB_KEPT_COLUMNS; c++) {
    same = same && !now[c].data == !before[c].data;
  }
  return same;
}

/* Appends to a buffer until the first failure. */
typedef struct writer {
  orb_context *ctx;
  orb_buffer *out;
  orb_status status;
} writer;

static void put(writer *w, const void *bytes, size_t size) {
  if (w->status == ORB_OK && size > 0) {
    w->status = orb_buffer_append(w->ctx, w->out, bytes, size);
  }
}

static void put_integer(writer *w, int32_t value) {
  put(w, &value, sizeof value);
}

static void put_triangle(writer *w, const orb_aligned_shape *shape, int32_t t) {
  orb_kept_column columns[ORB_KEPT_COLUMNS];
  orb_kept_columns(&shape->mesh, columns);
  put_integer(w, t);
  put(w, shape->mesh.triangles + 3 * (size_t)t, 3 * sizeof(int32_t));
  put_integer(w, shape->parent[t]);
  for (int c = 0; c < ORB_KEPT_COLUMNS; c++) {
    if (columns[c].data) {
      put(w, (char *)columns[c].data + (size_t)t * columns[c].size, columns[c].size);
    }
  }
}

static void put_shape(writer *w, const orb_mesh *given, const orb_aligned_shape *shape, int32_t landmarks) {
  const orb_mesh *mesh = &shape->mesh;
  const size_t vertices = (size_t)mesh->vertex_count, first = (size_t)given->vertex_count;
  int32_t changed = 0;
  for (int32_t t = 0; t < mesh->triangle_count; t++) {
    changed += !is_same(given, shape, t);
  }
  put_integer(w, mesh->vertex_count);
  put_integer(w, mesh->triangle_count);
  put_integer(w, changed);
  put(w, shape->points, 3 * vertices * sizeof(double));
  put(w, mesh->positions + 3 * first, 3 * (vertices - first) * sizeof(double));
  if (mesh->source) {
    put(w, mesh->source + first, (vertices - first) * sizeof(int32_t));
  }
  for (int32_t t = 0; t < mesh->triangle_count; t++) {
    if (!is_same(given, shape, t)) {
      put_triangle(w, shape, t);
    }
  }
  put_integer(w, shape->landmark_vertices != NULL);
  put(w, shape->landmark_vertices, shape->landmark_vertices ? (size_t)landmarks * sizeof(int32_t) : 0);
}

static void put_places(writer *w, const orb_place *places, size_t count) {
  for (size_t i = 0; i < count; i++) {
    put_integer(w, places[i].triangle);
    put(w, places[i].at, sizeof places[i].at);
  }
}

static void put_match(writer *w, const orb_alignment *a) {
  put_integer(w, a->match.is_measured);
  if (a->match.is_measured) {
    put_integer(w, a->match.is_part);
    put(w, &a->match.bend, sizeof a->match.bend);
    put(w, &a->match.clear, sizeof a->match.clear);
    put(w, &a->match.lead, sizeof a->match.lead);
    put(w, &a->match.confidence, sizeof a->match.confidence);
  }
  put_integer(w, a->alternative_count);
  for (int32_t i = 0; i < a->alternative_count; i++) {
    const orb_alternative *one = &a->alternatives[i];
    put(w, &one->cost, sizeof one->cost);
    put_integer(w, one->shape);
    put_integer(w, one->count);
    put_places(w, one->at, (size_t)one->count * (size_t)a->shape_count);
  }
}

static void put_suspects(writer *w, const orb_alignment *a) {
  put_integer(w, a->suspect_count);
  for (int32_t i = 0; i < a->suspect_count; i++) {
    const orb_suspect *one = &a->suspects[i];
    put_integer(w, one->landmark);
    put_integer(w, one->shape);
    put(w, &one->share, sizeof one->share);
    put(w, &one->distance, sizeof one->distance);
    put_places(w, &one->at, 1);
  }
}

static void put_shares(writer *w, const orb_alignment *a) {
  put_integer(w, a->landmark_shares != NULL);
  if (a->landmark_shares) {
    put(w, a->landmark_shares, (size_t)a->landmark_count * sizeof *a->landmark_shares);
  }
}

static void put_rims(writer *w, const orb_alignment *a) {
  put_integer(w, a->rim_count);
  for (int32_t i = 0; i < a->rim_count; i++) {
    const orb_rim_match *one = &a->rims[i];
    put_integer(w, one->shape);
    for (int k = 0; k < 2; k++) {
      put_integer(w, one->hole[k]);
      put_integer(w, one->edges[k]);
      put(w, &one->length_relative[k], sizeof one->length_relative[k]);
    }
    put(w, &one->off_relative, sizeof one->off_relative);
  }
}

static void put_found(writer *w, const orb_alignment *a) {
  const size_t found = (size_t)a->found_count;
  put_places(w, a->found, found * (size_t)a->shape_count);
  put(w, a->found_points, 3 * found * sizeof(double));
  put(w, a->confidence, found * sizeof(double));
}

orb_status orb_alignment_write(orb_context *ctx, const orb_align_shape *shapes, const orb_alignment *alignment,
                               orb_buffer *out) {
  writer w = {ctx, out, ORB_OK};
  memset(out, 0, sizeof *out);
  for (int32_t s = 0; s < alignment->shape_count; s++) {
    if (!keeps(shapes[s].mesh, &alignment->shapes[s].mesh)) {
      return orb_fail(ctx, ORB_E_BAD_OPTION, "Shape %d of the alignment does not extend the given mesh.", s);
    }
  }
  put(&w, orb_kept_magic, sizeof orb_kept_magic);
  put_integer(&w, ORB_KEPT_VERSION);
  put_integer(&w, ORB_KEPT_BYTE_ORDER);
  put_integer(&w, alignment->shape_count);
  put_integer(&w, alignment->landmark_count);
  put_integer(&w, alignment->found_count);
  put_integer(&w, alignment->has_followed);
  put(&w, &alignment->energy, sizeof alignment->energy);
  for (int32_t s = 0; s < alignment->shape_count; s++) {
    uint64_t digest[2];
    orb_kept_digest(shapes[s].mesh, digest);
    put(&w, digest, sizeof digest);
  }
  put_match(&w, alignment);
  put_suspects(&w, alignment);
  put_shares(&w, alignment);
  put_rims(&w, alignment);
  put_found(&w, alignment);
  for (int32_t s = 0; s < alignment->shape_count; s++) {
    put_shape(&w, shapes[s].mesh, &alignment->shapes[s], alignment->landmark_count);
  }
  if (w.status != ORB_OK) {
    orb_buffer_free(ctx, out);
  }
  return w.status;
}
