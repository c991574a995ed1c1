/* Landmarks at awkward places: next to each other, on edges, several in one triangle, the same place named in two ways,
 * sixty of them, and contradictory ones, which the error names. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "align/pin/joint.h"
#include "align/sheet/landmarks.h"
#include "numeric/vec3.h"
#include "orbmorph/align.h"
#include "support_align.h"
#include "support_bodies.h"
#include "support_shared.h"

/* The k-th neighbour of vertex v, in the order of the triangles. */
static int32_t neighbour(const orb_mesh *mesh, int32_t v, int k) {
  for (int32_t h = 0; h < 3 * mesh->triangle_count; h++) {
    if (mesh->triangles[h] == v && k-- == 0) {
      return mesh->triangles[orb_next(h)];
    }
  }
  fail();
  return -1;
}

static void put_vertex(bodies *b, int landmark, int shape, int32_t v) {
  assert_int_equal(orb_place_of_vertex(b->ctx, &b->mesh[shape], v, &b->at[landmark][shape]), ORB_OK);
}

static void meet(bodies *b, int shapes, int count) {
  orb_align_options options = bodies_options(ORB_ALIGN_PIN);
  orb_alignment out;
  align_and_check(b->ctx, b->shape, shapes, b->landmark, count, &options, &out);
  orb_alignment_free(b->ctx, &out);
}

/* A vertex and four of its neighbours on one shape, five distant vertices on the others; then adjacent vertices on all,
 * in the same order around the vertex and in the opposite order. */
static void adjacent_vertices(void **state) {
  (void)state;
  bodies b;
  bodies_open(&b, NULL);
  for (int kind = 0; kind < 3; kind++) {
    bodies_like(&b, 9);
    for (int s = 0; s < BODIES; s++) {
      int32_t v = 100 + 11 * s;
      for (int k = 0; (kind > 0 || s == 0) && k < 4; k++) {
        put_vertex(&b, k + 1, s, neighbour(&b.mesh[s], v, kind == 2 && s == 1 ? 3 - k : k));
      }
      if (kind > 0 || s == 0) {
        put_vertex(&b, 0, s, v);
      }
    }
    meet(&b, BODIES, 9);
  }
  bodies_close(&b);
}

/* Either triangle of an edge can name a place on it; both name the same place. */
static void one_place_on_an_edge(void **state) {
  (void)state;
  bodies b;
  bodies_open(&b, NULL);
  bodies_like(&b, 8);
  for (int s = 0; s < 2; s++) {
    const int32_t *tri = b.mesh[s].triangles;
    int32_t h = 3 * 50, g = 0;
    while (tri[g] != tri[orb_next(h)] || tri[orb_next(g)] != tri[h]) {
      g++;
    }
    for (int side = 0; side < 2; side++) {
      orb_place *place = &b.at[6 + side][s];
      int32_t from = side ? g : h;
      *place = (orb_place){from / 3, {0, 0, 0}};
      place->at[from % 3] = side ? 0.25 : 0.75;
      place->at[orb_next(from) % 3] = side ? 0.75 : 0.25;
    }
  }
  orb_align_options options = bodies_options(ORB_ALIGN_PIN);
  orb_alignment out;
  align_and_check(b.ctx, b.shape, 2, b.landmark, 8, &options, &out);
  for (int s = 0; s < 2; s++) {
    assert_int_equal(out.shapes[s].landmark_vertices[6], out.shapes[s].landmark_vertices[7]);
    assert_true(out.shapes[s].landmark_vertices[6] >= b.mesh[s].vertex_count);
  }
  orb_alignment_free(b.ctx, &out);
  bodies_close(&b);
}

/* Six in one triangle of every shape: its corners, and three inside it, in opposite order on one shape. */
static void six_in_one_triangle(void **state) {
  (void)state;
  static const double inside[3][3] = {{0.5, 0.25, 0.25}, {0.25, 0.5, 0.25}, {0.25, 0.25, 0.5}};
  bodies b;
  bodies_open(&b, NULL);
  for (int mirrored = 0; mirrored < 2; mirrored++) {
    bodies_like(&b, 10);
    for (int s = 0; s < BODIES; s++) {
      for (int k = 0; k < 3; k++) {
        b.at[k][s] = (orb_place){40 + s, {k == 0, k == 1, k == 2}};
        b.at[3 + k][s] = (orb_place){40 + s, {0, 0, 0}};
        memcpy(b.at[3 + k][s].at, inside[mirrored && s == 1 ? 2 - k : k], sizeof inside[0]);
      }
    }
    meet(&b, BODIES, 10);
  }
  bodies_close(&b);
}

