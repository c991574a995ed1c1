/* bench-kernel-sampling [--trace] FILE...: prints the columns of the paper's Table 1 as one JSON object per mesh.
 * --trace adds the points of Fig. 13: [vertices inserted, seconds placing, seconds optimising]. Uses one thread. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/report_codec.h"
#include "bench.h"
#include "embed/kernel_sampling/kernel_sampling.h"

static void add_point(void *user, int32_t inserted, double place_seconds, double optimize_seconds) {
  api_text *points = user;
  api_json_open(points, '[');
  api_json_integer(points, inserted);
  api_json_number(points, place_seconds);
  api_json_number(points, optimize_seconds);
  api_json_close(points, ']');
}

static int print_line(const bench_mesh *m, const orb_ks_report *r, const orb_certificate *certificate,
                      const orb_distortion *distortion, double cpu, api_text *points) {
  api_text line = {0};
  api_json_open(&line, '{');
  api_json_member_string(&line, "mesh", m->name);
  api_json_member_integer(&line, "vertices", m->mesh.vertex_count);
  api_json_member_integer(&line, "triangles", m->mesh.triangle_count);
  api_json_member_number(&line, "simplify_seconds", r->simplify_seconds);
  api_json_member_number(&line, "place_seconds", r->place_seconds);
  api_json_member_number(&line, "optimize_seconds", r->optimize_seconds);
  api_json_member_number(&line, "cpu_seconds", cpu);
  api_json_member_number(&line, "kernel_points", r->kernel_points);
  api_json_member_number(&line, "iterations", r->iterations);
  api_json_member_integer(&line, "executions", r->executions);
  api_json_member_integer(&line, "clipped", r->clipped);
  api_json_member_integer(&line, "loosened", r->loosened);
  api_json_member_integer(&line, "relieved", r->relieved);
  api_json_member_integer(&line, "attempts", r->attempts);
  api_json_key(&line, "certificate");
  api_certificate_write(&line, certificate);
  api_json_key(&line, "distortion");
  api_distortion_write(&line, distortion);
  if (points) {
    api_json_close(points, ']');
    api_json_member_raw(&line, "trace", points->data);
  }
  api_json_close(&line, '}');
  return bench_print(&line);
}

static int run_once(const char *path, int trace) {
  orb_context *ctx = bench_open(1, ORB_CPU_AUTO);
  bench_mesh m;
  int fine = bench_load(ctx, path, (orb_repair_options){.repair = ORB_REPAIR_SAFE}, 0, &m);
  if (fine) {
    orb_embed_options options;
    orb_embed_defaults(&options);
    api_text points = {0};
    orb_ks_report report = {.trace = trace ? add_point : NULL, .trace_user = &points};
    orb_certificate certificate;
    orb_distortion distortion;
    api_json_open(&points, '[');
    double *sphere = orb_alloc(ctx, 3 * (size_t)m.mesh.vertex_count, sizeof *sphere), cpu = bench_cpu();
    fine = sphere && orb_kernel_sampling(ctx, &m.mesh, &options, sphere, &report) == ORB_OK;
    cpu = bench_cpu() - cpu;
    fine = fine &&
           orb_certify(ctx, sphere, m.mesh.vertex_count, m.mesh.triangles, m.mesh.triangle_count, &certificate) ==
               ORB_OK &&
           orb_distortion_measure(ctx, m.mesh.positions, sphere, m.mesh.triangles, m.mesh.triangle_count,
                                  &distortion) == ORB_OK;
    if (!fine) {
      bench_complain(path, ctx);
    }
    fine = fine && print_line(&m, &report, &certificate, &distortion, cpu, trace ? &points : NULL);
    api_text_free(&points);
    orb_free(ctx, sphere);
    bench_unload(ctx, &m);
  }
  orb_context_destroy(ctx);
  return fine;
}

int main(int argc, char **argv) {
  int trace = argc > 1 && strcmp(argv[1], "--trace") == 0, refused = 0;
  if (argc < 2 + trace) {
    fprintf(stderr, "usage: bench-kernel-sampling [--trace] FILE...\n");
    return BENCH_USAGE;
  }
  for (int i = 1 + trace; i < argc; i++) {
    refused |= !run_once(argv[i], trace);
  }
  return refused ? BENCH_REFUSED : BENCH_DONE;
}
