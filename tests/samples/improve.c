/* Better triangles: smoothing along the surface, and decimation that keeps curved parts. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sample.h"

void sample_incidence(const orb_sample *mesh, int **first, int **list) {
  int *start = sample_alloc((size_t)mesh->vertex_count + 2, sizeof(int));
  for (int h = 0; h < 3 * mesh->triangle_count; h++)
    start[mesh->triangles[h] + 2]++;
  for (int v = 0; v < mesh->vertex_count; v++)
    start[v + 2] += start[v + 1];
  int *of = sample_alloc((size_t)mesh->triangle_count * 3, sizeof(int));
  for (int h = 0; h < 3 * mesh->triangle_count; h++)
    of[start[mesh->triangles[h] + 1]++] = h / 3;
  *first = start;
  *list = of;
}

void sample_smooth(const orb_animal *animal, orb_sample *mesh, int rounds) {
  int *first, *list;
  sample_incidence(mesh, &first, &list);
  double *next = sample_alloc((size_t)mesh->vertex_count * 3, sizeof(double));
  for (int round = 0; round < rounds; round++) {
    for (int v = 0; v < mesh->vertex_count; v++) {
      double sum[3] = {0, 0, 0}, p[3];
      int count = 0;
      for (int i = first[v]; i < first[v + 1]; i++)
        for (int c = 0; c < 3; c++) {
          int w = mesh->triangles[3 * list[i] + c];
          for (int k = 0; k < 3 && w != v; k++)
            sum[k] += mesh->positions[3 * w + k];
          count += w != v;
        }
      for (int k = 0; k < 3; k++)
        p[k] = 0.5 * mesh->positions[3 * v + k] + 0.5 * sum[k] / count;
      sample_project(animal, p);
      memcpy(&next[3 * v], p, sizeof p);
    }
    memcpy(mesh->positions, next, (size_t)mesh->vertex_count * 3 * sizeof(double));
  }
  free(next);
  free(first);
  free(list);
}

typedef struct edge {
  int a, b;
  double cost;
} edge;

static int edge_order(const void *x, const void *y) {
  const edge *a = x, *b = y;
  if (a->cost < b->cost || a->cost > b->cost)
    return a->cost < b->cost ? -1 : 1;
  return a->a != b->a ? a->a - b->a : a->b - b->b;
}

static void triangle_normal(const double *p, const double *q, const double *r, double out[3]) {
  double u[3], w[3];
  for (int k = 0; k < 3; k++) {
    u[k] = q[k] - p[k];
    w[k] = r[k] - p[k];
  }
  for (int k = 0; k < 3; k++)
    out[k] = u[(k + 1) % 3] * w[(k + 2) % 3] - u[(k + 2) % 3] * w[(k + 1) % 3];
}

static double dot(const double *a, const double *b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Long edges and edges over bends cost more. */
static double edge_cost(const orb_sample *mesh, const double *normals, double detail, int a, int b) {
  double length2 = 0;
  for (int k = 0; k < 3; k++) {
    double d = mesh->positions[3 * a + k] - mesh->positions[3 * b + k];
    length2 += d * d;
  }
  double bend = 1 - dot(&normals[3 * a], &normals[3 * b]);
  return length2 * (1 + detail * bend);
}

static edge *list_edges(const orb_animal *animal, const orb_sample *mesh, double detail, int *count) {
  double *normals = sample_alloc((size_t)mesh->vertex_count * 3, sizeof(double));
  for (int v = 0; v < mesh->vertex_count; v++) {
    double *n = &normals[3 * v];
    sample_gradient(animal, &mesh->positions[3 * v], n);
    double length = sqrt(dot(n, n));
    for (int k = 0; k < 3; k++)
      n[k] /= length;
  }
  edge *edges = sample_alloc((size_t)mesh->triangle_count * 3, sizeof(edge));
  *count = 0;
  for (int h = 0; h < 3 * mesh->triangle_count; h++) {
    int a = mesh->triangles[h], b = mesh->triangles[h % 3 == 2 ? h - 2 : h + 1];
    if (a < b)
      edges[(*count)++] = (edge){a, b, edge_cost(mesh, normals, detail, a, b)};
  }
  free(normals);
  qsort(edges, (size_t)*count, sizeof(edge), edge_order);
  return edges;
}

