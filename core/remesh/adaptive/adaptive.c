/* The adaptive method: as few triangles as keep every shape within the tolerance, the bound proved (placed/bound.h).
 *
 * The start is optimistic: each shape alone is thinned out by a quadric (thin.h), and the net holds the vertices that
 * are left. Then the method proves: it flips or splits edges that deviate until the bound holds. If that does not end,
 * or leaves many inverted triangles, the method starts from the overlay of all shapes instead, which is exact. If the
 * map is so twisted that the overlay is huge, the method starts from the overlay of reduced shapes (start.h), and only
 * collapses and flips edges: such a supermesh needs many times the triangles of the shapes in any case, and the other
 * steps would take minutes to save a few per cent.
 *
 * From then on no step leaves the tolerance, and none leaves more inverted triangles than it found. The first round
 * collapses and flips edges and repairs the inverted triangles of the start. If too many remain, it is repeated from
 * the overlay, around them or everywhere. The second round merges neighbours at points between them (merge.h), which
 * removes what no collapse can. Where max_triangles asks for fewer triangles, the tolerance is raised step by step
 * until they suffice. */
#include "remesh/common/job.h"

#include <math.h>

#include "base/check.h"
#include "base/context.h"
#include "base/error.h"
#include "base/memory.h"
#include "remesh/adaptive/collapse.h"
#include "remesh/adaptive/merge.h"
#include "remesh/adaptive/move.h"
#include "remesh/adaptive/repair.h"
#include "remesh/adaptive/resolve.h"
#include "remesh/adaptive/start.h"
#include "remesh/placed/export.h"
#include "remesh/placed/flip.h"
#include "remesh/placed/form.h"
#include "remesh/placed/refine.h"

enum { REFINEMENTS_MOST = 32 }; /* after this many, refinement counts as unable to finish the net */
/* If more than one triangle in FEW is inverted after the first round, a local overlay is worth its time. If more than
 * one in SOME remain after that, or more than one in MANY were inverted, the overlay of everything is. Larger numbers
 * spend more time on fewer inverted triangles. */
enum { FEW = 3000, SOME = 1000, MANY = 100 };
/* If the refined net has more inverted triangles than one in TWISTED, the overlay of everything is worth it at once. So
 * it is if the net has more than one in TWISTED_THIN before: of 124 maps, two had, and the refined net was too twisted;
 * a net with one in 10.8 was refined to one in 21, and kept. */
enum { TWISTED = 7, TWISTED_THIN = 10 };
/* A second start, from the overlay, is affordable up to this many shapes times triangles. */
enum { OVERLAY_MOST = 120000 };
/* Merges are tried less from this many shapes times triangles on. */
enum { QUICK_FROM = 120000 };
/* The overlay is huge, and the map is twisted, if the overlay has more than HUGE_OVERLAY triangles and, for each shape
 * after the first, more than HUGE_GROWTH times the triangles of all shapes. Well aligned shapes have four or five times
 * as many for each. */
enum { HUGE_OVERLAY = 600000, HUGE_GROWTH = 12 };
/* The guessed deviation up to which each shape is thinned out alone, as a share of the tolerance. It is above 1,
 * because the guess is a mean and splits bring back what is needed: from 0.5 to 1.5 the result has the same size, and
 * the start takes the less time. */
static const double THIN = 1.2;
/* The same for the overlay. Less, because the overlay is for the sake of inverted triangles, and thinning can make
 * some. */
static const double THIN_OVERLAY = 0.5;
/* From this tolerance on, relative to the diagonal, fewer triangles matter more than inverted ones and slivers. */
static const double STRICT_MOST = 0.05;
/* The largest tolerance, relative to the diagonal: no distance on a shape exceeds 1, so more would not help. */
static const double TOLERANCE_MOST = 4;
/* The factor from step to step of the tolerance: smaller steps take longer and end nearer to the least tolerance. */
static const double RAISE = 1.25;

/* Collapses first, then repairs inverted triangles, while enough vertices are left for that. */
static orb_status first_round(orb_context *ctx, orb_placed_net *placed, double limit2, int64_t target, int strict) {
  ORB_TRY(orb_adaptive_collapse(ctx, placed, limit2, target, strict, 0));
  ORB_TRY(orb_placed_compact(ctx, placed));
  ORB_TRY(orb_placed_flip_all(ctx, placed, limit2, 0));
  return strict ? orb_adaptive_repair(ctx, placed, limit2) : ORB_OK;
}

static int64_t triangles_of(const orb_remesh_job *job) {
  int64_t inputs = 0;
  for (int32_t s = 0; s < job->shape_count; s++) {
    inputs += job->shapes[s].mesh.triangle_count;
  }
  return inputs;
}

