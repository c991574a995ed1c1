/* Measures how accurate the map from one shape to the other is, for each alignment method.
 *
 * - dense: where both meshes have the same triangles, vertex i of one corresponds to vertex i of the other. The error
 *   of a vertex is the distance between its image and its counterpart, in % of the second shape's diagonal.
 * - held out: the same error at the landmarks that the alignment did not get.
 * - inverted: triangles that face the other way in space. For the map, these are the triangles of either shape whose
 *   image on the other faces away from that surface at its centre. For the supermesh, these are the triangles that face
 *   away from either surface there.
 * - halfway: how much of its area each patch of the surface keeps halfway through the linear morph, relative to the
 *   mean of both ends. A limb that the map twists by half a turn is thin there. Reports the smallest value of about 200
 *   patches and the share of the surface in patches that keep less than half. Shapes that face different ways lose area
 *   on straight paths whatever the map is, so `halfway_fitted` repeats the measurement after the second shape is moved
 *   onto the first (the asset's fit `rigid`).
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench.h"

typedef struct method {
  const char *name;
  orb_align_method method;
  orb_preset preset;
  int needs_landmarks;
} method;

static const method methods[] = {
    {"rotate", ORB_ALIGN_ROTATE, ORB_PRESET_DEFAULT, 0}, {"rbf", ORB_ALIGN_RBF, ORB_PRESET_DEFAULT, 1},
    {"fast", ORB_ALIGN_PIN, ORB_PRESET_FAST, 1},         {"default", ORB_ALIGN_PIN, ORB_PRESET_DEFAULT, 1},
    {"quality", ORB_ALIGN_PIN, ORB_PRESET_QUALITY, 1},   {"auto", ORB_ALIGN_AUTO, ORB_PRESET_DEFAULT, 0}};
enum { METHODS = sizeof methods / sizeof methods[0] };

typedef struct truth_run {
  orb_context *ctx;
  const bench_set *set;
  int32_t given;
  const orb_merge_result *result;
  orb_locator *locator[2];
  double diagonal; /* of the second shape */
} truth_run;

static int in_list(const char *list, const char *name) {
  size_t length = strlen(name);
  for (const char *at = list; at; at = strchr(at, ',')) {
    at += *at == ',';
    if (strncmp(at, name, length) == 0 && (at[length] == ',' || !at[length])) {
      return 1;
    }
  }
  return !list;
}

static int list_is_known(const char *list) {
  for (const char *at = list; at && *at;) {
    size_t length = strcspn(at, ","), k = 0;
    while (k < METHODS && (strlen(methods[k].name) != length || strncmp(at, methods[k].name, length) != 0)) {
      k++;
    }
    if (k == METHODS) {
      fprintf(stderr, "orbmorph-bench: --methods: there is no '%.*s'\n", (int)length, at);
      return 0;
    }
    at += length + (at[length] == ',');
  }
  return 1;
}

static void subtract(const double a[3], const double b[3], double out[3]) {
  for (int k = 0; k < 3; k++) {
    out[k] = a[k] - b[k];
  }
}

static double dot(const double a[3], const double b[3]) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void triangle_normal(const double *p, const double *q, const double *r, double out[3]) {
  double u[3], w[3];
  subtract(q, p, u);
  subtract(r, p, w);
  for (int k = 0; k < 3; k++) {
    out[k] = u[(k + 1) % 3] * w[(k + 2) % 3] - u[(k + 2) % 3] * w[(k + 1) % 3];
  }
}

static void sphere_point(const orb_aligned_shape *shape, const orb_place *place, double out[3]) {
  const int32_t *corner = shape->mesh.triangles + 3 * (size_t)place->triangle;
  for (int k = 0; k < 3; k++) {
    out[k] = 0;
    for (int i = 0; i < 3; i++) {
      out[k] += place->at[i] * shape->points[3 * (size_t)corner[i] + (size_t)k];
    }
  }
  double length = sqrt(dot(out, out));
  for (int k = 0; k < 3; k++) {
    out[k] /= length;
  }
}

/* The point of shape s in a direction of the common sphere. The normal (may be NULL) is that of the triangle there: a
 * normal smoothed over the vertices opposes the shape's own triangles where the shape is folded flat. */
