#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/json.h"
#include "api/report_codec.h"
#include "bench.h"

static void write_members(api_text *line, const bench_set *set, const orb_merge_result *r) {
  api_json_key(line, "shapes");
  api_json_open(line, '[');
  for (int32_t s = 0; s < set->count; s++) {
    api_json_open(line, '{');
    api_json_member_string(line, "name", set->name[s]);
    api_json_member_integer(line, "triangles", set->mesh[s].mesh.triangle_count);
    api_shape_report_members(line, &r->shapes[s]);
    api_json_close(line, '}');
  }
  api_json_close(line, ']');
  api_json_key(line, "landmarks");
  api_json_open(line, '[');
  for (int32_t l = 0; l < r->alignment.landmark_count; l++) {
    api_json_open(line, '{');
    api_json_member_string(line, "name", l < set->list.count ? set->list.items[l].name : "");
    api_json_key(line, "residual_relative");
    api_json_open(line, '[');
    for (int32_t s = 0; s < set->count; s++) {
      api_json_number(line, r->landmark_residuals[(size_t)l * (size_t)set->count + (size_t)s]);
    }
    api_json_close(line, ']');
    api_json_close(line, '}');
  }
  api_json_close(line, ']');
  api_json_key(line, "certificate");
  api_merge_certificate_write(r, line);
  if (r->pair_count > 0) {
    api_json_key(line, "distortion");
    api_distortion_write(line, &r->pairs[0].distortion);
  }
  api_json_key(line, "pairs");
  api_pairs_write(r, line);
}

static int print_line(const bench_set *set, const orb_merge_result *r, double cpu, int64_t peak, int repeat,
                      int threads) {
  api_text line = {0}, name = {0};
  int64_t input = 0;
  for (int32_t s = 0; s < set->count; s++) {
    api_text_add(&name, s ? "+" : "");
    api_text_add(&name, set->name[s]);
    input += set->mesh[s].mesh.triangle_count;
  }
  api_json_open(&line, '{');
  api_json_member_string(&line, "mesh", name.data ? name.data : "");
  api_text_free(&name);
  api_json_member_integer(&line, "vertices", r->supermesh.vertex_count);
  api_json_member_integer(&line, "triangles", r->supermesh.triangle_count);
  api_json_member_integer(&line, "input_triangles", input);
  api_json_member_integer(&line, "asset_bytes", (int64_t)r->asset.size);
  api_json_member_integer(&line, "threads", threads);
  api_json_member_integer(&line, "repeat", repeat);
  api_json_key(&line, "seconds");
  api_json_open(&line, '{');
  api_json_member_number(&line, "read", set->read);
  api_json_member_number(&line, "embed", set->embed);
  api_json_member_number(&line, "align", r->timings.align);
  api_json_member_number(&line, "remesh", r->timings.remesh);
  api_json_member_number(&line, "transfer", r->timings.transfer);
  api_json_member_number(&line, "write", r->timings.write);
  api_json_member_number(&line, "total", r->timings.total);
  api_json_close(&line, '}');
  api_json_member_number(&line, "cpu_seconds", cpu);
  api_json_member_number(&line, "triangles_per_minute", 60.0 * r->supermesh.triangle_count / r->timings.total);
  api_json_member_integer(&line, "peak_rss_bytes", peak);
  api_json_member_number(&line, "energy", r->alignment.energy);
  write_members(&line, set, r);
  api_json_member_string(&line, "engine", ORB_ENGINE);
  api_json_close(&line, '}');
  return bench_print(&line);
}

static int run_once(const bench_options *options, bench_set *set, int repeat) {
  orb_merge_result result;
  bench_reset_peak();
  orb_context *ctx = bench_open(options->threads, options->cpu);
  double cpu = bench_cpu();
  memset(set, 0, sizeof *set);
  set->count = options->file_count;
  int fine = bench_set_load(ctx, options, set);
  orb_merge_options merge = options->merge;
  if (!options->align_given) {
    merge.align.method = set->list.count > 0 ? ORB_ALIGN_PIN : ORB_ALIGN_AUTO;
  }
  if (fine) {
    fine =
        orb_merge(ctx, set->shape, set->name, set->count, set->landmarks, set->list.count, &merge, &result) == ORB_OK;
    if (fine) {
      fine = print_line(set, &result, bench_cpu() - cpu, bench_peak(), repeat, orb_threads(ctx));
      fine = fine && (!options->out || bench_spill(options->out, result.asset.data, result.asset.size));
      orb_merge_result_free(ctx, &result);
    } else {
      bench_complain("merge", ctx);
    }
  }
  bench_set_free(ctx, set);
  orb_context_destroy(ctx);
  return fine;
}

int bench_merge(const bench_options *options) {
  bench_set *set = malloc(sizeof *set);
  int fine = set != NULL;
  for (int repeat = 0; fine && repeat < options->repeat; repeat++) {
    fine = run_once(options, set, repeat);
  }
  free(set);
  return fine ? BENCH_DONE : BENCH_REFUSED;
}
