/* bench-subdivide FILE TRIANGLES OUT.ply: splits every triangle into four at the midpoints of its edges until the mesh
 * has at least TRIANGLES triangles. The shape changes only by a ripple of 1/1000 of an edge. Writes binary PLY. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench.h"

/* One split. Positions and triangles are allocated with malloc(). */
static void split(orb_context *ctx, int32_t *vertices, int32_t *triangles, double **positions, int32_t **corners) {
  int32_t count = *triangles, next = *vertices, *twin = malloc(3 * (size_t)count * sizeof *twin);
  int32_t *middle = malloc(3 * (size_t)count * sizeof *middle), *made = malloc(12 * (size_t)count * sizeof *made);
  double *p = realloc(*positions, 3 * ((size_t)next + 3 * (size_t)count / 2) * sizeof *p);
  if (!twin || !middle || !made || !p || orb_mesh_twins(ctx, *corners, count, next, twin) != ORB_OK) {
    fprintf(stderr, "bench-subdivide: out of memory, or not a closed mesh\n");
    exit(1);
  }
  for (int32_t h = 0; h < 3 * count; h++) {
    if (h < twin[h]) {
      const double *a = p + 3 * (size_t)(*corners)[h], *b = p + 3 * (size_t)(*corners)[orb_next(h)];
      double ripple = 1e-3 * sin(12.9898 * next);
      for (int k = 0; k < 3; k++) {
        p[3 * (size_t)next + (size_t)k] = 0.5 * (a[k] + b[k]) + ripple * (b[(k + 1) % 3] - a[(k + 1) % 3]);
      }
      middle[h] = middle[twin[h]] = next++;
    }
  }
  for (int32_t t = 0; t < count; t++) {
    const int32_t *v = *corners + 3 * (size_t)t, *m = middle + 3 * (size_t)t;
    const int32_t four[12] = {v[0], m[0], m[2], m[0], v[1], m[1], m[2], m[1], v[2], m[0], m[1], m[2]};
    memcpy(made + 12 * (size_t)t, four, sizeof four);
  }
  free(twin);
  free(middle);
  free(*corners);
  *corners = made;
  *positions = p;
  *vertices = next;
  *triangles = 4 * count;
}

static int write_ply(const char *path, int32_t vertices, int32_t triangles, const double *p, const int32_t *corners) {
  FILE *file = fopen(path, "wb");
  if (!file) {
    perror(path);
    return 0;
  }
  fprintf(file,
          "ply\nformat binary_little_endian 1.0\nelement vertex %d\nproperty double x\nproperty double y\n"
          "property double z\nelement face %d\nproperty list uchar int vertex_indices\nend_header\n",
          vertices, triangles);
  int fine = fwrite(p, 3 * sizeof(double), (size_t)vertices, file) == (size_t)vertices;
  for (int32_t t = 0; t < triangles && fine; t++) {
    fine = fputc(3, file) != EOF && fwrite(corners + 3 * (size_t)t, sizeof(int32_t), 3, file) == 3;
  }
  fine &= fclose(file) == 0;
  if (!fine) {
    perror(path);
  }
  return fine;
}

int main(int argc, char **argv) {
  bench_mesh m;
  if (argc != 4) {
    fprintf(stderr, "usage: bench-subdivide FILE TRIANGLES OUT.ply\n");
    return BENCH_USAGE;
  }
  orb_context *ctx = bench_open(1, ORB_CPU_AUTO);
  int fine = bench_load(ctx, argv[1], (orb_repair_options){.repair = ORB_REPAIR_SAFE}, 0, &m);
  if (fine) {
    int32_t vertices = m.mesh.vertex_count, triangles = m.mesh.triangle_count;
    double *positions = malloc(3 * (size_t)vertices * sizeof *positions);
    int32_t *corners = malloc(3 * (size_t)triangles * sizeof *corners);
    fine = positions && corners;
    if (fine) {
      memcpy(positions, m.mesh.positions, 3 * (size_t)vertices * sizeof *positions);
      memcpy(corners, m.mesh.triangles, 3 * (size_t)triangles * sizeof *corners);
      while (triangles < atoi(argv[2])) {
        split(ctx, &vertices, &triangles, &positions, &corners);
      }
      fine = write_ply(argv[3], vertices, triangles, positions, corners);
    }
    free(positions);
    free(corners);
    bench_unload(ctx, &m);
  }
  orb_context_destroy(ctx);
  return fine ? BENCH_DONE : BENCH_REFUSED;
}
