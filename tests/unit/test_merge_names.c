/* Compares names of found landmarks with the truth from another source: the limbs of the bones from which a body of the
 * samples was made, and the parts that the makers of real bodies marked. */
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
#include "merge/name.h"
#include "orbmorph/format.h"
#include "support_context.h"
#include "support_shared.h"

enum { POINTS = 12 };

/* Points that are far from each other, tips first, like found landmarks. */
static void spread(const double *positions, int count, int out[POINTS]) {
  double *far = malloc((size_t)count * sizeof *far);
  assert_non_null(far);
  for (int i = -1, last = 0; i < POINTS; i++) {
    int best = 0;
    for (int v = 0; v < count; v++) {
      double d = 0;
      for (int k = 0; k < 3; k++) {
        d += (positions[3 * v + k] - positions[3 * last + k]) * (positions[3 * v + k] - positions[3 * last + k]);
      }
      far[v] = i < 1 || d < far[v] ? d : far[v];
      best = far[v] > far[best] ? v : best;
    }
    if (i >= 0) {
      out[i] = last;
    }
    last = best;
  }
  free(far);
}

static orb_mesh mesh_of(const orb_sample *sample) {
  return (orb_mesh){.vertex_count = sample->vertex_count,
                    .triangle_count = sample->triangle_count,
                    .positions = sample->positions,
                    .triangles = (int32_t *)sample->triangles};
}

/* Names the points of a body, by vertex number. Returns how many have a name. */
static int name_points(const orb_sample *sample, int vertices[POINTS], const char *names[POINTS]) {
  double at[3 * POINTS];
  int named = 0;
  spread(sample->positions, sample->vertex_count, vertices);
  for (int i = 0; i < POINTS; i++) {
    memcpy(at + 3 * i, sample->positions + 3 * vertices[i], 3 * sizeof *at);
  }
  orb_mesh mesh = mesh_of(sample);
  assert_int_equal(orb_name_points(ctx, &mesh, at, POINTS, names), ORB_OK);
  for (int i = 0; i < POINTS; i++) {
    named += names[i] != NULL;
    for (int j = 0; j < i; j++) {
      assert_true(!names[i] || !names[j] || strcmp(names[i], names[j]) != 0);
    }
  }
  return named;
}

/* The word for a limb of the generator. */
static const char *word_of(posed_limb limb) {
  switch (limb) {
    case FRU:
    case FRL:
    case FRF:
      return "right front limb";
    case FLU:
    case FLL:
    case FLF:
      return "left front limb";
    case HRU:
    case HRL:
    case HRC:
    case HRF:
      return "right hind limb";
    case HLU:
    case HLL:
    case HLC:
    case HLF:
      return "left hind limb";
    case TAIL:
      return "tail";
    case HEAD:
    case SNOUT:
    case EAR_R:
    case EAR_L:
      return "head";
    default:
      return "";
  }
}

/* The limb of a vertex of a body at rest: that of the nearest bone. */
static const char *truth_of(const posed_rest *rest, const double *p) {
  int best = 0;
  for (size_t i = 1; i < rest->animal.primitive_count; i++) {
    if (sample_distance(&rest->primitives[i], p) < sample_distance(&rest->primitives[best], p)) {
      best = (int)i;
    }
  }
  while (rest->kind->bones[best].limb == LIMB_NONE) {
    best = rest->kind->bones[best].parent;
  }
  return word_of(rest->kind->bones[best].limb);
}

/* Moves a body: rotates it to z up, rotates it by an angle about the vertical, or mirrors it, which exchanges left and
 * right. */
static void transform(orb_sample *body, int z_up, double angle, int mirror) {
  for (int v = 0; v < body->vertex_count; v++) {
    double *p = body->positions + 3 * v, x = p[0], y = p[1], z = mirror ? -p[2] : p[2];
    double c = cos(angle), s = sin(angle), q[3] = {c * x + s * z, y, c * z - s * x};
    p[0] = q[0];
    p[1] = z_up ? -q[2] : q[1];
    p[2] = z_up ? q[1] : q[2];
  }
  for (int t = 0; t < body->triangle_count && mirror; t++) {
    int other = body->triangles[3 * t];
    body->triangles[3 * t] = body->triangles[3 * t + 1];
    body->triangles[3 * t + 1] = other;
  }
}

static const char *swapped(const char *word) {
  static const char *const pairs[][2] = {{"left front limb", "right front limb"},
                                         {"left hind limb", "right hind limb"}};
  for (int i = 0; i < 4; i++) {
    if (strcmp(word, pairs[i / 2][i % 2]) == 0) {
      return pairs[i / 2][1 - i % 2];
    }
  }
  return word;
}

