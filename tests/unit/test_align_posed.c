/* Bodies in two poses, with landmarks and without, against true places: of real scans, if their folder exists, and of
 * generated animals. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "../samples/posed.h"
#include "align/find/hint.h"
#include "align/map/engine/params.h"
#include "numeric/vec3.h"
#include "orbmorph/align.h"
#include "orbmorph/format.h"
#include "orbmorph/locate.h"
#include "support_align.h"
#include "support_shared.h"

enum { TRUE_PLACES = 400, GIVEN = 24, FEW = 8, FEWER = 5, ONE = 1 };

typedef struct body {
  orb_mesh mesh;
  orb_embedding embedding;
  orb_place truth[TRUE_PLACES];
  int count; /* of true places */
} body;

static void embed(orb_context *ctx, body *out) {
  orb_embed_options options;
  orb_embed_defaults(&options);
  assert_int_equal(orb_embed(ctx, &out->mesh, &options, &out->embedding), ORB_OK);
}

/* Reads a body and its true places: rows of sample, triangle, b0, b1, b2, …. Returns 0 if the folder is missing. */
static int load(orb_context *ctx, const char *file, const char *truth, body *out) {
  size_t size;
  unsigned char *bytes = shared_bytes("posed", file, &size);
  char *text = (char *)shared_bytes("posed", truth, &size), *line = text;
  if (!bytes || !text) {
    free(bytes);
    free(text);
    return 0;
  }
  for (int i = 0; i < TRUE_PLACES; i++) {
    int sample, triangle;
    orb_place *p = &out->truth[i];
    line = strchr(line, '\n') + 1;
    assert_int_equal(sscanf(line, "%d,%d,%lf,%lf,%lf", &sample, &triangle, &p->at[0], &p->at[1], &p->at[2]), 5);
    assert_int_equal(sample, i);
    p->triangle = triangle;
  }
  free(text);
  free(bytes);
  bytes = shared_bytes("posed", file, &size);
  assert_int_equal(orb_mesh_read(ctx, bytes, size, ORB_FORMAT_AUTO, &out->mesh, NULL), ORB_OK);
  free(bytes);
  out->count = TRUE_PLACES;
  embed(ctx, out);
  return 1;
}

static orb_context *load_or_skip(const char *const file[2], const char *const truth[2], body bodies[2]) {
  orb_context *ctx;
  assert_int_equal(orb_context_create(NULL, &ctx), ORB_OK);
  memset(bodies, 0, 2 * sizeof *bodies);
  for (int s = 0; s < 2; s++) {
    if (!load(ctx, file[s], truth[s], &bodies[s])) {
      orb_context_destroy(ctx);
      print_message("The folder of posed meshes is not there.\n");
      skip();
    }
  }
  return ctx;
}

static void unload(orb_context *ctx, body bodies[2]) {
  for (int s = 0; s < 2; s++) {
    orb_mesh_free(ctx, &bodies[s].mesh);
    orb_embedding_free(ctx, &bodies[s].embedding);
  }
  orb_context_destroy(ctx);
}

