/* Finds tips of limbs, matches those of two shapes, and compares the trials on real shapes with known matches. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "align/find/candidates.h"
#include "align/find/tip_choice.h"
#include "align/find/tip_rotations.h"
#include "support_shapes.h"
#include "support_shared.h"

enum { LIMBS = 5 };

/* Five asymmetric directions, and the lengths of the limbs. */
static const double limb[LIMBS][3] = {{1, 0, 0}, {-0.6, 0.8, 0}, {0, -0.8, 0.6}, {-0.48, -0.6, -0.64}, {0, 0.28, 0.96}};
static const double reach[LIMBS] = {4, 3.4, 2.9, 2.5, 2.2};

/* A ball with limbs, rotated around (1, 1, 1) by this many thirds of a full turn. */
static orb_mesh creature_of(orb_context *ctx, const double far[LIMBS], int levels, int thirds) {
  orb_mesh mesh = shape_ball(ctx, levels);
  for (int32_t v = 0; v < mesh.vertex_count; v++) {
    double *p = mesh.positions + 3 * (size_t)v, r = 1, q[3];
    for (int i = 0; i < LIMBS; i++) {
      double c = p[0] * limb[i][0] + p[1] * limb[i][1] + p[2] * limb[i][2];
      r += (far[i] - 1) * exp(-20 * (1 - c));
    }
    memcpy(q, p, sizeof q);
    for (int k = 0; k < 3; k++) {
      p[(k + thirds) % 3] = r * q[k];
    }
  }
  return mesh;
}

static orb_mesh creature(orb_context *ctx, int levels, int thirds) {
  return creature_of(ctx, reach, levels, thirds);
}

/* The limb whose tip a vertex of the creature is, or −1. */
static int limb_at(const orb_mesh *mesh, int32_t v, int thirds) {
  double p[3], length = 0;
  for (int k = 0; k < 3; k++) {
    p[k] = mesh->positions[3 * (size_t)v + (size_t)((k + thirds) % 3)];
    length += p[k] * p[k];
  }
  for (int i = 0; i < LIMBS; i++) {
    if (p[0] * limb[i][0] + p[1] * limb[i][1] + p[2] * limb[i][2] > cos(0.12) * sqrt(length)) {
      return i;
    }
  }
  return -1;
}

static void tips_are_where_limbs_end(void **state) {
  (void)state;
  orb_context *ctx;
  orb_tips tips;
  assert_int_equal(orb_context_create(NULL, &ctx), ORB_OK);
  orb_mesh mesh = creature(ctx, 4, 0);
  assert_int_equal(orb_tips_find(ctx, &mesh, &tips), ORB_OK);
  assert_int_equal(tips.count, LIMBS);
  int seen[LIMBS] = {0};
  for (int i = 0; i < tips.count; i++) {
    int at = limb_at(&mesh, tips.vertex[i], 0);
    assert_true(at >= 0 && !seen[at]);
    seen[at] = 1;
    assert_true(tips.distance[i][i] == 0);
    for (int j = 0; j < i; j++) { /* no way is shorter than the straight one; all of one unit */
      assert_true(tips.distance[i][j] > 0.3 && tips.distance[i][j] == tips.distance[j][i]);
    }
  }
  shape_free(ctx, &mesh);
  orb_context_destroy(ctx);
}

/* On a ball nothing sticks out. */
static void a_ball_has_none(void **state) {
  (void)state;
  orb_context *ctx;
  orb_tips tips;
  assert_int_equal(orb_context_create(NULL, &ctx), ORB_OK);
  orb_mesh ball = shape_ball(ctx, 4);
  assert_int_equal(orb_tips_find(ctx, &ball, &tips), ORB_OK);
  assert_int_equal(tips.count, 0);
  shape_free(ctx, &ball);
  orb_context_destroy(ctx);
}

/* The same creature, rotated and more finely meshed: limb goes to limb. */
static void limbs_go_to_limbs(void **state) {
  (void)state;
  orb_context *ctx;
  orb_tips a, b;
  orb_tip_map maps[ORB_TIP_MAPS_MAX];
  int32_t count;
  assert_int_equal(orb_context_create(NULL, &ctx), ORB_OK);
  orb_mesh first = creature(ctx, 4, 0), second = creature(ctx, 5, 1);
  assert_int_equal(orb_tips_find(ctx, &first, &a), ORB_OK);
  assert_int_equal(orb_tips_find(ctx, &second, &b), ORB_OK);
  orb_tip_maps(&a, &b, maps, &count);
  assert_true(count >= 1);
  assert_int_equal(maps[0].count, LIMBS);
  for (int i = 0; i < a.count; i++) {
    assert_int_equal(limb_at(&second, b.vertex[maps[0].to[i]], 1), limb_at(&first, a.vertex[i], 0));
  }
  for (int32_t k = 1; k < count; k++) {
    assert_true(maps[k].score <= maps[k - 1].score && maps[k].count >= 3);
  }
  shape_free(ctx, &first);
  shape_free(ctx, &second);
  orb_context_destroy(ctx);
}