/* Moves the corners of slivers and of inverted triangles to where their triangles are better shaped. */
static orb_status relax(orb_context *ctx, orb_placed_net *placed, double limit2) {
  const orb_net *net = &placed->net;
  unsigned char *which = ORB_NEW0(ctx, unsigned char, net->vertex_count);
  orb_status status = which ? ORB_OK : ORB_E_NO_MEMORY;
  for (int64_t t = 0; t < net->triangle_count && status == ORB_OK; t++) {
    const int32_t *c = net->triangles + 3 * t;
    orb_form form = c[0] >= 0 ? orb_placed_form(placed, c[0], c[1], c[2]) : ORB_FORM_BEST;
    for (int k = 0; k < 3 && (form.slivers || form.inverted); k++) {
      which[c[k]] = 1;
    }
  }
  if (status == ORB_OK) {
    status = orb_adaptive_move_all(ctx, placed, limit2, which);
  }
  orb_free(ctx, which);
  return status;
}

/* Merges neighbours, which removes what collapses cannot, and flips edges for well-shaped triangles. */
static orb_status second_round(orb_context *ctx, orb_placed_net *placed, double limit2, int64_t target) {
  int quick = triangles_of(placed->job) * placed->shape_count > QUICK_FROM;
  ORB_TRY(orb_adaptive_merge_all(ctx, placed, limit2, target, quick));
  ORB_TRY(orb_placed_flip_all(ctx, placed, limit2, 0));
  ORB_TRY(relax(ctx, placed, limit2));
  return orb_placed_flip_all(ctx, placed, limit2, 0);
}

/* Refines until nothing deviates. It takes several calls, because splits may leave items too far from the triangles
 * beside them, and because edges between needles can be split only once the needles are gone. Sets placed->gave_up
 * where that does not end: then the method must start from the overlay. */
static orb_status refine_fully(orb_context *ctx, orb_placed_net *placed, double tolerance) {
  double limit2 = tolerance * tolerance;
  int64_t deviating = 1;
  for (int i = 0; i < REFINEMENTS_MOST && deviating > 0 && !placed->gave_up; i++) {
    ORB_TRY(orb_placed_refine(ctx, placed, limit2, &deviating));
    if (deviating > 0 && i % 4 == 3 && !placed->gave_up) {
      ORB_TRY(orb_placed_flip_all(ctx, placed, limit2, 1));
      ORB_TRY(first_round(ctx, placed, limit2, 0, 1));
    }
  }
  placed->gave_up |= deviating > 0;
  return ORB_OK;
}

/* Replaces the net by one on the thinned overlay, within the tolerance; or on the exact one, if that cannot be refined.
 */
static orb_status start_from_overlay(orb_context *ctx, const orb_remesh_job *job, double tolerance,
                                     orb_placed_net *placed) {
  double thin = THIN_OVERLAY * tolerance;
  ORB_TRY(orb_adaptive_start_from_overlay(ctx, job, thin * thin, placed));
  ORB_TRY(refine_fully(ctx, placed, tolerance));
  return placed->gave_up ? orb_adaptive_start_from_overlay(ctx, job, 0, placed) : ORB_OK;
}

static orb_status begin(orb_context *ctx, orb_placed_net *placed, double limit2) {
  ORB_TRY(orb_placed_flip_all(ctx, placed, limit2, 1));
  return first_round(ctx, placed, limit2, 0, 1);
}

/* Whether a start from the overlay is affordable. */
static int may_overlay(const orb_remesh_job *job) {
  return triangles_of(job) * job->shape_count <= OVERLAY_MOST;
}

/* Whether the net has so many inverted triangles, more than one in `most`, that the first round would leave too many of
 * them. */
static int expects_many_inverted(orb_context *ctx, const orb_remesh_job *job, orb_placed_net *placed, int64_t most) {
  return may_overlay(job) && orb_placed_count_inverted(ctx, placed) * most > orb_placed_live(placed);
}

/* If the first round leaves too many triangles inverted, repeats it from the overlay around them. If they are very
 * many, or the local overlay has not helped, repeats it from the whole overlay, unless that is too large. */
static orb_status reduce_inverted(orb_context *ctx, const orb_remesh_job *job, orb_placed_net *placed, double tolerance,
                                  int is_overlay) {
  int64_t inverted = orb_placed_count_inverted(ctx, placed), live = orb_placed_live(placed);
  if (inverted * FEW <= live) {
    return ORB_OK;
  }
  int may = !is_overlay && may_overlay(job), anew = may && inverted * MANY > live;
  if (!anew) {
    ORB_TRY(orb_adaptive_resolve(ctx, placed, tolerance * tolerance));
    ORB_TRY(refine_fully(ctx, placed, tolerance));
    if (!placed->gave_up) {
      ORB_TRY(begin(ctx, placed, tolerance * tolerance));
      int64_t left = orb_placed_count_inverted(ctx, placed);
      anew = may && left * 3 > inverted * 2 && left * SOME > live;
    }
  }
  if (!anew && !placed->gave_up) {
    return ORB_OK;
  }
  int needed = placed->gave_up;
  if (needed) { /* the net is useless: its memory serves the overlay */
    orb_placed_free(ctx, placed);
  }
  orb_status status = start_from_overlay(ctx, job, tolerance, placed);
  if (status == ORB_E_NOT_CERTIFIED && !needed) {
    orb_error_clear(ctx); /* the current net keeps the bound too, with more triangles inverted */
    return ORB_OK;
  }
  return status == ORB_OK ? begin(ctx, placed, tolerance * tolerance) : status;
}