/* The mean distance between the images of the places from number `first` on and their true places, in diagonals. */
static double mean_error(orb_context *ctx, const body bodies[2], int first, const orb_alignment *a) {
  const orb_mesh *mesh[2] = {&a->shapes[0].mesh, &a->shapes[1].mesh};
  orb_nearest *tree;
  orb_locator *locator;
  orb_extent extent;
  double sum = 0;
  orb_mesh_extent(mesh[1], &extent);
  assert_int_equal(orb_nearest_create(ctx, mesh[0]->positions, mesh[0]->triangles, mesh[0]->triangle_count, &tree),
                   ORB_OK);
  assert_int_equal(orb_locator_create(ctx, a->shapes[1].points, mesh[1]->vertex_count, mesh[1]->triangles,
                                      mesh[1]->triangle_count, NULL, &locator),
                   ORB_OK);
  for (int i = first; i < bodies[0].count; i++) {
    orb_place place;
    double x[3], y[3], on_sphere[3] = {0};
    orb_place_position(&bodies[0].mesh, &bodies[0].truth[i], x);
    (void)orb_nearest_query(tree, x, INFINITY, &place);
    for (int k = 0; k < 9; k++) {
      const int32_t v = mesh[0]->triangles[3 * (size_t)place.triangle + (size_t)(k / 3)];
      on_sphere[k % 3] += place.at[k / 3] * a->shapes[0].points[3 * (size_t)v + (size_t)(k % 3)];
    }
    (void)orb_normalize(on_sphere);
    orb_locate(locator, on_sphere, -1, &place);
    orb_place_position(mesh[1], &place, x);
    orb_place_position(&bodies[1].mesh, &bodies[1].truth[i], y);
    sum += sqrt(orb_distance2(x, y));
  }
  orb_nearest_destroy(ctx, tree);
  orb_locator_destroy(ctx, locator);
  return sum / (bodies[0].count - first) / extent.diagonal;
}

/* The landmarks are exact and at their true places, and the shapes are two people who sit: the map is nearly an
 * isometry. If the shapes were pinned on their spheres, the map stayed at an energy of 3.5; if all landmarks were moved
 * to their partners at once, at 1.5. */
static void many_true_landmarks_do_not_spoil_a_pose(void **state) {
  (void)state;
  body bodies[2];
  orb_context *ctx = load_or_skip((const char *const[2]){"cora-sit.obj", "ada-sit.obj"},
                                  (const char *const[2]){"cora-sit.truth.csv", "ada-sit.truth.csv"}, bodies);
  orb_place at[GIVEN][2];
  orb_landmark landmarks[GIVEN];
  memset(landmarks, 0, sizeof landmarks);
  for (int i = 0; i < GIVEN; i++) {
    at[i][0] = bodies[0].truth[i];
    at[i][1] = bodies[1].truth[i];
    landmarks[i].at = at[i];
  }
  const orb_align_shape shapes[2] = {{&bodies[0].mesh, bodies[0].embedding.points},
                                     {&bodies[1].mesh, bodies[1].embedding.points}};
  orb_align_options options;
  orb_alignment out;
  orb_align_defaults(&options);
  options.preset = ORB_PRESET_DEFAULT;
  align_and_check(ctx, shapes, 2, landmarks, GIVEN, &options, &out);
  assert_true(out.energy <= 1.3);
  assert_true(mean_error(ctx, bodies, GIVEN, &out) <= 0.012);
  orb_alignment_free(ctx, &out);
  unload(ctx, bodies);
}

/* A generated body in a pose, with its own triangles. place: of each sample; triangle −1: the body lacks it. */
static void generate(orb_context *ctx, const char *kind, const char *build, const char *pose, unsigned seed, body *out,
                     posed_place *place) {
  posed_rest rest;
  orb_sample sample;
  posed_proportion(posed_find(kind), build, &rest);
  posed_polygonise(&rest, seed, &sample);
  posed_find_places(&rest, &sample, place);
  posed_skin(&rest, pose, &sample);
  const orb_mesh mesh = {.vertex_count = sample.vertex_count,
                         .triangle_count = sample.triangle_count,
                         .positions = sample.positions,
                         .triangles = (int32_t *)sample.triangles};
  memset(out, 0, sizeof *out);
  assert_int_equal(orb_mesh_copy(ctx, &mesh, &out->mesh), ORB_OK);
  free(sample.positions);
  free(sample.triangles);
  embed(ctx, out);
}

/* The samples that both bodies have, in their order. */
static void keep_common(const posed_place *place[2], int samples, body bodies[2]) {
  bodies[0].count = bodies[1].count = 0;
  for (int i = 0; i < samples && bodies[0].count < TRUE_PLACES; i++) {
    if (place[0][i].triangle >= 0 && place[1][i].triangle >= 0) {
      for (int s = 0; s < 2; s++) {
        orb_place *one = &bodies[s].truth[bodies[s].count++];
        one->triangle = place[s][i].triangle;
        memcpy(one->at, place[s][i].at, sizeof one->at);
      }
    }
  }
}