/* Whether a map takes each limb to the same limb. */
static int is_limb_to_limb(const orb_mesh *mesh, const orb_tips tips[2], const orb_tip_map *map, int thirds) {
  for (int i = 0; i < tips[0].count; i++) {
    if (map->to[i] < 0 ||
        limb_at(&mesh[1], tips[1].vertex[map->to[i]], thirds) != limb_at(&mesh[0], tips[0].vertex[i], 0)) {
      return 0;
    }
  }
  return 1;
}

/* If the longest limb of one creature is the shortest of the other, distances mislead: the match that fits them best
 * takes long limbs to long limbs. The search by rotation takes each limb to its counterpart, for any rotation. */
static void proportions_differ(void **state) {
  (void)state;
  static const double other[LIMBS] = {2.2, 2.5, 2.9, 3.4, 4};
  static orb_tip_map maps[ORB_TIP_MAPS_MAX];
  orb_tip_map rotated[ORB_TIP_ROTATIONS];
  for (int thirds = 0; thirds < 3; thirds++) {
    orb_context *ctx;
    orb_tips tips[2];
    int32_t count;
    assert_int_equal(orb_context_create(NULL, &ctx), ORB_OK);
    orb_mesh mesh[2] = {creature(ctx, 4, 0), creature_of(ctx, other, 4, thirds)};
    const orb_mesh *both[2] = {&mesh[0], &mesh[1]};
    for (int s = 0; s < 2; s++) {
      assert_int_equal(orb_tips_find(ctx, &mesh[s], &tips[s]), ORB_OK);
      assert_int_equal(tips[s].count, LIMBS);
    }
    orb_tip_maps(&tips[0], &tips[1], maps, &count);
    assert_false(is_limb_to_limb(mesh, tips, &maps[0], thirds));
    assert_int_equal(orb_tip_maps_by_rotation(ctx, both, tips, rotated, &count), ORB_OK);
    assert_true(count >= 1 && is_limb_to_limb(mesh, tips, &rotated[0], thirds));
    for (int32_t i = 0; i < count; i++) {
      assert_true(i == 0 || rotated[i].score <= rotated[i - 1].score);
      assert_true(i == 0 || !is_limb_to_limb(mesh, tips, &rotated[i], thirds));
    }
    shape_free(ctx, &mesh[0]);
    shape_free(ctx, &mesh[1]);
    orb_context_destroy(ctx);
  }
}

/* The creature has no symmetry. The identity takes its limbs to those of a finer copy, so it is tried first. The limbs
 * of its mirror image (x negated) have the same distances, but no rotation takes the limbs there: this match is not
 * tried. */
static void mirror_images_are_left_out(void **state) {
  (void)state;
  enum { MOST = 10 };
  orb_context *ctx;
  orb_tips tips[2];
  static orb_tip_map maps[ORB_TIP_MAPS_MAX];
  int32_t count, chosen[MOST], chosen_count;
  assert_int_equal(orb_context_create(NULL, &ctx), ORB_OK);
  orb_mesh mesh[2] = {creature(ctx, 4, 0), creature(ctx, 5, 0)};
  const orb_mesh *both[2] = {&mesh[0], &mesh[1]};
  for (int s = 0; s < 2; s++) {
    assert_int_equal(orb_tips_find(ctx, &mesh[s], &tips[s]), ORB_OK);
  }
  orb_tip_maps(&tips[0], &tips[1], maps, &count);
  assert_true(is_limb_to_limb(mesh, tips, &maps[0], 0));
  for (int mirrored = 0; mirrored < 2; mirrored++) {
    assert_int_equal(orb_tip_maps_choose(ctx, both, tips, maps, count, MOST, chosen, &chosen_count), ORB_OK);
    assert_true(chosen_count >= 1 && chosen_count <= MOST);
    for (int i = 0; i < chosen_count; i++) {
      assert_int_equal(chosen[i] == 0, i == 0 && !mirrored);
      assert_true(chosen[i] >= 0 && chosen[i] < count);
      for (int k = 0; k < i; k++) {
        assert_int_not_equal(chosen[i], chosen[k]);
      }
    }
    for (int32_t v = 0; v < mesh[1].vertex_count; v++) {
      mesh[1].positions[3 * (size_t)v] *= -1;
    }
  }
  shape_free(ctx, &mesh[0]);
  shape_free(ctx, &mesh[1]);
  orb_context_destroy(ctx);
}

