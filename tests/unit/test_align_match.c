/* Matches of shapes without landmarks: limbs go to their counterparts, on shapes where these are known. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "align/find/match.h"
#include "align/find/params.h"
#include "align/find/trials.h"
#include "base/memory.h"
#include "support_align.h"
#include "support_shapes.h"
#include "support_shared.h"

enum { LIMBS = 5 };

/* Five asymmetric directions, and the lengths of the limbs. */
static const double limb[LIMBS][3] = {{1, 0, 0}, {-0.6, 0.8, 0}, {0, -0.8, 0.6}, {-0.48, -0.6, -0.64}, {0, 0.28, 0.96}};
static const double reach[LIMBS] = {4, 3.4, 2.9, 2.5, 2.2};

/* A ball with limbs, rotated around (1, 1, 1) by this many thirds of a full turn. */
static orb_mesh creature_of(orb_context *ctx, const double far[LIMBS], int levels, int thirds) {
  orb_mesh mesh = shape_creature(ctx, LIMBS, limb, far, levels);
  for (int32_t v = 0; v < mesh.vertex_count; v++) {
    double *p = mesh.positions + 3 * (size_t)v;
    const double q[3] = {p[0], p[1], p[2]};
    for (int k = 0; k < 3; k++) {
      p[(k + thirds) % 3] = q[k];
    }
  }
  return mesh;
}

/* The vertex at the end of a limb of a creature that is rotated by this many thirds. */
static int32_t tip_of(const orb_mesh *mesh, int i, int thirds) {
  double direction[3];
  for (int k = 0; k < 3; k++) {
    direction[(k + thirds) % 3] = limb[i][k];
  }
  return shape_farthest(mesh, direction);
}

/* Each limb of the shape that moves goes to its counterpart. thirds: of the second shape. */
static void assert_limbs(orb_context *ctx, const orb_match *match, const orb_mesh mesh[2], int moving, int thirds) {
  const orb_mesh *to = &mesh[1 - moving];
  const int own = moving == 1 ? thirds : 0, others = moving == 1 ? 0 : thirds;
  double *target;
  orb_extent extent;
  orb_mesh_extent(to, &extent);
  assert_int_equal(orb_match_target(ctx, match, 0, moving, &target), ORB_OK);
  for (int i = 0; i < LIMBS; i++) {
    const double *p = to->positions + 3 * (size_t)tip_of(to, i, others),
                 *q = target + 3 * (size_t)tip_of(&mesh[moving], i, own);
    double d = 0;
    for (int k = 0; k < 3; k++) {
      d += (p[k] - q[k]) * (p[k] - q[k]);
    }
    assert_true(sqrt(d) < 0.12 * extent.diagonal);
  }
  orb_free(ctx, target);
}

/* Each limb goes to its counterpart for any rotation of the other creature, even though its proportions differ,
 * whichever of them moves. */
static void limbs_go_to_limbs(void **state) {
  (void)state;
  static const double other[LIMBS] = {3.4, 4, 2.5, 2.9, 2.4};
  for (int thirds = IS_SLOW ? 2 : 0; thirds < 3; thirds++) {
    orb_context *ctx;
    orb_match match;
    assert_int_equal(orb_context_create(NULL, &ctx), ORB_OK);
    orb_mesh mesh[2] = {creature_of(ctx, reach, 3, 0), creature_of(ctx, other, 4, thirds)};
    assert_int_equal(orb_match_find(ctx, &mesh[0], &mesh[1], NULL, 1, &match), ORB_OK);
    assert_true(match.is_found);
    assert_limbs(ctx, &match, mesh, 1, thirds);
    assert_limbs(ctx, &match, mesh, 0, thirds);
    orb_match_free(ctx, &match);
    shape_free(ctx, &mesh[0]);
    shape_free(ctx, &mesh[1]);
    orb_context_destroy(ctx);
  }
}

/* A further search begins on other small copies, and takes limbs to their limbs too. */
static void further_search_is_another_draw(void **state) {
  (void)state;
  static const double other[LIMBS] = {3.4, 4, 2.5, 2.9, 2.4};
  orb_context *ctx;
  orb_match match;
  assert_int_equal(orb_context_create(NULL, &ctx), ORB_OK);
  orb_mesh mesh[2] = {creature_of(ctx, reach, 3, 0), creature_of(ctx, other, 4, 2)};
  assert_int_equal(orb_match_find_again(ctx, &mesh[0], &mesh[1], 1, 1, &match), ORB_OK);
  assert_true(match.is_found);
  assert_int_equal(match.trials->small_size, ORB_FIND_SMALL + ORB_FIND_SMALL_AGAIN);
  assert_limbs(ctx, &match, mesh, 1, 2);
  orb_match_free(ctx, &match);
  shape_free(ctx, &mesh[0]);
  shape_free(ctx, &mesh[1]);
  orb_context_destroy(ctx);
}