/* What names a generated body. build: "", or how its proportions differ. */
typedef struct named_body {
  const char *kind, *build, *pose;
} named_body;

/* Which of the two alignments a test needs. */
enum { WITHOUT = 1, WITH = 2, BOTH = 3 };

/* The mean errors between two bodies, relative to the diagonal: without landmarks, and with the first true places,
 * FEW at most. seed: of the triangles of the first; the second has the next one. Returns the energy of the last
 * alignment. An error that is not measured is INFINITY. */
static double errors_of_seed(const named_body of[2], unsigned seed, int few, int needed, double error[2]) {
  double energy = 0;
  const int samples = posed_sample_count();
  posed_place *place[2];
  body bodies[2];
  orb_context *ctx;
  assert_int_equal(orb_context_create(NULL, &ctx), ORB_OK);
  for (int s = 0; s < 2; s++) {
    place[s] = calloc((size_t)samples, sizeof **place);
    assert_non_null(place[s]);
    generate(ctx, of[s].kind, of[s].build, of[s].pose, seed + (unsigned)s, &bodies[s], place[s]);
  }
  keep_common((const posed_place *[2]){place[0], place[1]}, samples, bodies);
  assert_true(bodies[0].count > 100 && few <= FEW);
  orb_place at[FEW][2];
  orb_landmark landmarks[FEW];
  memset(landmarks, 0, sizeof landmarks);
  for (int i = 0; i < few; i++) {
    at[i][0] = bodies[0].truth[i];
    at[i][1] = bodies[1].truth[i];
    landmarks[i].at = at[i];
  }
  const orb_align_shape shapes[2] = {{&bodies[0].mesh, bodies[0].embedding.points},
                                     {&bodies[1].mesh, bodies[1].embedding.points}};
  for (int given = 0; given < 2; given++) {
    error[given] = INFINITY;
    if (!(needed & (given ? WITH : WITHOUT))) {
      continue;
    }
    orb_align_options options;
    orb_alignment out;
    orb_align_defaults(&options);
    options.preset = ORB_PRESET_DEFAULT;
    options.method = given ? ORB_ALIGN_PIN : ORB_ALIGN_AUTO;
    if (given) {
      align_and_check(ctx, shapes, 2, landmarks, few, &options, &out);
    } else {
      assert_int_equal(orb_align(ctx, shapes, 2, NULL, 0, &options, &out), ORB_OK);
    }
    error[given] = mean_error(ctx, bodies, few, &out);
    energy = out.energy;
    orb_alignment_free(ctx, &out);
  }
  print_message("%s and %s: error without landmarks %.4f, with %d of them %.4f (inf: not measured)\n", of[0].kind,
                of[1].kind, error[0], few, error[1]);
  free(place[0]);
  free(place[1]);
  unload(ctx, bodies);
  return energy;
}

static double errors_of(const named_body of[2], int few, int needed, double error[2]) {
  return errors_of_seed(of, 1, few, needed, error);
}

typedef struct edge {
  int32_t low, high, corner; /* corner: 3 · triangle + k, opposite to which it lies */
} edge;

static int by_ends(const void *a, const void *b) {
  const edge *x = a, *y = b;
  return x->low != y->low ? (x->low > y->low) - (x->low < y->low) : (x->high > y->high) - (x->high < y->high);
}