/* The same vertex twice on all shapes, named by different triangles: one landmark with two names. */
static void duplicates_share_a_vertex(void **state) {
  (void)state;
  bodies b;
  bodies_open(&b, NULL);
  bodies_like(&b, 7);
  for (int s = 0; s < BODIES; s++) {
    int32_t v = bodies_vertex_at(&b.mesh[s], &b.at[2][s]), h = 3 * b.mesh[s].triangle_count - 1;
    while (b.mesh[s].triangles[h] != v) {
      h--;
    }
    assert_int_not_equal(h / 3, b.at[2][s].triangle);
    b.at[6][s] = (orb_place){h / 3, {h % 3 == 0, h % 3 == 1, h % 3 == 2}};
  }
  for (int m = 0; m < 2; m++) {
    orb_align_options options = bodies_options(m ? ORB_ALIGN_RBF : ORB_ALIGN_PIN);
    orb_alignment out;
    align_and_check(b.ctx, b.shape, BODIES, b.landmark, 7, &options, &out);
    for (int s = 0; s < BODIES; s++) {
      assert_int_equal(out.shapes[s].landmark_vertices[6], out.shapes[s].landmark_vertices[2]);
    }
    orb_alignment_free(b.ctx, &out);
  }
  bodies_close(&b);
}

static void refused(bodies *b, int shapes, int count, const int *named, int named_count) {
  for (int m = 0; m < 2; m++) {
    orb_align_options options = bodies_options(m ? ORB_ALIGN_RBF : ORB_ALIGN_PIN);
    orb_alignment out;
    assert_int_equal(orb_align(b->ctx, b->shape, shapes, b->landmark, count, &options, &out), ORB_E_BAD_LANDMARKS);
    const orb_error *error = orb_context_error(b->ctx);
    assert_int_equal(error->landmark_count, named_count);
    for (int k = 0; k < named_count; k++) {
      assert_int_equal(error->landmarks[k], named[k]);
    }
    assert_null(out.shapes);
  }
}

/* Landmarks that share a place on only some shapes: the error names exactly these, whatever other landmarks exist. */
static void contradictions_are_named(void **state) {
  (void)state;
  bodies b;
  bodies_open(&b, NULL);
  bodies_like(&b, 10);
  b.at[7][1] = b.at[3][1];
  refused(&b, 2, 10, (const int[]){3, 7}, 2);
  refused(&b, 3, 10, (const int[]){3, 7}, 2);
  b.at[9][2] = b.at[0][2];
  refused(&b, 2, 10, (const int[]){3, 7}, 2);
  refused(&b, 3, 10, (const int[]){0, 3, 7, 9}, 4);
  assert_int_equal(orb_context_error(b.ctx)->shape, 1);
  bodies_like(&b, 10);
  b.at[4][0].triangle = b.mesh[0].triangle_count;
  refused(&b, 2, 10, (const int[]){4}, 1);
  bodies_like(&b, 10);
  b.at[5][1].at[0] = NAN;
  refused(&b, 2, 10, (const int[]){5}, 1);
  bodies_close(&b);
}

/* If the surfaces may hardly grow, tangled landmarks are refused. The error names one: the landmarks before it can be
 * met, but not together with it. */
static void the_first_that_cannot_be_met_is_named(void **state) {
  (void)state;
  bodies b;
  bodies_open(&b, NULL);
  int named = 0;
  for (uint64_t seed = 1; seed <= (IS_SLOW ? 1 : 3); seed++) {
    bodies_random(&b, 24, seed);
    orb_align_options options = bodies_options(ORB_ALIGN_PIN);
    options.max_growth = 0.2;
    orb_alignment out;
    orb_status status = orb_align(b.ctx, b.shape, 2, b.landmark, 24, &options, &out);
    assert_int_equal(status, ORB_E_BAD_LANDMARKS);
    const orb_error *error = orb_context_error(b.ctx);
    assert_int_equal(error->landmark_count, 1);
    assert_true(error->shape >= 0 && error->shape < 2);
    named = error->landmarks[0];
    assert_true(named >= 3 && named < 24);
    align_and_check(b.ctx, b.shape, 2, b.landmark, named, &options, &out);
    orb_alignment_free(b.ctx, &out);
    assert_int_equal(orb_align(b.ctx, b.shape, 2, b.landmark, named + 1, &options, &out), ORB_E_BAD_LANDMARKS);
    assert_int_equal(orb_context_error(b.ctx)->landmarks[0], named);
  }
  bodies_close(&b);
}

static void sixty(void **state) {
  (void)state;
  bodies b;
  bodies_open(&b, NULL);
  bodies_like(&b, 60);
  meet(&b, BODIES, 60);
  bodies_random(&b, 60, 3);
  meet(&b, 2, 60);
  bodies_close(&b);
}

