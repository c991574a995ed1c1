/* Random landmarks. Set i chooses two of the meshes and the same number of places on each (at random vertices, inside
 * triangles and on edges), matches them in random order and pins them. A set depends only on the seed and its number.
 * Every result is checked: the certificate, T = 2V − 4, and landmarks at bit-equal points; a refusal must name its
 * landmarks. An awkward set has eight landmarks. The sets cycle through four kinds of first landmarks:
 *
 * - two on adjacent vertices of one shape;
 * - two on adjacent vertices of both shapes;
 * - three inside one triangle of one shape and on one edge of the other;
 * - two at one place of one shape only. This is a contradiction: the right answer is a refusal that names both. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/json.h"
#include "bench.h"

enum { SIZES_MAX = 16, LANDMARKS_MAX = 1024, AWKWARD = 8, CONTRADICTION = 3 };

typedef struct landmark_set {
  long number;
  int pair[2], count, contradicts;
  orb_place places[LANDMARKS_MAX][2];
  orb_landmark landmarks[LANDMARKS_MAX];
} landmark_set;

/* The outcome of one set. */
typedef struct outcome {
  orb_status status;
  char detail[512];
  int named, right;
  double seconds, cpu, growth[2];
  int merged;
  int64_t triangles;
  double bound, merge_seconds;
} outcome;

/* splitmix64 */
static uint64_t next_random(uint64_t *state) {
  uint64_t z = *state += 0x9e3779b97f4a7c15u;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
  return z ^ (z >> 31);
}

static int32_t random_below(uint64_t *state, int32_t n) {
  return (int32_t)(next_random(state) % (uint64_t)n);
}

static double random_share(uint64_t *state) {
  return 0.05 + 0.9 * (double)(next_random(state) >> 11) / 9007199254740992.0;
}

/* Three of five places are vertices, one is on an edge, one inside a triangle. */
static orb_place random_place(const orb_mesh *mesh, uint64_t *state) {
  orb_place place = {random_below(state, mesh->triangle_count), {0, 0, 0}};
  int kind = random_below(state, 5), corner = random_below(state, 3);
  if (kind < 3) {
    place.at[corner] = 1;
  } else {
    double t = random_share(state), u = kind == 3 ? 0 : random_share(state);
    place.at[corner] = (1 - u) * (1 - t);
    place.at[(corner + 1) % 3] = (1 - u) * t;
    place.at[(corner + 2) % 3] = u;
  }
  return place;
}

static void make_place(const orb_mesh *mesh, landmark_set *set, int s, uint64_t *state) {
  for (int k = 0; k < set->count; k++) {
    double x[3], y[3];
    int again;
    do {
      again = 0;
      set->places[k][s] = random_place(mesh, state);
      orb_place_position(mesh, &set->places[k][s], x);
      for (int j = 0; j < k && !again; j++) {
        orb_place_position(mesh, &set->places[j][s], y);
        again = memcmp(x, y, sizeof x) == 0;
      }
    } while (again);
  }
}

static void put_vertex(orb_place *place, int32_t triangle, int corner) {
  *place = (orb_place){triangle, {0, 0, 0}};
  place->at[corner] = 1;
}

static void make_awkward(const bench_fleet *fleet, landmark_set *set, uint64_t *state) {
  int32_t triangle[2];
  for (int s = 0; s < 2; s++) {
    triangle[s] = random_below(state, fleet->mesh[set->pair[s]].mesh.triangle_count);
  }
  int kind = (int)(set->number % 4);
  set->contradicts = kind == CONTRADICTION;
  for (int k = 0; k < 3; k++) {
    orb_place *at = set->places[k];
    double t = 0.25 * (k + 1), corner = 0.2 + 0.2 * k;
    if (kind == 2) {
      at[0] = (orb_place){triangle[0], {corner, 0.7 - corner, 0.3}};
      at[1] = (orb_place){triangle[1], {1 - t, t, 0}};
    } else if (kind < 2 && k < 2) {
      put_vertex(&at[0], triangle[0], k);
      if (kind == 1) {
        put_vertex(&at[1], triangle[1], k);
      }
    }
  }
  if (set->contradicts) {
    set->places[1][0] = set->places[0][0];
  }
}