/* The shape with long limbs moves, whichever of two comes first; of two that are alike, the second. */
static void less_round_shape_moves(void **state) {
  (void)state;
  static const double stout[LIMBS] = {2, 1.8, 1.7, 1.6, 1.5};
  orb_context *ctx;
  orb_match match;
  assert_int_equal(orb_context_create(NULL, &ctx), ORB_OK);
  orb_mesh lean = creature_of(ctx, reach, 3, 0), round = creature_of(ctx, stout, 3, 0);
  const orb_mesh *const pairs[][2] = {{&lean, &round}, {&round, &lean}, {&lean, &lean}};
  static const int moves[] = {0, 1, 1};
  for (int i = 0; i < (IS_SLOW ? 1 : 3); i++) {
    assert_int_equal(orb_match_find(ctx, pairs[i][0], pairs[i][1], NULL, 1, &match), ORB_OK);
    assert_true(match.is_found);
    assert_int_equal(match.moves, moves[i]);
    orb_match_free(ctx, &match);
  }
  shape_free(ctx, &lean);
  shape_free(ctx, &round);
  orb_context_destroy(ctx);
}

/* The list of maps of a creature with five unlike limbs is sorted by cost, and no two maps pair the same vertices. */
static void others_differ(void **state) {
  (void)state;
  orb_context *ctx;
  orb_match match;
  assert_int_equal(orb_context_create(NULL, &ctx), ORB_OK);
  orb_mesh a = creature_of(ctx, reach, 3, 0), b = creature_of(ctx, reach, 4, 1);
  assert_int_equal(orb_match_find(ctx, &a, &b, NULL, 1, &match), ORB_OK);
  assert_in_range(match.other_count, 1, ORB_MATCH_OTHERS);
  double before = 1;
  for (int i = 0; i < match.other_count; i++) {
    const orb_match_other *other = &match.other[i];
    assert_true(other->cost >= before);
    before = other->cost;
    assert_true(other->pairs.count >= 3);
    assert_memory_not_equal(&other->pairs, &match.pairs, sizeof match.pairs);
    for (int k = 0; k < i; k++) {
      assert_memory_not_equal(&other->pairs, &match.other[k].pairs, sizeof match.pairs);
    }
  }
  assert_true(fabs(match.clear - (1 - 1 / match.other[0].cost)) < 1e-12);
  orb_match_free(ctx, &match);
  shape_free(ctx, &a);
  shape_free(ctx, &b);
  orb_context_destroy(ctx);
}

/* If another map is chosen, it takes the place of the best one, the best one becomes the first of the others, and the
 * target is that of the chosen map. */
static void another_map_is_chosen(void **state) {
  (void)state;
  orb_context *ctx;
  orb_match match;
  double *target;
  assert_int_equal(orb_context_create(NULL, &ctx), ORB_OK);
  orb_mesh a = creature_of(ctx, reach, 3, 0), b = creature_of(ctx, reach, 4, 1);
  assert_int_equal(orb_match_find(ctx, &a, &b, NULL, 1, &match), ORB_OK);
  assert_in_range(match.other_count, 1, ORB_MATCH_OTHERS);
  const int32_t last = match.other_count - 1;
  const orb_match_pairs best = match.pairs, chosen = match.other[last].pairs;
  assert_int_equal(orb_match_target(ctx, &match, 0, 1, &match.target), ORB_OK);
  assert_int_equal(orb_match_target(ctx, &match, 1 + last, 1, &target), ORB_OK);
  assert_memory_not_equal(target, match.target, 3 * (size_t)b.vertex_count * sizeof *target);
  assert_int_equal(orb_match_choose(ctx, &match, last, target, 0.25), ORB_OK);
  assert_ptr_equal(match.target, target);
  assert_memory_equal(&match.pairs, &chosen, sizeof chosen);
  assert_memory_equal(&match.other[0].pairs, &best, sizeof best);
  assert_true(match.clear == 0.25 && match.lead == 1);
  assert_true(match.other[0].cost == 1);
  orb_match_free(ctx, &match);
  shape_free(ctx, &a);
  shape_free(ctx, &b);
  orb_context_destroy(ctx);
}

