#include "support_shapes.h"
#include "base/memory.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double TURN = 6.283185307179586476925;

static orb_mesh make(orb_context *ctx, int vertices) {
  orb_mesh mesh;
  memset(&mesh, 0, sizeof mesh);
  mesh.vertex_count = vertices;
  mesh.triangle_count = 2 * vertices - 4;
  mesh.positions = ORB_NEW(ctx, double, 3 * vertices);
  mesh.triangles = ORB_NEW(ctx, int32_t, 3 * mesh.triangle_count);
  if (!mesh.positions || !mesh.triangles) {
    abort();
  }
  return mesh;
}

void shape_free(orb_context *ctx, orb_mesh *mesh) {
  orb_free(ctx, mesh->positions);
  orb_free(ctx, mesh->triangles);
  memset(mesh, 0, sizeof *mesh);
}

orb_mesh shape_tetrahedron(orb_context *ctx) {
  static const double x[4][3] = {{1, 1, 1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}};
  static const int32_t t[4][3] = {{0, 1, 2}, {0, 2, 3}, {0, 3, 1}, {1, 3, 2}};
  orb_mesh mesh = make(ctx, 4);
  memcpy(mesh.positions, x, sizeof x);
  memcpy(mesh.triangles, t, sizeof t);
  return mesh;
}

orb_mesh shape_octahedron(orb_context *ctx) {
  static const double x[6][3] = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
  static const int32_t t[8][3] = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4},
                                  {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
  orb_mesh mesh = make(ctx, 6);
  memcpy(mesh.positions, x, sizeof x);
  memcpy(mesh.triangles, t, sizeof t);
  return mesh;
}

/* Two poles and two rings of five. */
orb_mesh shape_icosahedron(orb_context *ctx) {
  orb_mesh mesh = shape_globe(ctx, 5, 3);
  double height = 1 / sqrt(5.0), radius = 2 / sqrt(5.0);
  for (int i = 0; i < 10; i++) {
    double angle = TURN * (i % 5 + (i < 5 ? 0 : 0.5)) / 5, *p = mesh.positions + 3 * (1 + i);
    p[0] = radius * cos(angle);
    p[1] = radius * sin(angle);
    p[2] = i < 5 ? height : -height;
  }
  return mesh;
}

orb_mesh shape_globe(orb_context *ctx, int around, int rows) {
  orb_mesh mesh = make(ctx, 2 + around * (rows - 1));
  double *x = mesh.positions;
  int32_t *t = mesh.triangles, last = mesh.vertex_count - 1;
  memcpy(x, (double[]){0, 0, 1}, 24);
  memcpy(x + 3 * last, (double[]){0, 0, -1}, 24);
  for (int i = 1; i < rows; i++) {
    for (int j = 0; j < around; j++) {
      double polar = TURN / 2 * i / rows, angle = TURN * (j + 0.5 * (i - 1)) / around;
      double *p = x + 3 * (1 + (i - 1) * around + j);
      p[0] = sin(polar) * cos(angle);
      p[1] = sin(polar) * sin(angle);
      p[2] = cos(polar);
    }
  }
  for (int j = 0; j < around; j++) {
    int next = (j + 1) % around, bottom = 1 + (rows - 2) * around;
    int32_t cap[6] = {0, 1 + j, 1 + next, last, bottom + next, bottom + j};
    memcpy(t, cap, sizeof cap);
    t += 6;
    for (int i = 1; i < rows - 1; i++) {
      int32_t a = 1 + (i - 1) * around + j, b = 1 + (i - 1) * around + next;
      int32_t c = 1 + i * around + j, d = 1 + i * around + next;
      int32_t pair[6] = {a, c, b, b, c, d};
      memcpy(t, pair, sizeof pair);
      t += 6;
    }
  }
  return mesh;
}