/* Cuts each triangle into four at the middles of its edges, so that the surface stays the same. */
static void refine(orb_context *ctx, body *b) {
  const orb_mesh old = b->mesh;
  const size_t corners = 3 * (size_t)old.triangle_count, vertices = (size_t)old.vertex_count + corners / 2;
  edge *edges = calloc(corners, sizeof *edges);
  int32_t *middle = calloc(corners, sizeof *middle), *triangles = calloc(4 * corners, sizeof *triangles);
  double *positions = calloc(3 * vertices, sizeof *positions);
  assert_true(edges && middle && triangles && positions);
  for (size_t i = 0; i < corners; i++) {
    const int32_t *v = old.triangles + i / 3 * 3, from = v[(i + 1) % 3], to = v[(i + 2) % 3];
    edges[i] = (edge){from < to ? from : to, from < to ? to : from, (int32_t)i};
  }
  qsort(edges, corners, sizeof *edges, by_ends);
  memcpy(positions, old.positions, 3 * (size_t)old.vertex_count * sizeof *positions);
  for (size_t i = 0; i < corners; i++) {
    middle[edges[i].corner] = old.vertex_count + (int32_t)(i / 2); /* each edge is there twice */
    for (size_t k = 0; k < 3; k++) {
      positions[3 * ((size_t)old.vertex_count + i / 2) + k] =
          (old.positions[3 * (size_t)edges[i].low + k] + old.positions[3 * (size_t)edges[i].high + k]) / 2;
    }
  }
  for (size_t t = 0; t < (size_t)old.triangle_count; t++) {
    const int32_t *v = old.triangles + 3 * t, *m = middle + 3 * t;
    const int32_t four[12] = {v[0], m[2], m[1], v[1], m[0], m[2], v[2], m[1], m[0], m[0], m[1], m[2]};
    memcpy(triangles + 12 * t, four, sizeof four);
  }
  const orb_mesh fine = {.vertex_count = (int32_t)vertices,
                         .triangle_count = 4 * old.triangle_count,
                         .positions = positions,
                         .triangles = triangles};
  orb_mesh_free(ctx, &b->mesh);
  orb_embedding_free(ctx, &b->embedding);
  assert_int_equal(orb_mesh_copy(ctx, &fine, &b->mesh), ORB_OK);
  free(edges);
  free(middle);
  free(triangles);
  free(positions);
  embed(ctx, b);
}

/* The match of a stout cow that runs and a giraffe that sits. is_fine: each triangle of the giraffe is four. */
static orb_match_facts match_of_cow_and_giraffe(int is_fine) {
  posed_place *place = calloc((size_t)posed_sample_count(), sizeof *place);
  orb_align_options options;
  orb_alignment out;
  body bodies[2];
  orb_context *ctx;
  assert_non_null(place);
  assert_int_equal(orb_context_create(NULL, &ctx), ORB_OK);
  generate(ctx, "cow", "stout", "run", 1, &bodies[0], place);
  generate(ctx, "giraffe", "", "sit", 2, &bodies[1], place);
  if (is_fine) {
    refine(ctx, &bodies[1]);
  }
  const int32_t large = orb_map_params_of(ORB_PRESET_DEFAULT).copies.large;
  assert_true(bodies[1].mesh.vertex_count > large ? is_fine : !is_fine);
  const orb_align_shape shapes[2] = {{&bodies[0].mesh, bodies[0].embedding.points},
                                     {&bodies[1].mesh, bodies[1].embedding.points}};
  orb_align_defaults(&options);
  options.preset = ORB_PRESET_DEFAULT;
  options.method = ORB_ALIGN_AUTO;
  assert_int_equal(orb_align(ctx, shapes, 2, NULL, 0, &options, &out), ORB_OK);
  const orb_match_facts match = out.match;
  print_message("%d vertices: energy %.3f, confidence %.2f\n", bodies[1].mesh.vertex_count, out.energy,
                match.confidence);
  orb_alignment_free(ctx, &out);
  free(place);
  unload(ctx, bodies);
  return match;
}

/* More triangles on the same surface leave a match as sure as it was. A copy stands for the giraffe then. The cow moves
 * onto it, and has half of the energy that the triangles of the whole giraffe have afterwards. */