/* Confidence rises with the lead of the best map and falls with its bend and its energy. The odds of
 * 3.5 + 0.5 · 3.8 are those of a rigid match that leads by far (docs/bench-confidence.md). */
static void confidence_is_monotone(void **state) {
  (void)state;
  assert_true(fabs(orb_match_confidence(0, 0.9, 10, 1) - 1 / (1 + exp(-3.5 - 0.5 * 3.8))) < 1e-12);
  assert_true(orb_match_confidence(0.05, 0.3, 2, 1.1) > orb_match_confidence(0.05, 0.1, 2, 1.1));
  assert_true(orb_match_confidence(0.05, 0.3, 2, 1.1) > orb_match_confidence(0.1, 0.3, 2, 1.1));
  assert_true(orb_match_confidence(0.05, 0.3, 2, 1.1) > orb_match_confidence(0.05, 0.3, 2, 1.2));
  assert_true(orb_match_confidence(0.05, 0.3, 2, NAN) < 0.01);
  assert_true(orb_match_confidence(0.05, 0.3, 2, INFINITY) < 0.01);
}

/* The corners of a ball's mesh, drawn onto a box. */
static orb_mesh box_of(orb_context *ctx, int levels) {
  orb_mesh mesh = shape_ball(ctx, levels);
  for (int32_t v = 0; v < mesh.vertex_count; v++) {
    double *p = mesh.positions + 3 * (size_t)v, most = 0;
    for (int k = 0; k < 3; k++) {
      most = fmax(most, fabs(p[k]));
    }
    for (int k = 0; k < 3; k++) {
      p[k] *= 1 / most;
    }
  }
  return mesh;
}

/* A ball with one bulge upwards. */
static orb_mesh pear_of(orb_context *ctx, int levels) {
  orb_mesh mesh = shape_ball(ctx, levels);
  for (int32_t v = 0; v < mesh.vertex_count; v++) {
    double *p = mesh.positions + 3 * (size_t)v, up = p[1];
    for (int k = 0; k < 3; k++) {
      p[k] *= 1 + 0.6 * exp(-4 * (1 - up));
    }
  }
  return mesh;
}

/* A rotation of a box onto itself also rotates what is mapped to it, so maps of a pear are equally good with its stem
 * at any face or at any corner. However little the map bends, the choice is arbitrary, and no match is called sure,
 * which begins at 0.8. */
static void symmetric_shapes_are_not_sure(void **state) {
  (void)state;
  orb_context *ctx;
  assert_int_equal(orb_context_create(NULL, &ctx), ORB_OK);
  for (int levels = IS_SLOW ? 4 : 3; levels < 5; levels++) {
    orb_match match;
    orb_mesh pear = pear_of(ctx, 4), box = box_of(ctx, levels);
    assert_int_equal(orb_match_find(ctx, &pear, &box, NULL, 1, &match), ORB_OK);
    assert_true(match.is_found && match.other_count > 0);
    assert_true(orb_match_confidence(match.bend, match.clear, match.lead, 1) < 0.8);
    orb_match_free(ctx, &match);
    shape_free(ctx, &pear);
    shape_free(ctx, &box);
  }
  orb_context_destroy(ctx);
}