static void surface_at(const truth_run *run, int s, const double p[3], double position[3], double *normal) {
  const orb_mesh *mesh = &run->result->alignment.shapes[s].mesh;
  orb_place place;
  orb_locate(run->locator[s], p, -1, &place);
  orb_place_position(mesh, &place, position);
  if (normal) {
    const int32_t *v = mesh->triangles + 3 * place.triangle;
    triangle_normal(mesh->positions + 3 * v[0], mesh->positions + 3 * v[1], mesh->positions + 3 * v[2], normal);
  }
}

static int by_value(const void *a, const void *b) {
  double x, y;
  memcpy(&x, a, sizeof x);
  memcpy(&y, b, sizeof y);
  return (x > y) - (x < y);
}

static void write_errors(api_text *line, const char *name, double *error, int32_t count) {
  double sum = 0;
  api_json_key(line, name);
  if (count == 0) {
    api_text_add(line, "null");
    return;
  }
  qsort(error, (size_t)count, sizeof *error, by_value);
  for (int32_t i = 0; i < count; i++) {
    sum += error[i];
  }
  api_json_open(line, '{');
  api_json_member_integer(line, "count", count);
  api_json_member_number(line, "mean", sum / count);
  api_json_member_number(line, "median", error[count / 2]);
  api_json_member_number(line, "p95", error[(int64_t)count * 95 / 100]);
  api_json_member_number(line, "max", error[count - 1]);
  api_json_close(line, '}');
}

static int same_connectivity(const bench_set *set) {
  const orb_mesh *a = &set->mesh[0].mesh, *b = &set->mesh[1].mesh;
  return a->vertex_count == b->vertex_count && a->triangle_count == b->triangle_count &&
         memcmp(a->triangles, b->triangles, 3 * (size_t)a->triangle_count * sizeof *a->triangles) == 0;
}

/* Vertices of the given mesh keep their numbers in the aligned one. */
static int write_dense(truth_run *run, api_text *line) {
  const orb_mesh *target = &run->set->mesh[1].mesh;
  int32_t count = same_connectivity(run->set) ? target->vertex_count : 0;
  double *error = orb_alloc(run->ctx, (size_t)count + 1, sizeof *error);
  for (int32_t v = 0; v < count && error; v++) {
    double at[3], d[3];
    surface_at(run, 1, run->result->alignment.shapes[0].points + 3 * v, at, NULL);
    subtract(at, target->positions + 3 * v, d);
    error[v] = 100 * sqrt(dot(d, d)) / run->diagonal;
  }
  if (error) {
    write_errors(line, "dense_percent", error, count);
  }
  orb_free(run->ctx, error);
  return error != NULL;
}

/* The point on the sphere of a place on the given mesh: that of the nearest place of the aligned mesh, which has the
 * same surface. */
static int write_held_out(truth_run *run, api_text *line) {
  const bench_set *set = run->set;
  int32_t count = set->list.count - run->given;
  double *error = orb_alloc(run->ctx, (size_t)count + 1, sizeof *error);
  orb_nearest *tree = NULL;
  const orb_aligned_shape *source = &run->result->alignment.shapes[0];
  if (!error || orb_nearest_create(run->ctx, source->mesh.positions, source->mesh.triangles,
                                   source->mesh.triangle_count, &tree) != ORB_OK) {
    orb_free(run->ctx, error);
    return 0;
  }
  for (int32_t l = 0; l < count; l++) {
    const orb_place *at = set->landmarks[run->given + l].at;
    double from[3], p[3], to[3], wanted[3], d[3];
    orb_place place;
    orb_place_position(&set->mesh[0].mesh, &at[0], from);
    orb_place_position(&set->mesh[1].mesh, &at[1], wanted);
    (void)orb_nearest_query(tree, from, INFINITY, &place);
    sphere_point(source, &place, p);
    surface_at(run, 1, p, to, NULL);
    subtract(to, wanted, d);
    error[l] = 100 * sqrt(dot(d, d)) / run->diagonal;
  }
  api_json_key(line, "held_out");
  api_json_open(line, '[');
  for (int32_t l = 0; l < count; l++) {
    api_json_number(line, error[l]);
  }
  api_json_close(line, ']');
  write_errors(line, "held_out_percent", error, count);
  orb_nearest_destroy(run->ctx, tree);
  orb_free(run->ctx, error);
  return 1;
}