/* May a and b become one vertex at p? Exactly two common neighbours, and no triangle turns over. */
static int may_collapse(const orb_sample *mesh, const int *first, const int *list, int a, int b, const double p[3]) {
  int common = 0;
  for (int i = first[a]; i < first[a + 1]; i++) {
    const int *t = &mesh->triangles[3 * list[i]];
    int next = t[0] == a ? t[1] : t[1] == a ? t[2] : t[0]; /* each neighbour of a once */
    for (int j = first[b]; j < first[b + 1]; j++) {
      const int *s = &mesh->triangles[3 * list[j]];
      common += next == (s[0] == b ? s[1] : s[1] == b ? s[2] : s[0]);
    }
  }
  if (common != 2 || first[a + 1] - first[a] + first[b + 1] - first[b] - 4 > 9)
    return 0;
  for (int side = 0; side < 2; side++)
    for (int v = side ? b : a, i = first[v]; i < first[v + 1]; i++) {
      const int *t = &mesh->triangles[3 * list[i]];
      const double *old[3], *new[3];
      int held = 0;
      for (int c = 0; c < 3; c++) {
        int moves = t[c] == a || t[c] == b;
        held += moves;
        old[c] = &mesh->positions[3 * t[c]];
        new[c] = moves ? p : old[c];
      }
      if (held == 2)
        continue;
      double before[3], after[3];
      triangle_normal(old[0], old[1], old[2], before);
      triangle_normal(new[0], new[1], new[2], after);
      if (dot(before, after) < 0.6 * sqrt(dot(before, before) * dot(after, after)))
        return 0;
    }
  return 1;
}

/* Removes triangles that lost a corner and unused vertices. */
static void compact(orb_sample *mesh, const int *moved_to) {
  int triangles = 0, vertices = 0, *number = sample_alloc((size_t)mesh->vertex_count, sizeof(int));
  for (int t = 0; t < mesh->triangle_count; t++) {
    int v[3];
    for (int c = 0; c < 3; c++)
      v[c] = moved_to[mesh->triangles[3 * t + c]];
    if (v[0] != v[1] && v[1] != v[2] && v[2] != v[0])
      memcpy(&mesh->triangles[3 * triangles++], v, sizeof v);
  }
  for (int v = 0; v < mesh->vertex_count; v++)
    if (moved_to[v] == v) {
      memmove(&mesh->positions[3 * vertices], &mesh->positions[3 * v], 3 * sizeof(double));
      number[v] = vertices++;
    }
  mesh->triangle_count = triangles;
  mesh->vertex_count = vertices;
  for (int h = 0; h < 3 * triangles; h++)
    mesh->triangles[h] = number[mesh->triangles[h]];
  free(number);
}

static void lock_ring(const orb_sample *mesh, const int *first, const int *list, int v, char *locked) {
  for (int i = first[v]; i < first[v + 1]; i++)
    for (int c = 0; c < 3; c++)
      locked[mesh->triangles[3 * list[i] + c]] = 1;
}

