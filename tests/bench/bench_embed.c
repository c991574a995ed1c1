#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "api/embedding_codec.h"
#include "api/report_codec.h"
#include "bench.h"

typedef struct embed_times {
  double total, cpu, embed_cpu;
  int64_t peak;
} embed_times;

static int print_line(const bench_options *options, const bench_mesh *m, const orb_embedding *e, const embed_times *t,
                      int repeat, const orb_context *ctx) {
  static const char *const cpus[] = {"auto", "plain", "avx2", "avx512"};
  api_text line = {0};
  api_json_open(&line, '{');
  api_json_member_string(&line, "mesh", m->name);
  api_json_member_integer(&line, "vertices", m->mesh.vertex_count);
  api_json_member_integer(&line, "triangles", m->mesh.triangle_count);
  api_embedding_options_members(&options->embed, &line);
  api_json_member_integer(&line, "threads", orb_threads(ctx));
  api_json_member_string(&line, "cpu", cpus[orb_context_cpu(ctx)]);
  api_json_member_integer(&line, "repeat", repeat);
  api_json_key(&line, "seconds");
  api_json_open(&line, '{');
  api_json_member_number(&line, "read", m->read_seconds);
  api_json_member_number(&line, "check", m->check_seconds);
  api_json_member_number(&line, "simplify", e->timings.simplify);
  api_json_member_number(&line, "embed", e->timings.embed);
  api_json_member_number(&line, "certify", e->timings.certify);
  api_json_member_number(&line, "total", t->total);
  api_json_close(&line, '}');
  api_json_member_number(&line, "cpu_seconds", t->cpu);
  api_json_member_number(&line, "embed_cpu_seconds", t->embed_cpu);
  api_json_member_number(&line, "triangles_per_minute", 60.0 * m->mesh.triangle_count / (t->total - m->read_seconds));
  api_json_member_integer(&line, "peak_rss_bytes", t->peak);
  api_json_key(&line, "certificate");
  api_certificate_write(&line, &e->certificate);
  api_json_key(&line, "distortion");
  api_distortion_write(&line, &e->distortion);
  api_json_member_string(&line, "engine", ORB_ENGINE);
  api_json_close(&line, '}');
  return bench_print(&line);
}

static int write_sphere(orb_context *ctx, const char *folder, const bench_mesh *m, const orb_embedding *e) {
  char path[4096];
  orb_buffer ply = {0};
  if (mkdir(folder, 0777) != 0 && errno != EEXIST) {
    perror(folder);
    return 0;
  }
  if (snprintf(path, sizeof path, "%s/%s.sphere.ply", folder, m->name) >= (int)sizeof path) {
    fprintf(stderr, "%s: the path is too long\n", folder);
    return 0;
  }
  int fine = orb_sphere_ply_write(ctx, &m->mesh, e->points, &ply) == ORB_OK;
  if (!fine) {
    bench_complain(path, ctx);
  }
  fine = fine && bench_spill(path, ply.data, ply.size);
  orb_buffer_free(ctx, &ply);
  return fine;
}

/* Runs in its own context: only the page cache of the file is warm. */
static int run_once(const bench_options *options, const char *path, int repeat) {
  bench_mesh m;
  orb_embedding e;
  bench_reset_peak();
  orb_context *ctx = bench_open(options->threads, options->cpu);
  double start = orb_clock(), cpu = bench_cpu();
  int fine = bench_load(ctx, path, options->repair, 0, &m);
  if (fine) {
    orb_mesh_drop_attributes(ctx, &m.mesh);
    double before = bench_cpu();
    fine = orb_embed(ctx, &m.mesh, &options->embed, &e) == ORB_OK;
    double embed_cpu = bench_cpu() - before;
    if (fine) {
      embed_times t = {
          .total = orb_clock() - start, .cpu = bench_cpu() - cpu, .embed_cpu = embed_cpu, .peak = bench_peak()};
      fine = print_line(options, &m, &e, &t, repeat, ctx);
      fine = fine && (!options->out || write_sphere(ctx, options->out, &m, &e));
      orb_embedding_free(ctx, &e);
    } else {
      bench_complain(path, ctx);
    }
    bench_unload(ctx, &m);
  }
  orb_context_destroy(ctx);
  return fine;
}

int bench_embed(const bench_options *options) {
  int refused = 0;
  for (int i = 0; i < options->file_count; i++) {
    for (int repeat = 0; repeat < options->repeat; repeat++) {
      if (!run_once(options, options->files[i], repeat)) {
        refused = 1;
        break;
      }
    }
  }
  return refused ? BENCH_REFUSED : BENCH_DONE;
}