/* Counts triangles (corners p on the sphere, x in space) that face away from the normal of shape s at their centre. */
static int is_inverted(const truth_run *run, int s, const double *p[3], const double *x[3]) {
  double centre[3], n[3], at[3], normal[3];
  for (int k = 0; k < 3; k++) {
    centre[k] = p[0][k] + p[1][k] + p[2][k];
  }
  double length = sqrt(dot(centre, centre));
  for (int k = 0; k < 3; k++) {
    centre[k] /= length;
  }
  triangle_normal(x[0], x[1], x[2], n);
  surface_at(run, s, centre, at, normal);
  return dot(n, normal) < 0 && sqrt(dot(n, n)) > 1e-12 * run->diagonal * run->diagonal;
}

static double map_inverted(const truth_run *run, int from) {
  const orb_aligned_shape *shape = &run->result->alignment.shapes[from];
  int32_t count = 0;
  for (int32_t t = 0; t < shape->mesh.triangle_count; t++) {
    const double *p[3], *x[3];
    double image[9];
    for (int k = 0; k < 3; k++) {
      p[k] = shape->points + 3 * shape->mesh.triangles[3 * t + k];
      x[k] = image + 3 * k;
      surface_at(run, 1 - from, p[k], image + 3 * k, NULL);
    }
    count += is_inverted(run, 1 - from, p, x);
  }
  return (double)count / shape->mesh.triangle_count;
}

static double supermesh_inverted(const truth_run *run, int s) {
  const orb_supermesh *m = &run->result->supermesh;
  const orb_mesh *mesh = &run->result->alignment.shapes[s].mesh;
  int32_t count = 0;
  for (int32_t t = 0; t < m->triangle_count; t++) {
    const double *p[3], *x[3];
    double corner[9];
    for (int k = 0; k < 3; k++) {
      int32_t v = m->triangles[3 * t + k];
      p[k] = m->points + 3 * v;
      x[k] = corner + 3 * k;
      orb_place_position(mesh, &m->places[(int64_t)s * m->vertex_count + v], corner + 3 * k);
    }
    count += is_inverted(run, s, p, x);
  }
  return (double)count / m->triangle_count;
}

static void write_inverted(const truth_run *run, api_text *line) {
  api_json_key(line, "inverted_fraction");
  api_json_open(line, '{');
  api_json_member_number(line, "map", map_inverted(run, 0));
  api_json_member_number(line, "map_back", map_inverted(run, 1));
  api_json_member_number(line, "supermesh_first", supermesh_inverted(run, 0));
  api_json_member_number(line, "supermesh_second", supermesh_inverted(run, 1));
  api_json_member_number(line, "report", run->result->pairs[0].inverted_fraction);
  api_json_close(line, '}');
}

enum { PATCHES = 200 };

/* The patch of each vertex of the supermesh, at positions x: the nearest of the centres, which farthest-point sampling
 * spreads. far and nearest have room for all vertices. */
static void spread_patches(const orb_supermesh *m, const double *x, double *far, int32_t *nearest) {
  for (int32_t i = 0, last = 0; i < PATCHES; i++) {
    int32_t next = 0;
    for (int32_t v = 0; v < m->vertex_count; v++) {
      double d[3];
      subtract(x + 3 * v, x + 3 * last, d);
      if (i == 0 || dot(d, d) < far[v]) {
        far[v] = dot(d, d);
        nearest[v] = i;
      }
      next = far[v] > far[next] ? v : next;
    }
    last = next;
  }
}

static double corner_area(const double *x, const int32_t *v) {
  double n[3];
  triangle_normal(x + 3 * v[0], x + 3 * v[1], x + 3 * v[2], n);
  return 0.5 * sqrt(dot(n, n));
}