/* A body at rest, with the word for each of its vertices. */
typedef struct animal {
  posed_rest rest;
  orb_sample body;
  const char **truth;
} animal;

static animal make(const char *kind) {
  animal a;
  posed_proportion(posed_find(kind), "", &a.rest);
  posed_polygonise(&a.rest, 1, &a.body);
  a.truth = malloc((size_t)a.body.vertex_count * sizeof *a.truth);
  assert_non_null(a.truth);
  for (int v = 0; v < a.body.vertex_count; v++) {
    a.truth[v] = truth_of(&a.rest, a.body.positions + 3 * v);
  }
  return a;
}

static void *copy_of(const void *block, size_t size) {
  void *copy = malloc(size);
  assert_non_null(copy);
  return memcpy(copy, block, size);
}

/* Returns how many names a body gets in a pose; each must be true. */
static int check_pose(const animal *a, const char *pose, int z_up, double angle, int mirror) {
  orb_sample body = a->body;
  body.positions = copy_of(body.positions, 3 * (size_t)body.vertex_count * sizeof *body.positions);
  body.triangles = copy_of(body.triangles, 3 * (size_t)body.triangle_count * sizeof *body.triangles);
  posed_skin(&a->rest, pose, &body);
  transform(&body, z_up, angle, mirror);
  int vertices[POINTS];
  const char *names[POINTS];
  int named = name_points(&body, vertices, names);
  for (int i = 0; i < POINTS; i++) {
    const char *want = mirror ? swapped(a->truth[vertices[i]]) : a->truth[vertices[i]];
    if (names[i] && strcmp(names[i], want) != 0) {
      fail_msg("%s-%s, %s up, turned by %g%s: a point of \"%s\" is called \"%s\"", a->rest.animal.name, pose,
               z_up ? "z" : "y", angle, mirror ? ", mirrored" : "", want, names[i]);
    }
  }
  free(body.positions);
  free(body.triangles);
  return named;
}

/* Bodies that stand or walk on four limbs get words for limbs and head. Names are true in every pose. */
static void test_animals(void **state) {
  (void)state;
  static const char *const kinds[] = {"dog", "giraffe", "elephant", "horse", "cow", "cat", "person"};
  static const char *const poses[] = {"stand", "walk", "run", "graze", "sit"};
  int standing = 0, count = sizeof kinds / sizeof *kinds;
  for (int k = 0; k < count; k++) {
    animal a = make(kinds[k]);
    for (int p = 0; p < (int)(sizeof poses / sizeof *poses); p++) {
      int least = POINTS;
      for (int way = 0; way < 2; way++) { /* y up; mirrored and z up */
        int named = check_pose(&a, poses[p], way, 0.9 * (k + 3 * p + way), way);
        least = named < least ? named : least;
      }
      print_message("%s-%s: %d names\n", kinds[k], poses[p], least);
      standing += p < 2 && least >= 4;
    }
    free(a.body.positions);
    free(a.body.triangles);
    free(a.truth);
  }
  print_message("%d of %d that stand or walk have 4 names or more\n", standing, 2 * count);
  assert_true(standing >= 2 * count - 2);
}

/* The part of each sample of the real bodies. */
enum { SAMPLES = 400 };

static int read_parts(char parts[SAMPLES][16]) {
  size_t size;
  char *text = (char *)shared_bytes("posed", "samples.csv", &size);
  if (!text) {
    return 0;
  }
  int sample;
  for (char *line = strchr(text, '\n'); line && line[1]; line = strchr(line + 1, '\n')) {
    char part[16];
    assert_int_equal(sscanf(line + 1, "%d,%15[^,]", &sample, part), 2);
    assert_true(sample >= 0 && sample < SAMPLES);
    strcpy(parts[sample], part);
  }
  free(text);
  return 1;
}

/* The part of the sample nearest to a point of a body. */
static const char *part_at(const orb_mesh *mesh, const char *truth, char parts[SAMPLES][16], const double p[3]) {
  double least = INFINITY;
  const char *part = "";
  for (const char *line = strchr(truth, '\n'); line && line[1]; line = strchr(line + 1, '\n')) {
    orb_place place;
    int sample;
    double q[3], d = 0;
    assert_int_equal(
        sscanf(line + 1, "%d,%d,%lf,%lf,%lf", &sample, &place.triangle, &place.at[0], &place.at[1], &place.at[2]), 5);
    orb_place_position(mesh, &place, q);
    for (int k = 0; k < 3; k++) {
      d += (p[k] - q[k]) * (p[k] - q[k]);
    }
    if (d < least) {
      least = d;
      part = parts[sample];
    }
  }
  return part;
}