static void finer_triangles_are_as_sure(void **state) {
  (void)state;
  if (IS_SLOW) {
    skip(); /* test_align_large runs the same code */
  }
  const orb_match_facts coarse = match_of_cow_and_giraffe(0), fine = match_of_cow_and_giraffe(1);
  assert_true(coarse.is_measured && fine.is_measured);
  assert_true(fabs(coarse.confidence - fine.confidence) <= 0.2);
}

/* A giraffe stands and runs. A walk with these landmarks has 1.6 times the error of the match without any. */
static void few_true_landmarks_do_not_spoil_a_match(void **state) {
  (void)state;
  if (IS_SLOW) {
    skip(); /* the people with many landmarks run the same code */
  }
  double error[2];
  (void)errors_of((named_body[2]){{"giraffe", "", "stand"}, {"giraffe", "", "run"}}, FEW, BOTH, error);
  assert_true(error[0] <= 0.008);
  assert_true(error[1] <= 1.05 * error[0]);
}

/* A person walks, and turns. The given spheres of the two correspond well, so the map without landmarks begins on them.
 * If it did not slide then, its error would be 0.0071. */
static void maps_on_the_given_spheres_slide(void **state) {
  (void)state;
  if (IS_SLOW) {
    skip(); /* the crowds of test_align_many begin on their given spheres too */
  }
  double error[2];
  (void)errors_of((named_body[2]){{"person", "", "walk"}, {"person", "", "turn"}}, FEW, BOTH, error);
  assert_true(error[0] <= 0.006);
  assert_true(error[1] <= 0.006);
}

/* A bust has a chest, which a head lacks, so a map of least energy spreads the head over it: its error would be 0.065.
 */
static void landmarks_on_a_part_place_that_part(void **state) {
  (void)state;
  if (IS_SLOW) {
    skip(); /* test_align_inset runs the same code */
  }
  double error[2];
  (void)errors_of((named_body[2]){{"head", "", "stand"}, {"bust", "", "stand"}}, FEW, WITH, error);
  assert_true(error[1] <= 0.035);
  (void)errors_of((named_body[2]){{"bust", "", "look"}, {"head", "", "nod"}}, FEW, WITH, error);
  assert_true(error[1] <= 0.055);
}

/* An elephant has a trunk and thick limbs. Landmarks alone lead to a map of energy 2.3; with a match between them,
 * either shape may move, and the map is as good as without landmarks. */
static void landmarks_of_other_kinds_use_a_match(void **state) {
  (void)state;
  if (IS_SLOW) {
    skip(); /* the contest of creatures runs the same code */
  }
  double error[2];
  const double energy = errors_of((named_body[2]){{"person", "", "walk"}, {"elephant", "", "stand"}}, FEW, BOTH, error);
  assert_true(energy <= 1.8);
  assert_true(error[1] <= error[0]);
}

/* Five landmarks, the snout and the feet, leave the bodies of a dog and an elephant open. They alone lead to an error
 * of 0.043, with an energy that right maps may have. */
static void few_landmarks_of_other_kinds_use_a_match(void **state) {
  (void)state;
  if (IS_SLOW) {
    skip(); /* the contest of creatures runs the same code */
  }
  double error[2];
  (void)errors_of((named_body[2]){{"dog", "", "walk"}, {"elephant", "", "stand"}}, FEWER, WITH, error);
  assert_true(error[1] <= 0.035);
}

/* By the distances between five landmarks, an elephant that grazes seems to be a part of a giraffe that runs. But not
 * much of it fits there, and a map that is drawn there has an energy of 4. */
static void other_kinds_are_no_parts(void **state) {
  (void)state;
  if (IS_SLOW) {
    skip(); /* the contest of creatures runs the same code */
  }
  double error[2];
  const double energy =
      errors_of((named_body[2]){{"elephant", "slim", "graze"}, {"giraffe", "", "run"}}, FEWER, WITH, error);
  assert_true(energy <= 2);
  assert_true(error[1] <= 0.06);
}

