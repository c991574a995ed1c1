/* Merges every pair of the meshes in-process; reads and embeds each mesh once. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "api/json.h"
#include "api/report_codec.h"
#include "bench.h"

static void write_result(api_text *line, const orb_merge_result *r, const orb_align_shape *shapes) {
  double bound = 0, rms = 0;
  for (int s = 0; s < 2; s++) {
    bound = fmax(bound, r->shapes[s].hausdorff / r->shapes[s].diagonal);
    rms = fmax(rms, r->shapes[s].rms / r->shapes[s].diagonal);
  }
  api_json_member_integer(line, "triangles", r->supermesh.triangle_count);
  api_json_key(line, "growth");
  api_json_open(line, '[');
  for (int s = 0; s < 2; s++) {
    api_json_number(line, (double)r->alignment.shapes[s].mesh.triangle_count / shapes[s].mesh->triangle_count);
  }
  api_json_close(line, ']');
  api_json_member_number(line, "bound_relative", bound);
  api_json_member_number(line, "rms_relative", rms);
  api_json_member_number(line, "energy", r->alignment.energy);
  api_json_member_number(line, "inverted", r->pairs[0].inverted_fraction);
  api_json_member_number(line, "align_seconds", r->timings.align);
  api_json_member_number(line, "remesh_seconds", r->timings.remesh);
  api_json_key(line, "certificate");
  api_merge_certificate_write(r, line);
}

static int run_pair(const bench_options *options, const bench_fleet *fleet, int a, int b) {
  orb_context *ctx = bench_open_limited(options);
  orb_merge_options merge = options->merge;
  orb_merge_result result;
  orb_align_shape shapes[2] = {{&fleet->mesh[a].mesh, fleet->embedding[a].points},
                               {&fleet->mesh[b].mesh, fleet->embedding[b].points}};
  const char *names[2] = {fleet->mesh[a].name, fleet->mesh[b].name};
  merge.align.method = options->align_given ? merge.align.method : ORB_ALIGN_AUTO;
  double start = orb_clock(), cpu = bench_cpu();
  orb_status status = orb_merge(ctx, shapes, names, 2, NULL, 0, &merge, &result);
  double seconds = orb_clock() - start;
  api_text line = {0};
  api_json_open(&line, '{');
  api_json_key(&line, "shapes");
  api_json_open(&line, '[');
  api_json_string(&line, names[0]);
  api_json_string(&line, names[1]);
  api_json_close(&line, ']');
  api_json_member_integer(&line, "largest_input",
                          shapes[0].mesh->triangle_count > shapes[1].mesh->triangle_count
                              ? shapes[0].mesh->triangle_count
                              : shapes[1].mesh->triangle_count);
  api_json_member_string(&line, "status", orb_status_name(status));
  api_json_member_string(&line, "detail", status == ORB_OK ? "" : orb_context_error(ctx)->detail);
  api_json_member_number(&line, "seconds", seconds);
  api_json_member_number(&line, "cpu_seconds", bench_cpu() - cpu);
  if (status == ORB_OK) {
    write_result(&line, &result, shapes);
    orb_merge_result_free(ctx, &result);
  }
  api_json_close(&line, '}');
  orb_context_destroy(ctx);
  return bench_print(&line);
}

int bench_pairs(const bench_options *options) {
  bench_fleet fleet;
  int fine = bench_fleet_load(options, &fleet);
  long number = 0;
  for (int a = 0; fine && a < fleet.count; a++) {
    for (int b = a + 1; fine && b < fleet.count; b++, number++) {
      if (number >= options->first && number - options->first < options->sets) {
        fine = run_pair(options, &fleet, a, b);
      }
    }
  }
  bench_fleet_free(&fleet);
  return fine ? BENCH_DONE : BENCH_REFUSED;
}
