/* Remeshing visits places of the sphere again and again, and at each one reads a few vertices and triangles of every
 * shape. Where these lie all over the memory, as in a file that was written in another order, most of its time is
 * waiting for them. So the vertices are numbered along a curve that fills the sphere: a Morton curve on each side of a
 * cube. Triangles follow their lowest vertex. */
#include "remesh/common/order.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/memory.h"

enum { LEVELS = 15 };                 /* of the curve: 2¹⁵ cells along an edge of the cube */
enum { DIGIT_BITS = 11, DIGITS = 3 }; /* 33 bits: the side of the cube, 2 · LEVELS for the cell */
enum { DIGIT_VALUES = 1 << DIGIT_BITS };

typedef struct curve_entry {
  uint64_t key;
  int32_t vertex;
} curve_entry;

/* Moves the bits of a cell number apart, so that those of another fit between them. */
static uint64_t spread(uint32_t cell) {
  uint64_t bits = 0;
  for (int level = 0; level < LEVELS; level++) {
    bits |= (uint64_t)(cell >> level & 1) << (2 * level);
  }
  return bits;
}

static uint32_t cell_of(double at) {
  double cell = 0.5 * (1 << LEVELS) * (1 + at);
  return cell >= (1 << LEVELS) ? (1 << LEVELS) - 1 : cell > 0 ? (uint32_t)cell : 0;
}

static uint64_t key_of(const double p[3]) {
  int axis = fabs(p[1]) > fabs(p[0]) ? 1 : 0;
  axis = fabs(p[2]) > fabs(p[axis]) ? 2 : axis;
  double major = fabs(p[axis]);
  uint64_t side = 2 * (uint64_t)axis + (p[axis] < 0);
  return side << (2 * LEVELS) | spread(cell_of(p[(axis + 1) % 3] / major)) << 1 |
         spread(cell_of(p[(axis + 2) % 3] / major));
}

/* Sorts by key, entries with equal keys in their order: a pass of counting for each digit, the lowest first. */
static void sort_entries(curve_entry *entry, curve_entry *other, int32_t count) {
  for (int digit = 0; digit < DIGITS; digit++) {
    int32_t begin[DIGIT_VALUES + 1] = {0};
    int shift = digit * DIGIT_BITS;
    for (int32_t i = 0; i < count; i++) {
      begin[(entry[i].key >> shift & (DIGIT_VALUES - 1)) + 1]++;
    }
    for (int value = 0; value < DIGIT_VALUES; value++) {
      begin[value + 1] += begin[value];
    }
    for (int32_t i = 0; i < count; i++) {
      other[begin[entry[i].key >> shift & (DIGIT_VALUES - 1)]++] = entry[i];
    }
    curve_entry *swap = entry;
    entry = other;
    other = swap;
  }
}

/* number: per vertex, its new one. */
static orb_status number_vertices(orb_context *ctx, const orb_aligned_shape *shape, int32_t *number) {
  int32_t count = shape->mesh.vertex_count;
  curve_entry *entry = ORB_NEW(ctx, curve_entry, count), *other = ORB_NEW(ctx, curve_entry, count);
  orb_status status = entry && other ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    for (int32_t v = 0; v < count; v++) {
      entry[v] = (curve_entry){key_of(shape->points + 3 * (int64_t)v), v};
    }
    sort_entries(entry, other, count);
    for (int32_t i = 0; i < count; i++) {
      number[other[i].vertex] = i; /* after an odd number of passes */
    }
  }
  orb_free(ctx, entry);
  orb_free(ctx, other);
  return status;
}

static int32_t lowest_corner(const int32_t *number, const int32_t *corner) {
  int32_t lowest = number[corner[0]];
  for (int k = 1; k < 3; k++) {
    lowest = number[corner[k]] < lowest ? number[corner[k]] : lowest;
  }
  return lowest;
}

/* triangle: the old number of each triangle; begin: room for a number per vertex and one more. */
static void order_triangles(const orb_mesh *mesh, const int32_t *number, int32_t *begin, int32_t *triangle) {
  memset(begin, 0, ((size_t)mesh->vertex_count + 1) * sizeof *begin);
  for (int64_t t = 0; t < mesh->triangle_count; t++) {
    begin[lowest_corner(number, mesh->triangles + 3 * t) + 1]++;
  }
  for (int32_t v = 0; v < mesh->vertex_count; v++) {
    begin[v + 1] += begin[v];
  }
  for (int32_t t = 0; t < mesh->triangle_count; t++) {
    triangle[begin[lowest_corner(number, mesh->triangles + 3 * (int64_t)t)]++] = t;
  }
}