/* One landmark says neither where other limbs go nor whether the shapes are alike. Without a match it leads to an error
 * of 0.1. */
static void one_landmark_keeps_the_match(void **state) {
  (void)state;
  if (IS_SLOW) {
    skip(); /* the contest of creatures runs the same code */
  }
  double error[2];
  (void)errors_of((named_body[2]){{"cow", "", "run"}, {"horse", "", "turn"}}, ONE, WITH, error);
  assert_true(error[1] <= 0.02);
}

/* Five landmarks along the middle of a spider, of its tail, palps and back, say nothing of its legs. While nothing
 * improved matches that agree with landmarks, the legs of three of thirteen spiders went to other legs; with this seed
 * the error was 0.09. */
static void landmarks_in_the_middle_leave_legs_open(void **state) {
  (void)state;
  if (IS_SLOW) {
    skip(); /* matches without landmarks run the same code */
  }
  double error[2];
  const double energy =
      errors_of_seed((named_body[2]){{"spider", "", "creep"}, {"spider", "", "rear"}}, 7, FEWER, BOTH, error);
  assert_true(energy <= 1.2);
  assert_true(error[0] <= 0.015);
  assert_true(error[1] <= 0.015);
}

/* Eight landmarks, of which two are on legs, leave the other legs open, though they show one body. While nothing
 * improved matches that agree with so many, the energy was 2.3 with this seed. */
static void eight_landmarks_leave_legs_open(void **state) {
  (void)state;
  if (IS_SLOW) {
    skip(); /* matches without landmarks run the same code */
  }
  double error[2];
  const double energy =
      errors_of_seed((named_body[2]){{"spider", "slim", "stand"}, {"spider", "stout", "creep"}}, 12, FEW, WITH, error);
  assert_true(energy <= 1.3);
}

/* Eight landmarks of hands of other proportions exclude one body, and say nothing of some fingers. Pins alone led to a
 * map with an energy that right maps may have, 1.27, and an error of 0.044. */
static void eight_landmarks_leave_fingers_open(void **state) {
  (void)state;
  if (IS_SLOW) {
    skip(); /* creatures in test_align_match leave limbs open, too */
  }
  double error[2];
  const double energy =
      errors_of_seed((named_body[2]){{"hand", "stout", "point"}, {"hand", "slim", "splay"}}, 2, FEW, WITH, error);
  assert_true(energy <= 1.2);
  assert_true(error[1] <= 0.015);
}

/* On small copies the thin legs of a spider are drawn to other legs. The map is then so poor that the search is
 * repeated on larger copies. Before, the error was 0.029 with this seed, the only one of 26. */
static void thin_legs_are_searched_again(void **state) {
  (void)state;
  if (IS_SLOW) {
    skip(); /* it takes minutes; test_align_match.c repeats a search */
  }
  double error[2];
  (void)errors_of_seed((named_body[2]){{"spider", "", "curl"}, {"spider", "", "rear"}}, 29, FEW, WITHOUT, error);
  assert_true(error[0] <= 0.015);
}

/* One body is twisted. A match that exchanges left with right and front with back would move places by half a body. */
static void a_twist_is_matched(void **state) {
  (void)state;
  if (IS_SLOW) {
    skip(); /* it takes a minute, and other tests run the same code with sanitizers */
  }
  body bodies[2];
  orb_context *ctx = load_or_skip((const char *const[2]){"dan-neutral.obj", "dan-twist.obj"},
                                  (const char *const[2]){"dan-neutral.truth.csv", "dan-twist.truth.csv"}, bodies);
  const orb_align_shape shapes[2] = {{&bodies[0].mesh, bodies[0].embedding.points},
                                     {&bodies[1].mesh, bodies[1].embedding.points}};
  orb_align_options options;
  orb_alignment out;
  orb_align_defaults(&options);
  options.method = ORB_ALIGN_AUTO;
  options.preset = ORB_PRESET_DEFAULT;
  align_and_check(ctx, shapes, 2, NULL, 0, &options, &out);
  assert_true(mean_error(ctx, bodies, GIVEN, &out) <= 0.0021); /* 0.0023 with fingers on the palm, */
  assert_true(out.energy < 1.06);                              /* and 1.073 */
  assert_true(out.match.lead > 1.5);
  assert_true(out.alternative_count > 0 && out.alternatives[0].cost > 1.5);
  orb_alignment_free(ctx, &out);
  unload(ctx, bodies);
}