/* The landmark of a list of vertices that is nearest in space. */
static int nearest_of(const orb_mesh *mesh, const int32_t *list, int count, int32_t v) {
  int best = 0;
  double least = INFINITY;
  for (int i = 0; i < count; i++) {
    double d = 0;
    for (int k = 0; k < 3; k++) {
      double e = mesh->positions[3 * (size_t)list[i] + (size_t)k] - mesh->positions[3 * (size_t)v + (size_t)k];
      d += e * e;
    }
    if (d < least) {
      least = d;
      best = i;
    }
  }
  return best;
}

/* Is v at the landmark: nearer than an eighth of the diagonal? */
static int is_at(const orb_mesh *mesh, int32_t landmark, int32_t v) {
  orb_extent extent;
  double d = 0;
  orb_mesh_extent(mesh, &extent);
  for (size_t k = 0; k < 3; k++) {
    double e = mesh->positions[3 * (size_t)landmark + k] - mesh->positions[3 * (size_t)v + k];
    d += e * e;
  }
  return d < extent.diagonal * extent.diagonal / 64;
}

/* The best candidate for two real shapes takes what lies at the tips of the first, as landmarks set by hand name them,
 * to the matching tips of the second, and has at least `least` such pairs. Pairs elsewhere, which a spectral map has,
 * belong to no landmark. Skips if the shapes are missing. */
static void assert_candidate(const char *first, const char *second, int marks, const int32_t *mark[2], int least,
                             double clear) {
  orb_context *ctx;
  orb_mesh mesh[2];
  orb_candidate best;
  assert_int_equal(orb_context_create(NULL, &ctx), ORB_OK);
  int found = shared_mesh(ctx, first, &mesh[0]);
  if (found) {
    assert_true(shared_mesh(ctx, second, &mesh[1]));
    assert_int_equal(orb_candidate_find(ctx, &mesh[0], &mesh[1], &best), ORB_OK);
    int tips = 0;
    for (int k = 0; k < best.count; k++) {
      int at = nearest_of(&mesh[0], mark[0], marks, best.first[k]);
      if (is_at(&mesh[0], mark[0][at], best.first[k])) {
        assert_int_equal(nearest_of(&mesh[1], mark[1], marks, best.second[k]), at);
        tips++;
      }
    }
    assert_true(tips >= least && best.clear >= 0 && best.clear < clear);
    orb_mesh_free(ctx, &mesh[0]);
    orb_mesh_free(ctx, &mesh[1]);
  }
  orb_context_destroy(ctx);
  if (!found) {
    print_message("The folder of real meshes is not there.\n");
    skip();
  }
}

/* Feet, hands and nose of a man and an armadillo. Both stand upright and face the same way, so left goes to left,
 * though the map with the man facing backwards has nearly the same energy. */
static void man_to_armadillo(void **state) {
  (void)state;
  static const int32_t man[] = {6615, 3218, 5906, 2445, 331}, armadillo[] = {10077, 9912, 14583, 14523, 13173};
  assert_candidate("human_man.obj", "armadillo_29k.obj", 5, (const int32_t *[]){man, armadillo}, 3, 0.9);
}

/* Four legs and the nose of a stout cow and a lean animal that faces a different way. */
static void cow_to_animal(void **state) {
  (void)state;
  static const int32_t cow[] = {1759, 439, 1732, 410, 847}, animal[] = {6774, 1910, 6727, 6824, 1590};
  assert_candidate("spot.obj", "shrec381.off", 5, (const int32_t *[]){cow, animal}, 4, 1);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(tips_are_where_limbs_end),
                                     cmocka_unit_test(a_ball_has_none),
                                     cmocka_unit_test(limbs_go_to_limbs),
                                     cmocka_unit_test(proportions_differ),
                                     cmocka_unit_test(mirror_images_are_left_out),
                                     cmocka_unit_test(man_to_armadillo),
                                     cmocka_unit_test(cow_to_animal)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