static orb_status order_shape(orb_context *ctx, const orb_aligned_shape *given, int32_t landmark_count,
                              orb_aligned_shape *out, int32_t **triangle) {
  int64_t vertices = given->mesh.vertex_count, triangles = given->mesh.triangle_count;
  int32_t *number = ORB_NEW(ctx, int32_t, vertices), *begin = ORB_NEW(ctx, int32_t, vertices + 1);
  *triangle = ORB_NEW(ctx, int32_t, triangles);
  out->mesh.vertex_count = given->mesh.vertex_count;
  out->mesh.triangle_count = given->mesh.triangle_count;
  out->points = ORB_NEW(ctx, double, 3 * vertices);
  out->mesh.positions = ORB_NEW(ctx, double, 3 * vertices);
  out->mesh.triangles = ORB_NEW(ctx, int32_t, 3 * triangles);
  out->landmark_vertices = given->landmark_vertices ? ORB_NEW(ctx, int32_t, landmark_count) : NULL;
  int fine = number && begin && *triangle && out->points && out->mesh.positions && out->mesh.triangles &&
             (out->landmark_vertices || !given->landmark_vertices);
  orb_status status = fine ? number_vertices(ctx, given, number) : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    order_triangles(&given->mesh, number, begin, *triangle);
    for (int64_t v = 0; v < vertices; v++) {
      memcpy(out->points + 3 * (int64_t)number[v], given->points + 3 * v, 3 * sizeof(double));
      memcpy(out->mesh.positions + 3 * (int64_t)number[v], given->mesh.positions + 3 * v, 3 * sizeof(double));
    }
    for (int64_t h = 0; h < 3 * triangles; h++) {
      out->mesh.triangles[h] = number[given->mesh.triangles[3 * (int64_t)(*triangle)[h / 3] + h % 3]];
    }
    for (int32_t l = 0; out->landmark_vertices && l < landmark_count; l++) {
      int32_t v = given->landmark_vertices[l];
      out->landmark_vertices[l] = v >= 0 ? number[v] : -1;
    }
  }
  orb_free(ctx, number);
  orb_free(ctx, begin);
  return status;
}

orb_status orb_shape_order_make(orb_context *ctx, const orb_aligned_shape *shapes, int32_t shape_count,
                                int32_t landmark_count, orb_shape_order *out) {
  *out = (orb_shape_order){ORB_NEW0(ctx, orb_aligned_shape, shape_count), ORB_NEW0(ctx, int32_t *, shape_count),
                           shape_count};
  orb_status status = out->shapes && out->triangle ? ORB_OK : ORB_E_NO_MEMORY;
  for (int32_t s = 0; s < shape_count && status == ORB_OK; s++) {
    status = order_shape(ctx, &shapes[s], landmark_count, &out->shapes[s], &out->triangle[s]);
  }
  return status;
}

void orb_shape_order_free(orb_context *ctx, orb_shape_order *order) {
  for (int32_t s = 0; s < order->count && order->shapes; s++) {
    orb_free(ctx, order->shapes[s].points);
    orb_free(ctx, order->shapes[s].mesh.positions);
    orb_free(ctx, order->shapes[s].mesh.triangles);
    orb_free(ctx, order->shapes[s].landmark_vertices);
  }
  for (int32_t s = 0; s < order->count && order->triangle; s++) {
    orb_free(ctx, order->triangle[s]);
  }
  orb_free(ctx, order->shapes);
  orb_free(ctx, order->triangle);
  memset(order, 0, sizeof *order);
}

void orb_shape_order_restore(const orb_shape_order *order, orb_supermesh *mesh) {
  for (int32_t s = 0; s < order->count; s++) {
    orb_place *places = mesh->places + (int64_t)s * mesh->vertex_count;
    for (int32_t v = 0; v < mesh->vertex_count; v++) {
      places[v].triangle = order->triangle[s][places[v].triangle];
    }
  }
}