static int agrees(const char *name, const char *part) {
  static const char *const rows[][3] = {{"head", "head", "head"},
                                        {"left upper limb", "hand.L", "arm.L"},
                                        {"right upper limb", "hand.R", "arm.R"},
                                        {"left lower limb", "foot.L", "leg.L"},
                                        {"right lower limb", "foot.R", "leg.R"}};
  for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
    if (strcmp(name, rows[i][0]) == 0) {
      return strcmp(part, rows[i][1]) == 0 || strcmp(part, rows[i][2]) == 0;
    }
  }
  return 0;
}

/* Real people, rotated about the vertical or arbitrarily: each name is true, and most people who stand have all five
 * names. */
static void test_people(void **state) {
  (void)state;
  static const char *const people[] = {"ada", "ben", "cora", "dan", "emmy", "fay"};
  static const char *const poses[] = {"neutral", "run",   "sit",      "twist",    "armsup",
                                      "crouch",  "legup", "sidebend", "armscross"};
  static char parts[SAMPLES][16];
  int neutral = 0, bodies = 0, named = 0;
  if (!read_parts(parts)) {
    skip();
  }
  for (int i = 0; i < 6 * 9; i++) {
    char name[64];
    size_t size;
    unsigned char *bytes = NULL;
    for (int ending = 0; ending < 2 && !bytes; ending++) {
      snprintf(name, sizeof name, "%s-%s.%s", people[i / 9], poses[i % 9], ending ? "off" : "obj");
      bytes = shared_bytes("posed", name, &size);
    }
    if (!bytes) {
      continue;
    }
    orb_mesh mesh;
    assert_int_equal(orb_mesh_read(ctx, bytes, size, ORB_FORMAT_AUTO, &mesh, NULL), ORB_OK);
    free(bytes);
    snprintf(name, sizeof name, "%s-%s.truth.csv", people[i / 9], poses[i % 9]);
    char *truth = (char *)shared_bytes("posed", name, &size);
    assert_non_null(truth);
    orb_sample body = {mesh.vertex_count, mesh.triangle_count, mesh.positions, mesh.triangles};
    int vertices[POINTS];
    const char *names[POINTS];
    int count = name_points(&body, vertices, names);
    for (int k = 0; k < POINTS; k++) {
      const char *part = part_at(&mesh, truth, parts, mesh.positions + 3 * vertices[k]);
      if (names[k] && !agrees(names[k], part)) {
        fail_msg("%s: a point on the part \"%s\" is called \"%s\"", name, part, names[k]);
      }
    }
    print_message("%s: %d names\n", name, count);
    neutral += i % 9 == 0 && count == 5;
    named += count > 0;
    bodies++;
    free(truth);
    orb_mesh_free(ctx, &mesh);
  }
  print_message("%d of %d bodies have names\n", named, bodies);
  assert_true(neutral >= 4);
}

/* A ball, a box and a table have no front. */
static void test_things(void **state) {
  (void)state;
  static const double legs[4][2] = {{-2, -1}, {-2, 1}, {2, -1}, {2, 1}};
  orb_primitive table[5] = {{.kind = SAMPLE_CONE,
                             .begins_part = 1,
                             .blend = 0.05,
                             .a = {-2, 1.4, 0},
                             .b = {2, 1.4, 0},
                             .ra = 1.2,
                             .rb = 1.2}};
  for (int i = 0; i < 4; i++) {
    table[1 + i] = (orb_primitive){.kind = SAMPLE_CONE,
                                   .begins_part = 1,
                                   .blend = 0.1,
                                   .ra = 0.3,
                                   .rb = 0.2,
                                   .a = {legs[i][0], 1, legs[i][1]},
                                   .b = {legs[i][0], -1, legs[i][1]}};
  }
  for (int count = 1; count <= 5; count += 4) {
    const orb_animal thing = {.name = "table",
                              .primitives = table,
                              .primitive_count = (size_t)count,
                              .low = {-3.5, -1.5, -1.6},
                              .high = {3.5, 3, 1.6}};
    orb_sample body;
    int vertices[POINTS];
    const char *names[POINTS];
    sample_surface_nets(&thing, 0.12, &body);
    assert_int_equal(name_points(&body, vertices, names), 0);
    free(body.positions);
    free(body.triangles);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_animals),
      cmocka_unit_test(test_people),
      cmocka_unit_test(test_things),
  };
  return cmocka_run_group_tests(tests, context_one_thread, context_end);
}