/* The position of a vertex on a shape that a matrix of orb_asset_transforms() moves. */
static void moved_place(const truth_run *run, int s, size_t v, const double *matrix, double out[3]) {
  const orb_supermesh *m = &run->result->supermesh;
  double p[3];
  orb_place_position(&run->result->alignment.shapes[s].mesh, &m->places[(size_t)s * (size_t)m->vertex_count + v], p);
  for (int k = 0; k < 3; k++) {
    out[k] = matrix[k] * p[0] + matrix[4 + k] * p[1] + matrix[8 + k] * p[2] + matrix[12 + k];
  }
}

static int write_halfway(const truth_run *run, const char *key, orb_fit fit, api_text *line) {
  const orb_supermesh *m = &run->result->supermesh;
  size_t n = (size_t)m->vertex_count;
  double *x = orb_alloc(run->ctx, 10 * n, sizeof *x), area[3][PATCHES] = {{0}}, least = 1, thin = 0, whole = 0,
         moves[32];
  int32_t *patch = orb_alloc(run->ctx, n, sizeof *patch);
  int fine = x && patch && orb_asset_transforms(run->ctx, m, run->result->alignment.shapes, fit, moves, NULL) == ORB_OK;
  for (size_t v = 0; fine && v < n; v++) {
    double *end[2] = {x + 3 * v, x + 3 * (n + v)}, *half = x + 3 * (2 * n + v);
    for (int s = 0; s < 2; s++) {
      moved_place(run, s, v, moves + 16 * s, end[s]);
    }
    for (int k = 0; k < 3; k++) {
      half[k] = 0.5 * (end[0][k] + end[1][k]);
    }
  }
  if (fine) {
    spread_patches(m, x, x + 9 * n, patch);
  }
  for (int32_t t = 0; t < m->triangle_count && fine; t++) {
    const int32_t *v = m->triangles + 3 * t;
    for (int k = 0; k < 3; k++) {
      area[k][patch[v[0]]] += corner_area(x + 3 * (size_t)k * n, v);
    }
  }
  for (int i = 0; i < PATCHES; i++) {
    double ends = 0.5 * (area[0][i] + area[1][i]), kept = ends > 0 ? area[2][i] / ends : 1;
    least = kept < least ? kept : least;
    thin += kept < 0.5 ? ends : 0;
    whole += ends;
  }
  if (fine) {
    api_json_key(line, key);
    api_json_open(line, '{');
    api_json_member_number(line, "least", least);
    api_json_member_number(line, "thin_fraction", thin / whole);
    api_json_close(line, '}');
  }
  orb_free(run->ctx, x);
  orb_free(run->ctx, patch);
  return fine;
}

/* The share of the area that each kind of warning is about; 0: there is none. */
static void write_warned(const orb_merge_result *result, api_text *line) {
  double share[2] = {0};
  for (int32_t i = 0; i < result->warning_count; i++) {
    const orb_warning *warning = &result->warnings[i];
    double *of = &share[warning->kind];
    *of = warning->share > *of ? warning->share : *of;
  }
  api_json_key(line, "warned");
  api_json_open(line, '{');
  api_json_member_number(line, "stretched", share[ORB_WARNING_STRETCHED]);
  api_json_member_number(line, "thin", share[ORB_WARNING_THIN]);
  api_json_close(line, '}');
}

/* The mean of the confidences of the found landmarks; null if the search did not run. */
static void write_confidence(const orb_alignment *alignment, api_text *line) {
  double sum = 0;
  for (int32_t i = 0; i < alignment->found_count; i++) {
    sum += alignment->confidence[i];
  }
  api_json_key(line, "confidence");
  if (alignment->found_count == 0) {
    api_text_add(line, "null");
  } else {
    api_json_number(line, sum / alignment->found_count);
  }
}

/* The figures by which the match of the shapes is judged; null if the search did not run. */
static void write_match(const orb_alignment *alignment, api_text *line) {
  api_json_key(line, "match");
  if (!alignment->match.is_measured) {
    api_text_add(line, "null");
    return;
  }
  api_json_open(line, '{');
  api_json_member_number(line, "bend", alignment->match.bend);
  api_json_member_number(line, "clear", alignment->match.clear);
  api_json_member_number(line, "lead", alignment->match.lead);
  api_json_member_bool(line, "part", alignment->match.is_part);
  api_json_member_number(line, "confidence", alignment->match.confidence);
  api_json_member_integer(line, "alternatives", alignment->alternative_count);
  api_json_close(line, '}');
}

