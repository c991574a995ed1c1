/* From a field to triangles: surface nets and marching tetrahedra on a regular grid. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sample.h"

typedef struct grid {
  int n[3];
  double low[3], cell;
  double *value;
} grid;

void *sample_alloc(size_t count, size_t size) {
  void *block = calloc(count ? count : 1, size);
  if (!block) {
    fputs("no memory\n", stderr);
    exit(1);
  }
  return block;
}

static size_t grid_index(const grid *g, int x, int y, int z) {
  return ((size_t)z * (size_t)g->n[1] + (size_t)y) * (size_t)g->n[0] + (size_t)x;
}

static void grid_point(const grid *g, int x, int y, int z, double out[3]) {
  const int at[3] = {x, y, z};
  for (int k = 0; k < 3; k++)
    out[k] = g->low[k] + g->cell * at[k];
}

static void grid_fill(const orb_animal *animal, double cell, grid *g) {
  g->cell = cell;
  for (int k = 0; k < 3; k++) {
    g->low[k] = animal->low[k] - cell * 0.37; /* off the features' round numbers */
    g->n[k] = (int)((animal->high[k] - animal->low[k]) / cell) + 3;
  }
  g->value = sample_alloc((size_t)g->n[0] * (size_t)g->n[1] * (size_t)g->n[2], sizeof(double));
  for (int z = 0; z < g->n[2]; z++)
    for (int y = 0; y < g->n[1]; y++)
      for (int x = 0; x < g->n[0]; x++) {
        double p[3];
        grid_point(g, x, y, z, p);
        g->value[grid_index(g, x, y, z)] = sample_field(animal, p);
      }
}

static void add_triangle(orb_sample *mesh, int *room, int a, int b, int c) {
  if (mesh->triangle_count == *room) {
    *room = *room ? 2 * *room : 4096;
    mesh->triangles = realloc(mesh->triangles, (size_t)*room * 3 * sizeof(int));
    if (!mesh->triangles)
      exit(1);
  }
  int *t = &mesh->triangles[3 * mesh->triangle_count++];
  t[0] = a;
  t[1] = b;
  t[2] = c;
}

static int add_vertex(orb_sample *mesh, int *room, const double p[3]) {
  if (mesh->vertex_count == *room) {
    *room = *room ? 2 * *room : 4096;
    mesh->positions = realloc(mesh->positions, (size_t)*room * 3 * sizeof(double));
    if (!mesh->positions)
      exit(1);
  }
  memcpy(&mesh->positions[3 * mesh->vertex_count], p, 3 * sizeof(double));
  return mesh->vertex_count++;
}

/* Where the surface crosses the straight line between two grid points. */
static void crossing(const grid *g, const int a[3], const int b[3], double out[3]) {
  double pa[3], pb[3], fa = g->value[grid_index(g, a[0], a[1], a[2])], fb = g->value[grid_index(g, b[0], b[1], b[2])];
  grid_point(g, a[0], a[1], a[2], pa);
  grid_point(g, b[0], b[1], b[2], pb);
  double t = fa / (fa - fb);
  for (int k = 0; k < 3; k++)
    out[k] = pa[k] + t * (pb[k] - pa[k]);
}

/* The mean of the crossings on the twelve edges of a cell; 0 if there are none. */
static int cell_point(const grid *g, const int at[3], double out[3]) {
  int count = 0;
  double sum[3] = {0, 0, 0};
  for (int axis = 0; axis < 3; axis++)
    for (int corner = 0; corner < 8; corner++) {
      if (corner >> axis & 1)
        continue;
      int a[3], b[3];
      for (int k = 0; k < 3; k++)
        a[k] = b[k] = at[k] + (corner >> k & 1);
      b[axis]++;
      if ((g->value[grid_index(g, a[0], a[1], a[2])] < 0) == (g->value[grid_index(g, b[0], b[1], b[2])] < 0))
        continue;
      double p[3];
      crossing(g, a, b, p);
      for (int k = 0; k < 3; k++)
        sum[k] += p[k];
      count++;
    }
  for (int k = 0; k < 3; k++)
    out[k] = count ? sum[k] / count : 0;
  return count > 0;
}

static double distance2(const orb_sample *mesh, int a, int b) {
  double sum = 0;
  for (int k = 0; k < 3; k++) {
    double d = mesh->positions[3 * a + k] - mesh->positions[3 * b + k];
    sum += d * d;
  }
  return sum;
}

