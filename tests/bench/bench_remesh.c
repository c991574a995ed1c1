/* Measures the steps after the alignment, remeshing and writing the asset, on generated bodies or on files whose
 * alignment is stored between runs (without attributes). */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench.h"

typedef struct remesh_run {
  const bench_options *options;
  int32_t count, landmark_count;
  double align; /* seconds; 0: loaded from the stored alignment */
  orb_aligned_shape shape[API_SHAPES_MAX];
} remesh_run;

static int bytes_io(FILE *file, void *bytes, size_t size, int write) {
  return size == 0 || (write ? fwrite(bytes, size, 1, file) : fread(bytes, size, 1, file)) == 1;
}

/* Writes one array of a shape to the stored alignment, or reads it back. */
static int array_io(orb_context *ctx, FILE *file, void *array, size_t count, size_t size, int write) {
  void *block;
  memcpy(&block, array, sizeof block);
  if (!write) {
    block = orb_alloc(ctx, count, size);
    memcpy(array, &block, sizeof block);
  }
  return block && bytes_io(file, block, count * size, write);
}

static int shape_io(orb_context *ctx, FILE *file, orb_aligned_shape *shape, int32_t landmarks, int write) {
  orb_mesh *mesh = &shape->mesh;
  int32_t sizes[2] = {mesh->vertex_count, mesh->triangle_count};
  int fine = bytes_io(file, sizes, sizeof sizes, write);
  mesh->vertex_count = sizes[0];
  mesh->triangle_count = sizes[1];
  size_t vertices = (size_t)sizes[0], triangles = (size_t)sizes[1];
  return fine && array_io(ctx, file, &mesh->positions, 3 * vertices, sizeof(double), write) &&
         array_io(ctx, file, &mesh->triangles, 3 * triangles, sizeof(int32_t), write) &&
         array_io(ctx, file, &shape->points, 3 * vertices, sizeof(double), write) &&
         array_io(ctx, file, &shape->landmark_vertices, (size_t)landmarks, sizeof(int32_t), write);
}

static int keep_io(orb_context *ctx, remesh_run *run, int write) {
  FILE *file = fopen(run->options->keep, write ? "wb" : "rb");
  if (!file) {
    return 0;
  }
  int32_t sizes[2] = {run->count, run->landmark_count};
  int fine = bytes_io(file, sizes, sizeof sizes, write) && sizes[0] <= API_SHAPES_MAX;
  run->count = fine ? sizes[0] : 0;
  run->landmark_count = sizes[1];
  for (int32_t s = 0; s < run->count && fine; s++) {
    fine = shape_io(ctx, file, &run->shape[s], run->landmark_count, write);
  }
  fine = fclose(file) == 0 && fine;
  if (!fine) {
    fprintf(stderr, "%s: cannot be %s\n", run->options->keep, write ? "written" : "read");
  }
  return fine;
}

static int make_bodies(orb_context *ctx, remesh_run *run) {
  for (const char *at = run->options->bodies; *at; run->count++) {
    char *end;
    long triangles = strtol(at, &end, 10);
    if (end == at || triangles < 8 || triangles > 20000000 || run->count == API_SHAPES_MAX ||
        !bench_body(ctx, (int32_t)triangles, (uint64_t)run->count + 1, &run->shape[run->count])) {
      fprintf(stderr, "orbmorph-bench: no bodies of %s triangles\n", run->options->bodies);
      return 0;
    }
    at = *end == ',' ? end + 1 : end;
  }
  return 1;
}

static int align_files(orb_context *ctx, remesh_run *run) {
  bench_set *set = calloc(1, sizeof *set);
  orb_alignment alignment = {0};
  int fine = set != NULL;
  if (fine) {
    set->count = run->options->file_count;
    fine = bench_set_load(ctx, run->options, set);
  }
  orb_align_options align = run->options->merge.align;
  if (fine && !run->options->align_given) {
    align.method = set->list.count > 0 ? ORB_ALIGN_PIN : ORB_ALIGN_AUTO;
  }
  double start = orb_clock();
  if (fine && orb_align(ctx, set->shape, set->count, set->landmarks, set->list.count, &align, &alignment) != ORB_OK) {
    bench_complain("align", ctx);
    fine = 0;
  }
  run->align = orb_clock() - start;
  for (int32_t s = 0; fine && s < alignment.shape_count; s++) {
    run->shape[s] = alignment.shapes[s];
    memset(&alignment.shapes[s], 0, sizeof alignment.shapes[s]);
  }
  run->count = fine ? alignment.shape_count : 0;
  run->landmark_count = alignment.landmark_count;
  orb_alignment_free(ctx, &alignment);
  if (set) {
    bench_set_free(ctx, set);
  }
  free(set);
  return fine && (!run->options->keep || keep_io(ctx, run, 1));
}

