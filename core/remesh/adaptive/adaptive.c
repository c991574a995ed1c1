/* The adaptive method: as few triangles as keep every shape within the tolerance, the bound proved (see match.h).
 *
 * The start holds every vertex of every shape; edges that stray are turned or split until the bound holds. Where that
 * comes to no end, the overlay of all shapes, which is exact, is the start instead. Where the shapes are wound about
 * each other so much that the overlay is huge, the start is the overlay of reduced shapes (see match_start.c), and
 * edges are only collapsed and turned: what holds the tolerance there has many times the triangles of the shapes in any
 * case, and the rest would take minutes for a few per cent. From then on no step leaves the tolerance. In rounds: edges
 * are collapsed, holes filled anew and neighbours merged, edges turned for well-shaped triangles, and vertices moved to
 * where the edges stray less, which makes room for the next round. Nor does any step leave more triangles turned in
 * space than it found; what the start had of them is mended in the first round, and if that leaves too many, the first
 * round is made again from the overlay, there or everywhere: the other rounds, which take most of the time, are made
 * but once. Where max_triangles asks for fewer triangles, the tolerance is raised step by step until they suffice. */
#include <math.h>

#include "base/check.h"
#include "remesh/adaptive/match.h"

enum { HOLDS = 32 };
/* Of how many triangles one may be turned after the first round, and once that is mended; one of how many is many; the
 * most work for a start from the overlay. */
enum { FEW = 3000, SOME = 1000, MANY = 100, OVERLAY_MOST = 120000 };
/* The overlay is huge, and the shapes wound about each other: it has so many triangles, and so many times theirs for
 * each shape after the first (shapes that lie well have four or five times theirs for each). */
enum { HUGE_OVERLAY = 600000, HUGE_GROWTH = 12 };

/* Later rounds gain a few per cent each. Large meshes, or many shapes, do without: their triangles are small against
 * the tolerance, and time counts. */
static int rounds_for(int64_t triangles, int32_t shapes) {
  int64_t work = triangles * shapes / 2;
  return work < 25000 ? 10 : work < 60000 ? 4 : 2;
}

/* Collapses, and mends turned triangles while there are vertices left to do it with. */
static orb_status first_round(orb_context *ctx, orb_match *match, double limit2, int64_t target, int strict) {
  ORB_TRY(orb_match_collapse(ctx, match, limit2, target, strict, 0));
  ORB_TRY(orb_match_compact(ctx, match));
  ORB_TRY(orb_match_turn_all(ctx, match, limit2, 0));
  return strict ? orb_match_mend(ctx, match, limit2) : ORB_OK;
}

/* The rounds after it, until they gain little. */
static orb_status later_rounds(orb_context *ctx, orb_match *match, double limit2, int64_t target, int strict,
                               int rounds) {
  int64_t before = orb_match_live(match), after = before;
  for (int round = 1; round < rounds && after > target; round++) {
    ORB_TRY(orb_match_move_all(ctx, match, limit2, NULL));
    ORB_TRY(orb_match_collapse(ctx, match, limit2, target, strict, 1));
    ORB_TRY(orb_match_merge_all(ctx, match, limit2, target));
    ORB_TRY(orb_match_turn_all(ctx, match, limit2, 0));
    after = orb_match_live(match);
    if ((before - after) * 100 < before) {
      break;
    }
    before = after;
  }
  return ORB_OK;
}

/* Refines until nothing strays: splits of edges may leave items of the triangles beside them too far away, and edges
 * that found no room to be split among needles find it once the needles are gone. Where that does not come to an end
 * the overlay is to be the start instead: `crept`. */
static orb_status hold(orb_context *ctx, orb_match *match, double tolerance) {
  double limit2 = tolerance * tolerance;
  int64_t strays = 1;
  for (int i = 0; i < HOLDS && strays > 0 && !match->crept; i++) {
    ORB_TRY(orb_match_refine(ctx, match, limit2, &strays));
    if (strays > 0 && i % 4 == 3 && !match->crept) {
      ORB_TRY(orb_match_turn_all(ctx, match, limit2, 1));
      ORB_TRY(first_round(ctx, match, limit2, 0, 1));
    }
  }
  match->crept |= strays > 0;
  return ORB_OK;
}

static orb_status begin(orb_context *ctx, orb_match *match, double limit2) {
  ORB_TRY(orb_match_turn_all(ctx, match, limit2, 1));
  return first_round(ctx, match, limit2, 0, 1);
}

static int64_t triangles_of(const orb_remesh_job *job) {
  int64_t inputs = 0;
  for (int32_t s = 0; s < job->shape_count; s++) {
    inputs += job->shapes[s].mesh.triangle_count;
  }
  return inputs;
}

/* Where the first round leaves too many triangles turned: again from the overlay around them; or from all of the
 * overlay, unless that is too large, if they are very many or that has not helped. */