orb_mesh shape_cylinder(orb_context *ctx, int around, int rows, double length) {
  orb_mesh mesh = shape_globe(ctx, around, rows);
  for (int32_t v = 0; v < mesh.vertex_count; v++) {
    double *p = mesh.positions + 3 * v, radius = hypot(p[0], p[1]);
    int pole = v == 0 || v == mesh.vertex_count - 1, row = pole ? 0 : (v - 1) / around;
    p[2] = v == 0 ? 0 : pole ? length : length * row / (rows - 2);
    if (!pole) {
      p[0] /= radius;
      p[1] /= radius;
    }
    p[2] = -p[2];
  }
  return mesh;
}

static int32_t middle(orb_mesh *mesh, int32_t *table, int capacity, int32_t a, int32_t b) {
  int32_t low = a < b ? a : b, high = a < b ? b : a;
  unsigned at = ((unsigned)low * 2654435761U ^ (unsigned)high * 40503U) % (unsigned)capacity;
  while (table[3 * at] >= 0 && (table[3 * at] != low || table[3 * at + 1] != high)) {
    at = (at + 1) % (unsigned)capacity;
  }
  if (table[3 * at] < 0) {
    double *p = mesh->positions + 3 * mesh->vertex_count, length = 0;
    for (int k = 0; k < 3; k++) {
      p[k] = mesh->positions[3 * a + k] + mesh->positions[3 * b + k];
      length += p[k] * p[k];
    }
    for (int k = 0; k < 3; k++) {
      p[k] /= sqrt(length);
    }
    table[3 * at] = low;
    table[3 * at + 1] = high;
    table[3 * at + 2] = mesh->vertex_count++;
  }
  return table[3 * at + 2];
}

orb_mesh shape_ball(orb_context *ctx, int levels) {
  orb_mesh mesh = shape_octahedron(ctx);
  for (int level = 0; level < levels; level++) {
    orb_mesh fine = make(ctx, mesh.vertex_count + mesh.triangle_count * 3 / 2);
    int capacity = mesh.triangle_count * 4;
    int32_t *table = ORB_NEW(ctx, int32_t, 3 * capacity), *t = fine.triangles;
    memset(table, -1, 12 * (size_t)capacity);
    memcpy(fine.positions, mesh.positions, 24 * (size_t)mesh.vertex_count);
    fine.vertex_count = mesh.vertex_count;
    for (int i = 0; i < mesh.triangle_count; i++) {
      const int32_t *v = mesh.triangles + 3 * i;
      int32_t m[3];
      for (int k = 0; k < 3; k++) {
        m[k] = middle(&fine, table, capacity, v[k], v[(k + 1) % 3]);
      }
      int32_t four[12] = {v[0], m[0], m[2], m[0], v[1], m[1], m[2], m[1], v[2], m[0], m[1], m[2]};
      memcpy(t, four, sizeof four);
      t += 12;
    }
    orb_free(ctx, table);
    shape_free(ctx, &mesh);
    mesh = fine;
  }
  return mesh;
}

orb_mesh shape_creature(orb_context *ctx, int count, const double (*limb)[3], const double *reach, int levels) {
  orb_mesh mesh = shape_ball(ctx, levels);
  for (int32_t v = 0; v < mesh.vertex_count; v++) {
    double *p = mesh.positions + 3 * (size_t)v, r = 1;
    for (int i = 0; i < count; i++) {
      double c = p[0] * limb[i][0] + p[1] * limb[i][1] + p[2] * limb[i][2];
      r += (reach[i] - 1) * exp(-20 * (1 - c));
    }
    for (int k = 0; k < 3; k++) {
      p[k] *= r;
    }
  }
  return mesh;
}

int32_t shape_farthest(const orb_mesh *mesh, const double direction[3]) {
  int32_t best = 0;
  double most = -INFINITY;
  for (int32_t v = 0; v < mesh->vertex_count; v++) {
    double along = 0;
    for (int k = 0; k < 3; k++) {
      along += direction[k] * mesh->positions[3 * (size_t)v + (size_t)k];
    }
    best = along > most ? v : best;
    most = fmax(most, along);
  }
  return best;
}

int64_t shape_repaired(const orb_mesh *mesh, const char *kind) {
  for (int i = 0; i < mesh->repair_count; i++) {
    if (strcmp(mesh->repairs[i].kind, kind) == 0) {
      return mesh->repairs[i].count;
    }
  }
  return 0;
}