void sample_decimate(const orb_animal *animal, orb_sample *mesh, double detail, int triangles) {
  for (int collapsed = 1; collapsed && mesh->triangle_count > triangles;) {
    int count, *first, *list, left = (mesh->triangle_count - triangles + 1) / 2;
    collapsed = 0;
    edge *edges = list_edges(animal, mesh, detail, &count);
    sample_incidence(mesh, &first, &list);
    char *locked = sample_alloc((size_t)mesh->vertex_count, 1);
    int *moved_to = sample_alloc((size_t)mesh->vertex_count, sizeof(int));
    for (int v = 0; v < mesh->vertex_count; v++)
      moved_to[v] = v;
    for (int i = 0; i < count / 5 && collapsed < left; i++) { /* the cheapest fifth, no two near one another */
      int a = edges[i].a, b = edges[i].b;
      double p[3];
      if (locked[a] || locked[b])
        continue;
      for (int k = 0; k < 3; k++)
        p[k] = 0.5 * (mesh->positions[3 * a + k] + mesh->positions[3 * b + k]);
      sample_project(animal, p);
      if (!may_collapse(mesh, first, list, a, b, p))
        continue;
      lock_ring(mesh, first, list, a, locked);
      lock_ring(mesh, first, list, b, locked);
      memcpy(&mesh->positions[3 * a], p, sizeof p);
      moved_to[b] = a;
      collapsed++;
    }
    compact(mesh, moved_to);
    free(edges);
    free(first);
    free(list);
    free(locked);
    free(moved_to);
  }
}

/* Walks around v from triangle to triangle; returns the number of triangles in one fan. */
static int fan_size(const orb_sample *mesh, const int *first, const int *list, int v) {
  const int *t = &mesh->triangles[3 * list[first[v]]];
  int begin = t[0] == v ? t[1] : t[1] == v ? t[2] : t[0], at = begin, size = 0;
  do {
    int next = -1;
    for (int i = first[v]; i < first[v + 1]; i++) {
      const int *s = &mesh->triangles[3 * list[i]];
      int c = s[0] == v ? 0 : s[1] == v ? 1 : 2;
      if (s[(c + 1) % 3] == at)
        next = s[(c + 2) % 3];
    }
    if (next < 0)
      return 0;
    at = next;
    size++;
  } while (at != begin && size <= first[v + 1] - first[v]);
  return size;
}

static int count_directed(const orb_sample *mesh, const int *first, const int *list, int a, int b) {
  int count = 0;
  for (int i = first[a]; i < first[a + 1]; i++) {
    const int *t = &mesh->triangles[3 * list[i]];
    for (int c = 0; c < 3; c++)
      count += t[c] == a && t[(c + 1) % 3] == b;
  }
  return count;
}

static int reachable(const orb_sample *mesh, const int *first, const int *list) {
  int *stack = sample_alloc((size_t)mesh->vertex_count, sizeof(int)), depth = 1, seen = 1;
  char *mark = sample_alloc((size_t)mesh->vertex_count, 1);
  mark[0] = 1;
  while (depth) {
    int v = stack[--depth];
    for (int i = first[v]; i < first[v + 1]; i++)
      for (int c = 0; c < 3; c++) {
        int w = mesh->triangles[3 * list[i] + c];
        if (!mark[w]) {
          mark[w] = 1;
          stack[depth++] = w;
          seen++;
        }
      }
  }
  free(stack);
  free(mark);
  return seen;
}

const char *sample_fault(const orb_sample *mesh) {
  int *first, *list;
  const char *fault = NULL;
  sample_incidence(mesh, &first, &list);
  for (int v = 0; v < mesh->vertex_count && !fault; v++)
    if (first[v] == first[v + 1])
      fault = "a vertex that no triangle uses";
    else if (fan_size(mesh, first, list, v) != first[v + 1] - first[v])
      fault = "a vertex that is not the centre of one fan";
  for (int h = 0; h < 3 * mesh->triangle_count && !fault; h++) {
    int a = mesh->triangles[h], b = mesh->triangles[h % 3 == 2 ? h - 2 : h + 1];
    if (count_directed(mesh, first, list, a, b) != 1 || count_directed(mesh, first, list, b, a) != 1)
      fault = "an edge without exactly two triangles that face the same way";
  }
  if (!fault && mesh->triangle_count != 2 * mesh->vertex_count - 4)
    fault = "not of genus zero";
  if (!fault && reachable(mesh, first, list) != mesh->vertex_count)
    fault = "more than one piece";
  free(first);
  free(list);
  return fault;
}