void sample_surface_nets(const orb_animal *animal, double cell, orb_sample *out) {
  grid g;
  grid_fill(animal, cell, &g);
  memset(out, 0, sizeof *out);
  int vertex_room = 0, triangle_room = 0;
  size_t total = (size_t)g.n[0] * (size_t)g.n[1] * (size_t)g.n[2];
  int *vertex_of = sample_alloc(total, sizeof(int));
  for (int z = 0; z + 1 < g.n[2]; z++)
    for (int y = 0; y + 1 < g.n[1]; y++)
      for (int x = 0; x + 1 < g.n[0]; x++) {
        double p[3];
        if (cell_point(&g, (const int[3]){x, y, z}, p))
          vertex_of[grid_index(&g, x, y, z)] = add_vertex(out, &vertex_room, p);
      }
  for (int axis = 0; axis < 3; axis++)
    for (int z = 1; z + 1 < g.n[2]; z++)
      for (int y = 1; y + 1 < g.n[1]; y++)
        for (int x = 1; x + 1 < g.n[0]; x++) {
          const int a[3] = {x, y, z};
          int b[3] = {x, y, z}, quad[4];
          b[axis]++;
          int inside = g.value[grid_index(&g, x, y, z)] < 0;
          if (inside == (g.value[grid_index(&g, b[0], b[1], b[2])] < 0))
            continue;
          const int u = (axis + 1) % 3, w = (axis + 2) % 3;
          for (int i = 0; i < 4; i++) { /* the four cells about the edge, counter-clockwise along the axis */
            int c[3] = {a[0], a[1], a[2]};
            c[u] -= i == 0 || i == 3;
            c[w] -= i < 2;
            quad[inside ? i : 3 - i] = vertex_of[grid_index(&g, c[0], c[1], c[2])];
          }
          int turn = distance2(out, quad[0], quad[2]) > distance2(out, quad[1], quad[3]);
          add_triangle(out, &triangle_room, quad[turn], quad[turn + 1], quad[turn + 2]);
          add_triangle(out, &triangle_room, quad[turn], quad[turn + 2], quad[(turn + 3) % 4]);
        }
  free(vertex_of);
  free(g.value);
}

/* The vertex on the grid edge from `a` to a corner `b` that lies above it in every coordinate. */
typedef struct edge_map {
  int *vertex; /* seven edges per grid point, −1: none yet */
  int vertex_room;
} edge_map;

static int edge_vertex(const grid *g, edge_map *map, orb_sample *mesh, const int a[3], const int b[3]) {
  int direction = (b[0] - a[0]) + 2 * (b[1] - a[1]) + 4 * (b[2] - a[2]);
  const int *low = direction > 0 ? a : b;
  size_t slot = 7 * grid_index(g, low[0], low[1], low[2]) + (size_t)(abs(direction) - 1);
  if (map->vertex[slot] < 0) {
    double p[3];
    crossing(g, a, b, p);
    map->vertex[slot] = add_vertex(mesh, &map->vertex_room, p);
  }
  return map->vertex[slot];
}

static int odd_permutation(const int p[4]) {
  int odd = 0;
  for (int i = 0; i < 4; i++)
    for (int j = i + 1; j < 4; j++)
      odd ^= p[i] > p[j];
  return odd;
}

/* One tetrahedron of four grid points. odd: it is left-handed. */
static void tetrahedron(const grid *g, edge_map *map, orb_sample *mesh, int *room, int corner[4][3], int odd) {
  int order[4], inside_count = 0, fill = 0;
  for (int pass = 0; pass < 2; pass++) /* the corners inside first */
    for (int i = 0; i < 4; i++) {
      int inside = g->value[grid_index(g, corner[i][0], corner[i][1], corner[i][2])] < 0;
      if (inside == (pass == 0)) {
        order[fill++] = i;
        inside_count += inside;
      }
    }
  if (inside_count == 0 || inside_count == 4)
    return;
  int flip = odd ^ odd_permutation(order);
  int *i = corner[order[0]], *j = corner[order[1]], *k = corner[order[2]], *l = corner[order[3]];
  int v[4], count = 3;
  if (inside_count == 1) {
    v[0] = edge_vertex(g, map, mesh, i, j);
    v[1] = edge_vertex(g, map, mesh, i, k);
    v[2] = edge_vertex(g, map, mesh, i, l);
  } else if (inside_count == 3) { /* bringing l to the front is odd, and it lies outside: the two turns cancel */
    v[0] = edge_vertex(g, map, mesh, l, i);
    v[1] = edge_vertex(g, map, mesh, l, j);
    v[2] = edge_vertex(g, map, mesh, l, k);
  } else {
    v[0] = edge_vertex(g, map, mesh, i, k);
    v[1] = edge_vertex(g, map, mesh, i, l);
    v[2] = edge_vertex(g, map, mesh, j, l);
    v[3] = edge_vertex(g, map, mesh, j, k);
    count = 4;
  }
  for (int t = 2; t < count; t++)
    add_triangle(mesh, room, v[0], flip ? v[t] : v[t - 1], flip ? v[t - 1] : v[t]);
}

void sample_marching_tetrahedra(const orb_animal *animal, double cell, orb_sample *out) {
  static const int paths[6][3] = {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {2, 1, 0}, {1, 0, 2}};
  grid g;
  grid_fill(animal, cell, &g);
  memset(out, 0, sizeof *out);
  size_t total = (size_t)g.n[0] * (size_t)g.n[1] * (size_t)g.n[2];
  edge_map map = {sample_alloc(7 * total, sizeof(int)), 0};
  memset(map.vertex, 0xff, 7 * total * sizeof(int));
  int triangle_room = 0;
  for (int z = 0; z + 1 < g.n[2]; z++)
    for (int y = 0; y + 1 < g.n[1]; y++)
      for (int x = 0; x + 1 < g.n[0]; x++)
        for (int t = 0; t < 6; t++) {
          int corner[4][3] = {{x, y, z}};
          for (int i = 1; i < 4; i++) {
            memcpy(corner[i], corner[i - 1], sizeof corner[i]);
            corner[i][paths[t][i - 1]]++;
          }
          tetrahedron(&g, &map, out, &triangle_room, corner, t >= 3);
        }
  free(map.vertex);
  free(g.value);
}
