/* bench-kernel-sampling [--trace] FILE...: the columns of the paper's Table 1 as JSON, one line a mesh; with --trace
 * also the points of Fig. 13, [vertices inserted, seconds placing, seconds optimising]. One thread. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/report_codec.h"
#include "bench.h"
#include "embed/kernel_sampling.h"

static void add_point(void *user, int32_t inserted, double place_seconds, double optimize_seconds) {
  orb_text *points = user;
  orb_json_open(points, '[');
  orb_json_integer(points, inserted);
  orb_json_number(points, place_seconds);
  orb_json_number(points, optimize_seconds);
  orb_json_close(points, ']');
}

static int print_line(const bench_mesh *m, const orb_ks_report *r, const orb_certificate *certificate,
                      const orb_distortion *distortion, double cpu, orb_text *points) {
  orb_text line = {0};
  orb_json_open(&line, '{');
  orb_json_member_string(&line, "mesh", m->name);
  orb_json_member_integer(&line, "vertices", m->mesh.vertex_count);
  orb_json_member_integer(&line, "triangles", m->mesh.triangle_count);
  orb_json_member_number(&line, "simplify_seconds", r->simplify_seconds);
  orb_json_member_number(&line, "place_seconds", r->place_seconds);
  orb_json_member_number(&line, "optimize_seconds", r->optimize_seconds);
  orb_json_member_number(&line, "cpu_seconds", cpu);
  orb_json_member_number(&line, "kernel_points", r->kernel_points);
  orb_json_member_number(&line, "iterations", r->iterations);
  orb_json_member_integer(&line, "executions", r->executions);
  orb_json_member_integer(&line, "clipped", r->clipped);
  orb_json_member_integer(&line, "loosened", r->loosened);
  orb_json_member_integer(&line, "relieved", r->relieved);
  orb_json_member_integer(&line, "attempts", r->attempts);
  orb_json_key(&line, "certificate");
  orb_certificate_write(&line, certificate);
  orb_json_key(&line, "distortion");
  orb_distortion_write(&line, distortion);
  if (points) {
    orb_json_close(points, ']');
    orb_json_member_raw(&line, "trace", points->data);
  }
  orb_json_close(&line, '}');
  return bench_print(&line);
}

static int run_once(const char *path, int trace) {
  orb_context *ctx = bench_open(1, ORB_CPU_AUTO);
  bench_mesh m;
  int fine = bench_load(ctx, path, ORB_REPAIR_SAFE, 0, &m);
  if (fine) {
    orb_embed_options options;
    orb_embed_defaults(&options);
    orb_text points = {0};
    orb_ks_report report = {.trace = trace ? add_point : NULL, .trace_user = &points};
    orb_certificate certificate;
    orb_distortion distortion;
    orb_json_open(&points, '[');
    double *sphere = ORB_NEW(ctx, double, 3 * (size_t)m.mesh.vertex_count), cpu = bench_cpu();
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
    orb_text_free(&points);
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