/* The stretch of the true places between copies of two bodies. */
static double stretch_of(const char *const file[2], const char *const truth[2]) {
  body bodies[2];
  orb_context *ctx = load_or_skip(file, truth, bodies);
  orb_coarse_copy copy[2];
  orb_hint_places places;
  double *at[2], stretch;
  for (int s = 0; s < 2; s++) {
    orb_extent extent;
    orb_mesh_extent(&bodies[s].mesh, &extent);
    const double scale = sqrt(4 * M_PI / extent.area);
    assert_int_equal(orb_coarse_copy_create(ctx, &bodies[s].mesh, 1000, &copy[s]), ORB_OK);
    for (int32_t v = 0; v < 3 * copy[s].mesh.vertex_count; v++) {
      copy[s].mesh.positions[v] *= scale;
    }
    at[s] = orb_alloc(ctx, 3 * (size_t)GIVEN, sizeof(double));
    assert_non_null(at[s]);
    for (int i = 0; i < GIVEN; i++) {
      orb_place_position(&bodies[s].mesh, &bodies[s].truth[i], at[s] + 3 * i);
      for (int k = 0; k < 3; k++) {
        at[s][3 * i + k] *= scale;
      }
    }
  }
  assert_int_equal(orb_hint_places_create(ctx, GIVEN, GIVEN, GIVEN, at, copy, &places), ORB_OK);
  assert_int_equal(orb_hint_stretch(ctx, &places, copy, &stretch), ORB_OK);
  orb_hint_places_free(ctx, &places);
  orb_coarse_copy_free(ctx, &copy[0]);
  orb_coarse_copy_free(ctx, &copy[1]);
  unload(ctx, bodies);
  return stretch;
}

/* A pose changes no distance along the surface; other proportions do. */
static void distances_tell_a_pose(void **state) {
  (void)state;
  double pose = stretch_of((const char *const[2]){"ada-neutral.obj", "ada-run.off"},
                           (const char *const[2]){"ada-neutral.truth.csv", "ada-run.truth.csv"});
  double other = stretch_of((const char *const[2]){"ben-armsup.off", "emmy-crouch.off"},
                            (const char *const[2]){"ben-armsup.truth.csv", "emmy-crouch.truth.csv"});
  assert_true(pose < 0.1);
  assert_true(other > 2 * pose);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(many_true_landmarks_do_not_spoil_a_pose),
                                     cmocka_unit_test(few_true_landmarks_do_not_spoil_a_match),
                                     cmocka_unit_test(maps_on_the_given_spheres_slide),
                                     cmocka_unit_test(landmarks_on_a_part_place_that_part),
                                     cmocka_unit_test(landmarks_of_other_kinds_use_a_match),
                                     cmocka_unit_test(few_landmarks_of_other_kinds_use_a_match),
                                     cmocka_unit_test(other_kinds_are_no_parts),
                                     cmocka_unit_test(one_landmark_keeps_the_match),
                                     cmocka_unit_test(landmarks_in_the_middle_leave_legs_open),
                                     cmocka_unit_test(eight_landmarks_leave_legs_open),
                                     cmocka_unit_test(eight_landmarks_leave_fingers_open),
                                     cmocka_unit_test(thin_legs_are_searched_again),
                                     cmocka_unit_test(a_twist_is_matched),
                                     cmocka_unit_test(finer_triangles_are_as_sure),
                                     cmocka_unit_test(distances_tell_a_pose)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