static void make_set(const bench_fleet *fleet, uint64_t seed, const int *sizes, int size_count, int awkward,
                     landmark_set *set) {
  uint64_t state = seed * 0x2545f4914f6cdd1du + (uint64_t)set->number;
  set->count = sizes[set->number % size_count];
  set->pair[0] = random_below(&state, fleet->count);
  set->pair[1] = (set->pair[0] + 1 + random_below(&state, fleet->count - 1)) % fleet->count;
  memset(set->landmarks, 0, sizeof set->landmarks);
  for (int s = 0; s < 2; s++) {
    const orb_mesh *mesh = &fleet->mesh[set->pair[s]].mesh;
    set->count = set->count < mesh->vertex_count / 2 ? set->count : mesh->vertex_count / 2;
  }
  for (int s = 0; s < 2; s++) {
    make_place(&fleet->mesh[set->pair[s]].mesh, set, s, &state);
  }
  set->contradicts = 0;
  if (awkward) {
    make_awkward(fleet, set, &state);
  }
  for (int k = 0; k < set->count; k++) {
    set->landmarks[k].at = set->places[k];
    set->landmarks[k].confidence = 1;
  }
}

static int is_right(orb_context *ctx, const orb_alignment *a) {
  for (int32_t s = 0; s < a->shape_count; s++) {
    const orb_aligned_shape *shape = &a->shapes[s];
    orb_certificate c;
    if (orb_certify(ctx, shape->points, shape->mesh.vertex_count, shape->mesh.triangles, shape->mesh.triangle_count,
                    &c) != ORB_OK ||
        !c.valid || shape->mesh.triangle_count != 2 * shape->mesh.vertex_count - 4) {
      return 0;
    }
    for (int32_t k = 0; k < a->landmark_count; k++) {
      if (memcmp(shape->points + 3 * (size_t)shape->landmark_vertices[k],
                 a->shapes[0].points + 3 * (size_t)a->shapes[0].landmark_vertices[k], 3 * sizeof(double)) != 0) {
        return 0;
      }
    }
  }
  return 1;
}

static void note_failure(orb_context *ctx, orb_status status, outcome *out) {
  const orb_error *error = orb_context_error(ctx);
  out->status = status;
  out->named = error->landmark_count;
  snprintf(out->detail, sizeof out->detail, "%s", error->detail);
}

/* Remeshes the aligned shapes of every merge_every-th set. */
static void remesh(orb_context *ctx, const bench_options *options, const orb_alignment *a, outcome *out) {
  orb_supermesh super;
  double start = orb_clock();
  orb_status status = orb_remesh(ctx, a->shapes, a->shape_count, a->landmark_count, &options->merge.remesh, &super);
  if (status != ORB_OK) {
    note_failure(ctx, status, out);
    return;
  }
  out->merged = 1;
  out->merge_seconds = orb_clock() - start;
  out->triangles = super.triangle_count;
  for (int32_t s = 0; s < a->shape_count; s++) {
    orb_extent extent;
    orb_mesh_extent(&a->shapes[s].mesh, &extent);
    double bound = super.error_bound[s] / extent.diagonal;
    out->bound = s && out->bound >= bound ? out->bound : bound;
  }
  out->right = out->right && super.flipped == 0 && super.degree == 1;
  orb_supermesh_free(ctx, &super);
}