/* Counts slivers on shape s: quality below 1/100, which is a height of 1/90 of the longest side. */
static int64_t count_slivers(const orb_supermesh *mesh, const double *p) {
  int64_t count = 0;
  for (int64_t t = 0; t < mesh->triangle_count; t++) {
    const double *c[3];
    double edges = 0, n[3], e[3][3];
    for (int k = 0; k < 3; k++) {
      c[k] = p + 3 * (int64_t)mesh->triangles[3 * t + k];
    }
    for (int k = 0; k < 3; k++) {
      for (int j = 0; j < 3; j++) {
        e[k][j] = c[(k + 1) % 3][j] - c[k][j];
        edges += e[k][j] * e[k][j];
      }
    }
    for (int k = 0; k < 3; k++) {
      n[k] = e[0][(k + 1) % 3] * e[1][(k + 2) % 3] - e[0][(k + 2) % 3] * e[1][(k + 1) % 3];
    }
    count += 3.4641016 * sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]) < 0.02 * edges;
  }
  return count;
}

static void cross_of(const double *a, const double *b, const double *c, double out[3]) {
  for (int k = 0; k < 3; k++) {
    int i = (k + 1) % 3, j = (k + 2) % 3;
    out[k] = (b[i] - a[i]) * (c[j] - a[j]) - (b[j] - a[j]) * (c[i] - a[i]);
  }
}

/* Counts triangles that face away from the input triangle at their centre on the sphere. This second measure of
 * inversion also counts triangles that bend within the tolerance. */
static int64_t count_against_centre(orb_context *ctx, const orb_supermesh *mesh, const orb_aligned_shape *shape,
                                    const double *positions) {
  orb_locator *locator = NULL;
  const orb_mesh *m = &shape->mesh;
  int64_t count = 0;
  if (orb_locator_create(ctx, shape->points, m->vertex_count, m->triangles, m->triangle_count, NULL, &locator) !=
      ORB_OK) {
    return -1;
  }
  for (int64_t t = 0; t < mesh->triangle_count; t++) {
    const double *p[3], *q[3];
    double centre[3] = {0}, own[3], theirs[3], length = 0;
    orb_place place;
    for (int k = 0; k < 3; k++) {
      p[k] = positions + 3 * (int64_t)mesh->triangles[3 * t + k];
      for (int j = 0; j < 3; j++) {
        centre[j] += mesh->points[3 * (int64_t)mesh->triangles[3 * t + k] + j];
      }
    }
    for (int j = 0; j < 3; j++) {
      length += centre[j] * centre[j];
    }
    for (int j = 0; j < 3; j++) {
      centre[j] /= sqrt(length);
    }
    orb_locate(locator, centre, -1, &place);
    for (int k = 0; k < 3; k++) {
      q[k] = m->positions + 3 * (int64_t)m->triangles[3 * (int64_t)place.triangle + k];
    }
    cross_of(p[0], p[1], p[2], own);
    cross_of(q[0], q[1], q[2], theirs);
    count += own[0] * theirs[0] + own[1] * theirs[1] + own[2] * theirs[2] < 0;
  }
  orb_locator_destroy(ctx, locator);
  return count;
}

static int write_shape(orb_context *ctx, api_text *line, const remesh_run *run, const orb_supermesh *mesh, int32_t s,
                       const orb_shape_report *report) {
  double *positions = orb_alloc(ctx, 3 * (size_t)mesh->vertex_count, sizeof *positions);
  unsigned char *inverted = orb_alloc(ctx, (size_t)mesh->triangle_count, sizeof *inverted);
  int fine = positions && inverted &&
             orb_transfer_positions(ctx, &run->shape[s], mesh->places + (int64_t)s * mesh->vertex_count,
                                    mesh->vertex_count, positions) == ORB_OK &&
             orb_mark_inverted(ctx, mesh, &run->shape[s], s, positions, inverted) == ORB_OK;
  int64_t count = 0;
  for (int64_t t = 0; fine && t < mesh->triangle_count; t++) {
    count += inverted[t];
  }
  orb_extent extent;
  orb_mesh_extent(&run->shape[s].mesh, &extent);
  api_json_open(line, '{');
  api_json_member_integer(line, "triangles", run->shape[s].mesh.triangle_count);
  api_json_member_number(line, "hausdorff_relative", mesh->error_bound[s] / extent.diagonal);
  api_json_member_number(line, "hausdorff_sampled_relative", report->hausdorff_sampled / extent.diagonal);
  api_json_member_number(line, "rms_relative", report->rms / extent.diagonal);
  api_json_member_integer(line, "inverted", count);
  api_json_member_integer(line, "against_centre",
                          fine ? count_against_centre(ctx, mesh, &run->shape[s], positions) : -1);
  api_json_member_integer(line, "slivers", fine ? count_slivers(mesh, positions) : 0);
  api_json_close(line, '}');
  orb_free(ctx, positions);
  orb_free(ctx, inverted);
  return fine;
}