static orb_status straighten(orb_context *ctx, const orb_remesh_job *job, orb_match *match, double tolerance,
                             int is_overlay) {
  int64_t turned = orb_match_turned(ctx, match), live = orb_match_live(match), inputs = triangles_of(job);
  if (turned * FEW <= live) {
    return ORB_OK;
  }
  int may = !is_overlay && inputs * job->shape_count <= OVERLAY_MOST, anew = may && turned * MANY > live;
  if (!anew) {
    ORB_TRY(orb_match_resolve(ctx, match, tolerance * tolerance));
    ORB_TRY(hold(ctx, match, tolerance));
    if (!match->crept) {
      ORB_TRY(begin(ctx, match, tolerance * tolerance));
      int64_t left = orb_match_turned(ctx, match);
      anew = may && left * 3 > turned * 2 && left * SOME > live;
    }
  }
  if (!anew && !match->crept) {
    return ORB_OK;
  }
  int needed = match->crept;
  if (needed) { /* of no use: what it holds is room for the overlay */
    orb_match_free(ctx, match);
  }
  orb_status status = orb_match_start_from_overlay(ctx, job, match);
  if (status == ORB_E_NOT_CERTIFIED && !needed) {
    orb_error_clear(ctx); /* what there is holds the bound, too, with more triangles turned */
    return ORB_OK;
  }
  return status == ORB_OK ? begin(ctx, match, tolerance * tolerance) : status;
}

/* For shapes that are wound about each other: the whole of it, to a net within the tolerance. */
static orb_status unwind(orb_context *ctx, const orb_remesh_job *job, double tolerance, orb_match *match) {
  double limit2 = tolerance * tolerance;
  ORB_TRY(orb_match_start_from_reduced(ctx, job, limit2, match));
  orb_progress(ctx, "remesh", 0.3);
  ORB_TRY(hold(ctx, match, tolerance));
  if (match->crept) {
    orb_match_free(ctx, match);
    ORB_TRY(orb_match_start_from_overlay(ctx, job, match));
  }
  orb_progress(ctx, "remesh", 0.4);
  ORB_TRY(orb_match_collapse(ctx, match, limit2, 0, 1, 0));
  ORB_TRY(orb_match_compact(ctx, match));
  return orb_match_turn_all(ctx, match, limit2, 0);
}

/* From a start within the tolerance, by steps none of which leaves it. */
static orb_status settle(orb_context *ctx, const orb_remesh_job *job, orb_match *match, double tolerance,
                         int is_overlay) {
  double limit2 = tolerance * tolerance;
  int rounds = rounds_for(orb_match_live(match), match->shape_count);
  ORB_TRY(begin(ctx, match, limit2));
  ORB_TRY(straighten(ctx, job, match, tolerance, is_overlay));
  orb_progress(ctx, "remesh", 0.4);
  ORB_TRY(later_rounds(ctx, match, limit2, 0, 1, rounds));
  orb_progress(ctx, "remesh", 0.8);
  ORB_TRY(orb_match_mend(ctx, match, limit2));
  return first_round(ctx, match, limit2, 0, 1);
}

/* Fewer triangles than `most`, by as little more tolerance as it takes. */
static orb_status relax(orb_context *ctx, orb_match *match, double tolerance, int64_t most) {
  while (orb_match_live(match) > most && tolerance < 4) {
    tolerance *= 1.25;
    double limit2 = tolerance * tolerance;
    int strict = tolerance < 0.05, rounds = rounds_for(orb_match_live(match), match->shape_count);
    ORB_TRY(first_round(ctx, match, limit2, most, strict));
    ORB_TRY(later_rounds(ctx, match, limit2, most, strict, rounds));
  }
  if (orb_match_live(match) > most) {
    return orb_fail(ctx, ORB_E_BAD_OPTION, "The shapes and landmarks need more than max_triangles = %lld; raise it.",
                    (long long)most);
  }
  return ORB_OK;
}

/* To a net within the tolerance, as small as it can well be made. */
static orb_status approach(orb_context *ctx, const orb_remesh_job *job, double tolerance, orb_match *match) {
  int64_t overlay = 0, others = job->shape_count - 1;
  if (others > 0) { /* one shape alone is its own overlay, and wound about nothing */
    ORB_TRY(orb_match_overlay_size(ctx, job, &overlay));
  }
  if (overlay > HUGE_OVERLAY && overlay > HUGE_GROWTH * others * triangles_of(job)) {
    orb_status status = unwind(ctx, job, tolerance, match);
    if (status != ORB_E_NOT_CERTIFIED) {
      return status;
    }
    orb_error_clear(ctx); /* the other way needs no overlay, perhaps */
    orb_match_free(ctx, match);
  }
  ORB_TRY(orb_match_create(ctx, job, match));
  orb_progress(ctx, "remesh", 0.15);
  ORB_TRY(orb_match_turn_all(ctx, match, INFINITY, 1));
  ORB_TRY(hold(ctx, match, tolerance));
  int is_overlay = match->crept;
  if (is_overlay) {
    orb_match_free(ctx, match);
    ORB_TRY(orb_match_start_from_overlay(ctx, job, match));
  }
  return settle(ctx, job, match, tolerance, is_overlay);
}

orb_status orb_remesh_adaptive(orb_context *ctx, const orb_remesh_job *job, orb_supermesh *out) {
  orb_match match = {0};
  double tolerance = job->options->tolerance * (1 - 1e-9) - 1e-12; /* so that rounding of the bound finds room */
  int64_t most = job->options->max_triangles;
  orb_status status = approach(ctx, job, tolerance, &match);
  if (status == ORB_OK && most > 0) {
    status = relax(ctx, &match, tolerance, most);
  }
  orb_progress(ctx, "remesh", 0.9);
  if (status == ORB_OK) {
    status = orb_match_export(ctx, &match, out);
  }
  orb_match_free(ctx, &match);
  return status;
}