static void run_set(const bench_options *options, const bench_fleet *fleet, const landmark_set *set, outcome *out) {
  orb_context *ctx = bench_open_limited(options);
  orb_align_options align = options->merge.align;
  orb_align_shape shapes[2];
  orb_alignment alignment;
  memset(out, 0, sizeof *out);
  for (int s = 0; s < 2; s++) {
    shapes[s] = (orb_align_shape){&fleet->mesh[set->pair[s]].mesh, fleet->embedding[set->pair[s]].points};
  }
  double start = orb_clock(), cpu = bench_cpu();
  orb_status status = orb_align(ctx, shapes, 2, set->landmarks, set->count, &align, &alignment);
  out->seconds = orb_clock() - start;
  out->cpu = bench_cpu() - cpu;
  if (status == ORB_OK) {
    out->right = is_right(ctx, &alignment);
    for (int s = 0; s < 2; s++) {
      out->growth[s] = (double)alignment.shapes[s].mesh.triangle_count / shapes[s].mesh->triangle_count;
    }
    if (options->merge_every > 0 && set->number % options->merge_every == 0) {
      remesh(ctx, options, &alignment, out);
    }
    orb_alignment_free(ctx, &alignment);
  } else {
    note_failure(ctx, status, out);
    const int32_t *named = orb_context_error(ctx)->landmarks;
    out->right = set->contradicts && out->named == 2 && named[0] == 0 && named[1] == 1;
  }
  orb_context_destroy(ctx);
}

static int print_line(const bench_fleet *fleet, const landmark_set *set, const outcome *o) {
  api_text line = {0};
  api_json_open(&line, '{');
  api_json_member_integer(&line, "set", set->number);
  api_json_key(&line, "shapes");
  api_json_open(&line, '[');
  for (int s = 0; s < 2; s++) {
    api_json_string(&line, fleet->mesh[set->pair[s]].name);
  }
  api_json_close(&line, ']');
  api_json_member_integer(&line, "landmarks", set->count);
  api_json_member_bool(&line, "contradicts", set->contradicts);
  api_json_member_string(&line, "status", orb_status_name(o->status));
  api_json_member_string(&line, "detail", o->detail);
  api_json_member_integer(&line, "named", o->named);
  api_json_member_bool(&line, "right", o->right);
  api_json_key(&line, "growth");
  api_json_open(&line, '[');
  api_json_number(&line, o->growth[0]);
  api_json_number(&line, o->growth[1]);
  api_json_close(&line, ']');
  api_json_member_number(&line, "seconds", o->seconds);
  api_json_member_number(&line, "cpu_seconds", o->cpu);
  if (o->merged) {
    api_json_member_integer(&line, "triangles", o->triangles);
    api_json_member_number(&line, "bound_relative", o->bound);
    api_json_member_number(&line, "remesh_seconds", o->merge_seconds);
  }
  api_json_close(&line, '}');
  return bench_print(&line);
}

static int read_sizes(const char *text, int sizes[SIZES_MAX]) {
  int count = 0;
  for (const char *at = text; *at && count < SIZES_MAX; at += *at == ',') {
    char *end;
    long value = strtol(at, &end, 10);
    if (end == at || (*end && *end != ',') || value < 1 || value > LANDMARKS_MAX) {
      return 0;
    }
    sizes[count++] = (int)value;
    at = end;
  }
  return count;
}

int bench_landmarks(const bench_options *options) {
  int sizes[SIZES_MAX] = {AWKWARD}, awkward = strcmp(options->sizes, "awkward") == 0;
  int size_count = awkward ? 1 : read_sizes(options->sizes, sizes);
  if (size_count == 0) {
    fprintf(stderr, "orbmorph-bench: --sizes must be 'awkward' or a list of numbers from 1 to %d, not '%s'\n",
            LANDMARKS_MAX, options->sizes);
    return BENCH_USAGE;
  }
  bench_fleet fleet;
  landmark_set *set = malloc(sizeof *set);
  int fine = set && bench_fleet_load(options, &fleet);
  for (long i = 0; fine && i < options->sets; i++) {
    outcome o;
    set->number = options->first + i;
    make_set(&fleet, options->seed, sizes, size_count, awkward, set);
    run_set(options, &fleet, set, &o);
    fine = print_line(&fleet, set, &o);
  }
  if (set) {
    bench_fleet_free(&fleet);
  }
  free(set);
  return fine ? BENCH_DONE : BENCH_REFUSED;
}