static int write_measures(truth_run *run, api_text *line) {
  const orb_alignment *alignment = &run->result->alignment;
  int fine = 1;
  for (int s = 0; s < 2 && fine; s++) {
    const orb_aligned_shape *shape = &alignment->shapes[s];
    fine = orb_locator_create(run->ctx, shape->points, shape->mesh.vertex_count, shape->mesh.triangles,
                              shape->mesh.triangle_count, NULL, &run->locator[s]) == ORB_OK;
  }
  if (fine) {
    api_json_member_integer(line, "flipped",
                            alignment->shapes[0].certificate.flipped + alignment->shapes[1].certificate.flipped +
                                run->result->supermesh.flipped);
    api_json_member_number(line, "energy", alignment->energy);
    write_confidence(alignment, line);
    write_match(alignment, line);
    api_json_member_number(line, "distortion_median", run->result->pairs[0].distortion.symmetric_dirichlet.median);
    write_warned(run->result, line);
    write_inverted(run, line);
    fine = write_dense(run, line) && write_held_out(run, line) && write_halfway(run, "halfway", ORB_FIT_NONE, line) &&
           write_halfway(run, "halfway_fitted", ORB_FIT_RIGID, line);
  }
  for (int s = 0; s < 2; s++) {
    orb_locator_destroy(run->ctx, run->locator[s]);
  }
  return fine;
}

static int run_method(const bench_options *options, orb_context *ctx, const bench_set *set, const method *m) {
  int32_t given = options->given < 0 || options->given > set->list.count ? set->list.count : (int32_t)options->given;
  if (m->method == ORB_ALIGN_AUTO) {
    given = 0;
  }
  if (m->needs_landmarks && given == 0) {
    return 1;
  }
  orb_merge_options merge = options->merge;
  merge.align.method = m->method;
  merge.align.preset = m->preset;
  orb_merge_result result;
  double cpu = bench_cpu();
  if (orb_merge(ctx, set->shape, set->name, 2, set->landmarks, given, &merge, &result) != ORB_OK) {
    bench_complain(m->name, ctx);
    return 0;
  }
  cpu = bench_cpu() - cpu;
  orb_extent extent;
  orb_mesh_extent(&set->mesh[1].mesh, &extent);
  double across[3];
  subtract(extent.max, extent.min, across);
  truth_run run = {.ctx = ctx, .set = set, .given = given, .result = &result, .diagonal = sqrt(dot(across, across))};
  api_text line = {0};
  api_json_open(&line, '{');
  api_json_member_string(&line, "first", set->name[0]);
  api_json_member_string(&line, "second", set->name[1]);
  api_json_member_string(&line, "method", m->name);
  api_json_member_integer(&line, "given", given);
  api_json_member_integer(&line, "triangles", result.supermesh.triangle_count);
  api_json_member_number(&line, "align_seconds", result.timings.align);
  api_json_member_number(&line, "total_seconds", result.timings.total);
  api_json_member_number(&line, "cpu_seconds", cpu);
  int fine = write_measures(&run, &line);
  api_json_close(&line, '}');
  fine = bench_print(&line) && fine;
  orb_merge_result_free(ctx, &result);
  return fine;
}

int bench_truth(const bench_options *options) {
  if (!list_is_known(options->methods)) {
    return BENCH_USAGE;
  }
  bench_set *set = calloc(1, sizeof *set);
  if (!set) {
    return BENCH_REFUSED;
  }
  orb_context *ctx = bench_open(options->threads, options->cpu);
  set->count = options->file_count;
  int loaded = bench_set_load(ctx, options, set), fine = loaded;
  for (int m = 0; m < METHODS && loaded; m++) {
    if (in_list(options->methods, methods[m].name)) {
      fine &= run_method(options, ctx, set, &methods[m]);
    }
  }
  bench_set_free(ctx, set);
  orb_context_destroy(ctx);
  free(set);
  return fine ? BENCH_DONE : BENCH_REFUSED;
}