/* For a twisted map: all steps, to a net within the tolerance. */
static orb_status remesh_twisted(orb_context *ctx, const orb_remesh_job *job, double tolerance,
                                 orb_placed_net *placed) {
  double limit2 = tolerance * tolerance;
  ORB_TRY(orb_adaptive_start_from_reduced(ctx, job, limit2, placed));
  orb_progress(ctx, "remesh", 0.3);
  ORB_TRY(refine_fully(ctx, placed, tolerance));
  if (placed->gave_up) {
    orb_placed_free(ctx, placed);
    ORB_TRY(orb_adaptive_start_from_overlay(ctx, job, 0, placed));
  }
  orb_progress(ctx, "remesh", 0.4);
  ORB_TRY(orb_adaptive_collapse(ctx, placed, limit2, 0, 1, 0));
  ORB_TRY(orb_placed_compact(ctx, placed));
  return orb_placed_flip_all(ctx, placed, limit2, 0);
}

/* All rounds, from a start within the tolerance. */
static orb_status all_rounds(orb_context *ctx, const orb_remesh_job *job, orb_placed_net *placed, double tolerance,
                             int is_overlay) {
  double limit2 = tolerance * tolerance;
  ORB_TRY(begin(ctx, placed, limit2));
  ORB_TRY(reduce_inverted(ctx, job, placed, tolerance, is_overlay));
  orb_progress(ctx, "remesh", 0.4);
  ORB_TRY(second_round(ctx, placed, limit2, 0));
  orb_progress(ctx, "remesh", 0.8);
  ORB_TRY(orb_adaptive_repair(ctx, placed, limit2));
  return first_round(ctx, placed, limit2, 0, 1);
}

/* Raises the tolerance, in steps of a quarter, until at most `most` triangles live. */
static orb_status reduce_to(orb_context *ctx, orb_placed_net *placed, double tolerance, int64_t most) {
  while (orb_placed_live(placed) > most && tolerance < TOLERANCE_MOST) {
    tolerance *= RAISE;
    double limit2 = tolerance * tolerance;
    ORB_TRY(first_round(ctx, placed, limit2, most, tolerance < STRICT_MOST));
    ORB_TRY(second_round(ctx, placed, limit2, most));
  }
  if (orb_placed_live(placed) > most) {
    return orb_fail(ctx, ORB_E_BAD_OPTION, "The shapes and landmarks need more than max_triangles = %lld; raise it.",
                    (long long)most);
  }
  return ORB_OK;
}

/* Makes the net within the tolerance. */
static orb_status remesh_within(orb_context *ctx, const orb_remesh_job *job, double tolerance, orb_placed_net *placed) {
  int64_t overlay = 0, others = job->shape_count - 1;
  if (others > 0) { /* a single shape is its own overlay */
    ORB_TRY(orb_adaptive_overlay_size(ctx, job, &overlay));
  }
  if (overlay > HUGE_OVERLAY && overlay > HUGE_GROWTH * others * triangles_of(job)) {
    orb_status status = remesh_twisted(ctx, job, tolerance, placed);
    if (status != ORB_E_NOT_CERTIFIED) {
      return status;
    }
    orb_error_clear(ctx); /* the other way may do without an overlay */
    orb_placed_free(ctx, placed);
  }
  double thin = THIN * tolerance;
  ORB_TRY(orb_adaptive_start_from_thinned(ctx, job, thin * thin, placed));
  orb_progress(ctx, "remesh", 0.15);
  ORB_TRY(orb_placed_flip_all(ctx, placed, INFINITY, 1));
  int is_overlay = expects_many_inverted(ctx, job, placed, TWISTED_THIN);
  if (!is_overlay) {
    ORB_TRY(refine_fully(ctx, placed, tolerance));
    is_overlay = placed->gave_up || expects_many_inverted(ctx, job, placed, TWISTED);
  }
  if (is_overlay) {
    orb_placed_free(ctx, placed);
    ORB_TRY(start_from_overlay(ctx, job, tolerance, placed));
  }
  return all_rounds(ctx, job, placed, tolerance, is_overlay);
}

orb_status orb_remesh_adaptive(orb_context *ctx, const orb_remesh_job *job, orb_supermesh *out) {
  orb_placed_net placed = {0};
  double tolerance = orb_remesh_limit(job);
  int64_t most = job->options->max_triangles;
  orb_status status = remesh_within(ctx, job, tolerance, &placed);
  if (status == ORB_OK && most > 0) {
    status = reduce_to(ctx, &placed, tolerance, most);
  }
  orb_progress(ctx, "remesh", 0.9);
  if (status == ORB_OK) {
    status = orb_placed_export(ctx, &placed, out);
  }
  orb_placed_free(ctx, &placed);
  return status;
}