static int run_once(orb_context *ctx, const remesh_run *run, int repeat) {
  orb_supermesh mesh = {0};
  orb_buffer asset = {0};
  api_text line = {0};
  const char *names[API_SHAPES_MAX];
  int64_t input = 0, largest = 0;
  for (int32_t s = 0; s < run->count; s++) {
    int32_t triangles = run->shape[s].mesh.triangle_count;
    names[s] = "body";
    input += triangles;
    largest = triangles > largest ? triangles : largest;
  }
  double start = orb_clock(), cpu = bench_cpu();
  int fine = orb_remesh(ctx, run->shape, run->count, run->landmark_count, &run->options->merge.remesh, &mesh) == ORB_OK;
  double remeshed = orb_clock(), remesh_cpu = bench_cpu();
  fine = fine && (run->count < 2 ||
                  orb_asset_write(ctx, &mesh, run->shape, names, &run->options->merge.asset, NULL, &asset) == ORB_OK);
  double written = orb_clock();
  orb_shape_report report[API_SHAPES_MAX];
  for (int32_t s = 0; fine && s < run->count; s++) {
    fine = orb_shape_measure(ctx, &run->shape[s], &mesh, s, &report[s]) == ORB_OK;
  }
  double measured = orb_clock();
  api_json_open(&line, '{');
  api_json_member_string(&line, "remesh", orb_remesh_method_name(run->options->merge.remesh.method));
  api_json_member_integer(&line, "vertices", mesh.vertex_count);
  api_json_member_integer(&line, "triangles", mesh.triangle_count);
  api_json_member_integer(&line, "input_triangles", input);
  api_json_member_integer(&line, "largest_input", largest);
  api_json_member_number(&line, "by_largest", (double)mesh.triangle_count / (double)largest);
  api_json_member_integer(&line, "threads", orb_threads(ctx));
  api_json_member_integer(&line, "repeat", repeat);
  api_json_key(&line, "seconds");
  api_json_open(&line, '{');
  api_json_member_number(&line, "align", run->align);
  api_json_member_number(&line, "remesh", remeshed - start);
  api_json_member_number(&line, "remesh_cpu", remesh_cpu - cpu);
  api_json_member_number(&line, "transfer", measured - written);
  api_json_member_number(&line, "write", written - remeshed);
  api_json_close(&line, '}');
  api_json_member_integer(&line, "peak_rss_bytes", bench_peak());
  api_json_key(&line, "shapes");
  api_json_open(&line, '[');
  for (int32_t s = 0; fine && s < run->count; s++) {
    fine = write_shape(ctx, &line, run, &mesh, s, &report[s]);
  }
  api_json_close(&line, ']');
  api_json_close(&line, '}');
  if (fine) {
    fine = bench_print(&line) && (!run->options->out || bench_spill(run->options->out, asset.data, asset.size));
  } else {
    bench_complain("remesh", ctx);
    api_text_free(&line);
  }
  orb_buffer_free(ctx, &asset);
  orb_supermesh_free(ctx, &mesh);
  return fine;
}

int bench_remesh(const bench_options *options) {
  remesh_run *run = calloc(1, sizeof *run);
  if (!run) {
    return BENCH_REFUSED;
  }
  run->options = options;
  orb_context *ctx = bench_open(options->threads, options->cpu);
  int fine = options->bodies ? make_bodies(ctx, run) : (options->keep && keep_io(ctx, run, 0)) || align_files(ctx, run);
  for (int repeat = 0; fine && repeat < options->repeat; repeat++) {
    bench_reset_peak();
    fine = run_once(ctx, run, repeat);
  }
  for (int32_t s = 0; s < API_SHAPES_MAX; s++) {
    orb_mesh_free(ctx, &run->shape[s].mesh);
    orb_free(ctx, run->shape[s].points);
    orb_free(ctx, run->shape[s].parent);
    orb_free(ctx, run->shape[s].landmark_vertices);
  }
  orb_context_destroy(ctx);
  free(run);
  return fine ? BENCH_DONE : BENCH_REFUSED;
}
