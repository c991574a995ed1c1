/* bench-rims [--threads N] FIRST SECOND…: aligns two open shapes without landmarks, and prints how far the rims of the
 * first one are from those of the second under the map, the energy and the time, as a line of JSON for each SECOND. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench.h"
#include "orbmorph/locate.h"

/* The edges between what fills a hole and what does not: 6 numbers each. */
typedef struct rims {
  double *ends;
  int32_t *vertex;
  int count;
} rims;

static int find_rims(orb_context *ctx, const orb_mesh *mesh, rims *out) {
  const size_t half_edges = 3 * (size_t)mesh->triangle_count;
  int32_t *twin = malloc(half_edges * sizeof *twin);
  *out = (rims){malloc(6 * half_edges * sizeof *out->ends), malloc(half_edges * sizeof *out->vertex), 0};
  int fine = twin && out->ends && out->vertex &&
             orb_mesh_twins(ctx, mesh->triangles, mesh->triangle_count, mesh->vertex_count, twin) == ORB_OK;
  for (int32_t h = 0; fine && h < 3 * mesh->triangle_count; h++) {
    if (mesh->source_triangle[h / 3] == ORB_MADE_FILL && mesh->source_triangle[twin[h] / 3] != ORB_MADE_FILL) {
      const int32_t v = mesh->triangles[h], w = mesh->triangles[orb_next(h)];
      memcpy(out->ends + 6 * (size_t)out->count, mesh->positions + 3 * (size_t)v, 3 * sizeof(double));
      memcpy(out->ends + 6 * (size_t)out->count + 3, mesh->positions + 3 * (size_t)w, 3 * sizeof(double));
      out->vertex[out->count++] = v;
    }
  }
  free(twin);
  return fine;
}

static void free_rims(rims *one) {
  free(one->ends);
  free(one->vertex);
}

static double from_edge(const double p[3], const double ends[6]) {
  double along = 0, length = 0, d = 0;
  for (int k = 0; k < 3; k++) {
    along += (p[k] - ends[k]) * (ends[k + 3] - ends[k]);
    length += (ends[k + 3] - ends[k]) * (ends[k + 3] - ends[k]);
  }
  const double t = length > 0 ? fmin(fmax(along / length, 0), 1) : 0;
  for (int k = 0; k < 3; k++) {
    const double off = p[k] - ends[k] - t * (ends[k + 3] - ends[k]);
    d += off * off;
  }
  return sqrt(d);
}

static double from_rims(const double p[3], const rims *to) {
  double least = INFINITY;
  for (int i = 0; i < to->count; i++) {
    least = fmin(least, from_edge(p, to->ends + 6 * (size_t)i));
  }
  return least;
}

/* The share of the rim vertices of `from` whose places on the other shape are within `near` of its rims; *mean: of the
 * distance. Both relative to the diagonal. */
static int measure(orb_context *ctx, const orb_aligned_shape *from, const orb_aligned_shape *to, double near,
                   double *share, double *mean) {
  orb_extent extent;
  rims first, second = {0};
  orb_locator *locator = NULL;
  int fine = find_rims(ctx, &from->mesh, &first) && find_rims(ctx, &to->mesh, &second) &&
             orb_locator_create(ctx, to->points, to->mesh.vertex_count, to->mesh.triangles, to->mesh.triangle_count,
                                NULL, &locator) == ORB_OK;
  orb_mesh_extent(&to->mesh, &extent);
  *share = *mean = 0;
  for (int i = 0; fine && i < first.count; i++) {
    orb_place place;
    double p[3];
    orb_locate(locator, from->points + 3 * (size_t)first.vertex[i], -1, &place);
    orb_place_position(&to->mesh, &place, p);
    const double distance = from_rims(p, &second) / extent.diagonal;
    *share += (distance <= near) / (double)first.count;
    *mean += distance / first.count;
  }
  free_rims(&first);
  free_rims(&second);
  orb_locator_destroy(ctx, locator);
  return fine;
}

static int run(const char *path[2], int threads) {
  orb_context *ctx = bench_open(threads, ORB_CPU_AUTO);
  const orb_repair_options repair = {.repair = ORB_REPAIR_SAFE | ORB_REPAIR_FILL_HOLES | ORB_REPAIR_LARGEST_COMPONENT};
  bench_mesh mesh[2];
  orb_embedding embedding[2];
  orb_align_shape shapes[2];
  orb_align_options options;
  orb_embed_options embed;
  orb_alignment aligned;
  orb_embed_defaults(&embed);
  for (int s = 0; s < 2; s++) {
    if (!bench_load(ctx, path[s], repair, 0, &mesh[s]) ||
        orb_embed(ctx, &mesh[s].mesh, &embed, &embedding[s]) != ORB_OK) {
      bench_complain(path[s], ctx);
      return 0;
    }
    shapes[s] = (orb_align_shape){&mesh[s].mesh, embedding[s].points};
  }
  orb_align_defaults(&options);
  options.method = ORB_ALIGN_AUTO;
  options.preset = ORB_PRESET_DEFAULT;
  const double start = orb_clock();
  if (orb_align(ctx, shapes, 2, NULL, 0, &options, &aligned) != ORB_OK) {
    bench_complain(path[1], ctx);
    return 0;
  }
  const double seconds = orb_clock() - start;
  double share[2], mean[2];
  const int fine = measure(ctx, &aligned.shapes[0], &aligned.shapes[1], 0.005, &share[0], &mean[0]) &&
                   measure(ctx, &aligned.shapes[1], &aligned.shapes[0], 0.005, &share[1], &mean[1]);
  printf(
      "{\"shapes\":[\"%s\",\"%s\"],\"vertices\":[%d,%d],\"rims\":%d,\"share\":[%.4f,%.4f],\"mean\":[%.5f,%.5f],"
      "\"energy\":%.4f,\"seconds\":%.2f}\n",
      mesh[0].name, mesh[1].name, mesh[0].mesh.vertex_count, mesh[1].mesh.vertex_count, aligned.rim_count, share[0],
      share[1], mean[0], mean[1], aligned.energy, seconds);
  fflush(stdout);
  orb_alignment_free(ctx, &aligned);
  for (int s = 0; s < 2; s++) {
    orb_embedding_free(ctx, &embedding[s]);
    bench_unload(ctx, &mesh[s]);
  }
  orb_context_destroy(ctx);
  return fine;
}

int main(int argc, char **argv) {
  int first = 1, threads = 1;
  if (argc > 2 && strcmp(argv[1], "--threads") == 0) {
    threads = atoi(argv[2]);
    first = 3;
  }
  if (argc - first < 2) {
    fprintf(stderr, "usage: bench-rims [--threads N] FIRST SECOND…\n");
    return 2;
  }
  int fine = 1;
  for (int i = first + 1; i < argc; i++) {
    fine &= run((const char *[2]){argv[first], argv[i]}, threads);
  }
  return fine ? 0 : 1;
}
