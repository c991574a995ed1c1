#include <stdio.h>
#include <stdlib.h>

#include "bench.h"

int bench_fleet_load(const bench_options *options, bench_fleet *out) {
  *out = (bench_fleet){.ctx = bench_open(options->threads, options->cpu)};
  out->mesh = calloc((size_t)options->file_count, sizeof *out->mesh);
  out->embedding = calloc((size_t)options->file_count, sizeof *out->embedding);
  int fine = out->mesh && out->embedding;
  for (int i = 0; fine && i < options->file_count; i++) {
    fine = bench_load(out->ctx, options->files[i], options->repair, 0, &out->mesh[i]);
    out->count += fine;
    if (fine && orb_embed(out->ctx, &out->mesh[i].mesh, &options->embed, &out->embedding[i]) != ORB_OK) {
      bench_complain(options->files[i], out->ctx);
      fine = 0;
    }
  }
  return fine;
}

void bench_fleet_free(bench_fleet *fleet) {
  for (int i = 0; i < fleet->count; i++) {
    orb_embedding_free(fleet->ctx, &fleet->embedding[i]);
    bench_unload(fleet->ctx, &fleet->mesh[i]);
  }
  free(fleet->mesh);
  free(fleet->embedding);
  orb_context_destroy(fleet->ctx);
}

orb_context *bench_open_limited(const bench_options *options) {
  orb_context *ctx;
  orb_context_options limits = {.threads = options->threads, .max_triangles = 50000000};
  limits.deadline_ms = options->seconds > 0 ? orb_clock_ms() + 1000 * options->seconds : 0;
  if (orb_context_create(&limits, &ctx) != ORB_OK) {
    fprintf(stderr, "orbmorph-bench: out of memory\n");
    exit(BENCH_REFUSED);
  }
  return ctx;
}