/* Two maps of the same cost share the confidence, whatever else supports them. */
static void a_tie_is_shared(void **state) {
  (void)state;
  const double alone = orb_match_confidence(0, 1, 100, 1);
  assert_true(orb_match_confidence(0, 1, 1, 1) <= 0.5);
  assert_true(orb_match_confidence(0, 1, 1.05, 1) > orb_match_confidence(0, 1, 1, 1));
  assert_true(alone > 0.95 && orb_match_confidence(0, 1, 2, 1) > 0.99 * alone);
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

/* A match of two real shapes pairs the tips of the first, as named by landmarks set by hand, with the corresponding
 * tips of the second, and has at least `least` such pairs. Pairs elsewhere belong to no landmark. Skips if the shapes
 * are missing. */
static void assert_match(const char *first, const char *second, int marks, const int32_t *mark[2], int least,
                         double clear) {
  orb_context *ctx;
  orb_mesh mesh[2];
  orb_match best;
  assert_int_equal(orb_context_create(NULL, &ctx), ORB_OK);
  int found = shared_mesh(ctx, first, &mesh[0]);
  if (found) {
    assert_true(shared_mesh(ctx, second, &mesh[1]));
    assert_int_equal(orb_match_find(ctx, &mesh[0], &mesh[1], NULL, 1, &best), ORB_OK);
    int tips = 0;
    for (int k = 0; k < best.pairs.count; k++) {
      int at = nearest_of(&mesh[0], mark[0], marks, best.pairs.first[k]);
      if (is_at(&mesh[0], mark[0][at], best.pairs.first[k])) {
        assert_int_equal(nearest_of(&mesh[1], mark[1], marks, best.pairs.second[k]), at);
        tips++;
      }
    }
    assert_true(tips >= least && best.clear >= 0 && best.clear < clear);
    orb_match_free(ctx, &best);
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
 * though the map with the man facing backwards bends him hardly more. */
static void man_to_armadillo(void **state) {
  (void)state;
  static const int32_t man[] = {6615, 3218, 5906, 2445, 331}, armadillo[] = {10077, 9912, 14583, 14523, 13173};
  assert_match("human_man.obj", "armadillo_29k.obj", 5, (const int32_t *[]){man, armadillo}, 3, 0.9);
}

/* Four legs and the nose of a stout cow and a lean animal that faces a different way. */
static void cow_to_animal(void **state) {
  (void)state;
  if (IS_SLOW) {
    skip(); /* the man and the armadillo run the same code */
  }
  static const int32_t cow[] = {1759, 439, 1732, 410, 847}, animal[] = {6774, 1910, 6727, 6824, 1590};
  assert_match("spot.obj", "shrec381.off", 5, (const int32_t *[]){cow, animal}, 4, 1);
}

/* Whether so many true landmarks leave limbs open: one at the end of each of the first `told` limbs, the others where
 * no limb is. */
static int leave_open(int32_t count, int told) {
  static const double longer[LIMBS] = {6, 5, 4, 3, 3.5}, shorter[LIMBS] = {1.6, 1.8, 1.4, 1.3, 1.5};
  orb_context *ctx;
  assert_int_equal(orb_context_create(NULL, &ctx), ORB_OK);
  orb_mesh mesh[2] = {creature_of(ctx, longer, 4, 0), creature_of(ctx, shorter, 4, 0)};
  int32_t *vertex = orb_alloc(ctx, (size_t)count, sizeof *vertex);
  assert_non_null(vertex);
  for (int32_t i = 0, v = 0; i < count; i++) {
    if (i < told) {
      vertex[i] = tip_of(&mesh[0], i, 0);
      continue;
    }
    const double *p = mesh[0].positions;
    do {
      v += 7;
    } while (hypot(hypot(p[3 * v], p[3 * v + 1]), p[3 * v + 2]) > 1.01);
    vertex[i] = v;
  }
  const orb_match_hint hint = {.count = count,
                               .few = ORB_FIND_HINT_FEW,
                               .trusted = count,
                               .first = vertex,
                               .second = vertex,
                               .stretch = ORB_FIND_HINT_STRETCH_MOST,
                               .sure = ORB_FIND_HINT_STRETCH,
                               .asks_limbs = 1};
  orb_match match;
  assert_int_equal(orb_match_find(ctx, &mesh[0], &mesh[1], &hint, 1, &match), ORB_OK);
  assert_true(match.is_unlike && !match.is_found);
  const int open = match.leaves_open;
  orb_match_free(ctx, &match);
  orb_free(ctx, vertex);
  orb_mesh_free(ctx, &mesh[0]);
  orb_mesh_free(ctx, &mesh[1]);
  orb_context_destroy(ctx);
  return open;
}

/* Landmarks that exclude one body leave limbs open unless they lie at all ends but one. Many are taken to tell of all.
 */
static void open_limbs_are_told(void **state) {
  (void)state;
  assert_true(leave_open(ORB_FIND_HINT_FEW, 2));
  assert_true(leave_open(ORB_FIND_HINT_ALL - 1, 3));
  assert_false(leave_open(ORB_FIND_HINT_FEW, LIMBS - 1));
  assert_false(leave_open(ORB_FIND_HINT_ALL, 2));
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(limbs_go_to_limbs),
                                     cmocka_unit_test(further_search_is_another_draw),
                                     cmocka_unit_test(less_round_shape_moves),
                                     cmocka_unit_test(others_differ),
                                     cmocka_unit_test(another_map_is_chosen),
                                     cmocka_unit_test(confidence_is_monotone),
                                     cmocka_unit_test(symmetric_shapes_are_not_sure),
                                     cmocka_unit_test(a_tie_is_shared),
                                     cmocka_unit_test(man_to_armadillo),
                                     cmocka_unit_test(cow_to_animal),
                                     cmocka_unit_test(open_limbs_are_told)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