/* This many landmarks in random order wind around each other in hundreds of parallel strands. The cost must not grow
 * from one strand to the next, or the surfaces exceed their limit. */
static void a_hundred_and_fifty(void **state) {
  (void)state;
  bodies b;
  bodies_open(&b, NULL);
  bodies_random(&b, 150, 7);
  meet(&b, 2, 150);
  bodies_close(&b);
}

/* The work for tangled landmarks is limited. When it is used up they count as not met, and the shapes are unchanged. */
static void work_is_bounded(void **state) {
  (void)state;
  enum { COUNT = 30 };
  bodies b;
  int32_t numbers[COUNT];
  orb_sheet sheets[2];
  bodies_open(&b, NULL);
  bodies_random(&b, COUNT, 5);
  for (int32_t s = 0; s < 2; s++) {
    assert_int_equal(orb_sheet_create(b.ctx, b.shape[s].mesh, b.shape[s].points, &sheets[s]), ORB_OK);
    assert_int_equal(orb_sheet_insert_landmarks(b.ctx, &sheets[s], b.landmark, COUNT, s), ORB_OK);
  }
  for (int32_t k = 0; k < COUNT; k++) {
    numbers[k] = k;
  }
  int held;
  int32_t vertices = sheets[0].shape.mesh.vertex_count;
  orb_pin_room little = {64, 20000}, much = {64, 500000000};
  assert_int_equal(orb_pin_joint(b.ctx, sheets, 2, numbers, COUNT, ORB_PRESET_FAST, &little, &held), ORB_OK);
  assert_int_equal(held, 0);
  assert_true(little.work <= 0 && little.work > -20000);
  assert_int_equal(sheets[0].shape.mesh.vertex_count, vertices);
  assert_int_equal(orb_pin_joint(b.ctx, sheets, 2, numbers, COUNT, ORB_PRESET_FAST, &much, &held), ORB_OK);
  assert_int_equal(held, 1);
  assert_true(much.work > 0 && much.work < 500000000);
  for (int s = 0; s < 2; s++) {
    orb_sheet_free(b.ctx, &sheets[s]);
  }
  bodies_close(&b);
}

static int load(orb_context *ctx, const char *name, orb_mesh *mesh, orb_embedding *embedding) {
  if (!shared_mesh(ctx, name, mesh)) {
    return 0;
  }
  orb_embed_options options;
  orb_embed_defaults(&options);
  assert_int_equal(orb_embed(ctx, mesh, &options, embedding), ORB_OK);
  return 1;
}

/* Vertices with equal numbers, which are unrelated places: twelve on a cow and a man. */
static void cow_to_human(void **state) {
  (void)state;
  orb_context *ctx;
  orb_mesh mesh[2];
  orb_embedding embedding[2];
  assert_int_equal(orb_context_create(NULL, &ctx), ORB_OK);
  int found = load(ctx, "cow.off", &mesh[0], &embedding[0]) && load(ctx, "human_man.obj", &mesh[1], &embedding[1]);
  if (found) {
    enum { COUNT = 12 };
    orb_align_shape shapes[2];
    orb_place at[COUNT][2];
    orb_landmark landmarks[COUNT];
    memset(landmarks, 0, sizeof landmarks);
    for (int k = 0; k < COUNT; k++) {
      for (int s = 0; s < 2; s++) {
        shapes[s] = (orb_align_shape){&mesh[s], embedding[s].points};
        int32_t v = (int32_t)(((int64_t)(k + 1) * 7919 * (s + 3)) % mesh[s].vertex_count);
        assert_int_equal(orb_place_of_vertex(ctx, &mesh[s], v, &at[k][s]), ORB_OK);
      }
      landmarks[k].at = at[k];
    }
    orb_align_options options = bodies_options(ORB_ALIGN_PIN);
    orb_alignment out;
    align_and_check(ctx, shapes, 2, landmarks, COUNT, &options, &out);
    orb_alignment_free(ctx, &out);
    for (int s = 0; s < 2; s++) {
      orb_mesh_free(ctx, &mesh[s]);
      orb_embedding_free(ctx, &embedding[s]);
    }
  }
  orb_context_destroy(ctx);
  if (!found) {
    print_message("The folder of real meshes is not there.\n");
    skip();
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(adjacent_vertices),
      cmocka_unit_test(one_place_on_an_edge),
      cmocka_unit_test(six_in_one_triangle),
      cmocka_unit_test(duplicates_share_a_vertex),
      cmocka_unit_test(contradictions_are_named),
      cmocka_unit_test(the_first_that_cannot_be_met_is_named),
      cmocka_unit_test(sixty),
      cmocka_unit_test(a_hundred_and_fifty),
      cmocka_unit_test(work_is_bounded),
      cmocka_unit_test(cow_to_human),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
