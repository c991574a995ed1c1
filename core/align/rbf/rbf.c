/* Method `rbf`: exact alignment by radial basis functions (Peng & Timalsena 2016, section 7.2), in small certified
 * steps.
 *
 * After the rotations each landmark has a target: the spherical mean of its points, or, one-way, its point on the first
 * shape. A step warps the whole sphere so that the landmarks advance by a share of their way, and projects back. The
 * warp can fold, so each step is certified. A fold is untangled locally with the landmarks held; where that fails, the
 * step is halved; where halving does not help, the embedding is relaxed before the step, which gives room. If that
 * fails too, the landmarks cross on their way, and the patches of pin carry them over. Landmarks of a later pass move
 * only after those of earlier passes have met, and these then stay.
 */
#include <math.h>
#include <string.h>

#include "align/pin/patches.h"
#include "align/pin/relax.h"
#include "align/rbf/rbf.h"
#include "align/rbf/warp.h"
#include "align/rotate/procrustes.h"
#include "align/rotate/rotate.h"
#include "align/sheet/landmarks.h"
#include "align/sheet/untangle.h"
#include "base/check.h"
#include "base/context.h"
#include "base/error.h"
#include "base/memory.h"
#include "numeric/vec3.h"

/* Counts were chosen by trial. */
enum {
  HALVINGS = 4,     /* of a step before the sphere is relaxed */
  RELAXATIONS = 8,  /* before the patches of pin take over */
  RELAX_SWEEPS = 20 /* of a relaxation */
};
static const double DEFAULT_RADIUS = 1.0; /* chord on the unit sphere: a sixth of the circumference */
static const double LAST_SHARE = 1e-9; /* of the way: less is rounding of the sum of steps, and joins the last step */
static const double LEAST_MEAN = 1e-3; /* length of a mean of unit vectors: opposite points have no shorter one */

typedef struct rbf_run {
  orb_context *ctx;
  orb_sheet *sheet;
  int32_t shape;
  const int32_t *active; /* landmarks of the request that take part */
  int32_t count;
  const double *targets, *radii; /* of the active ones */
  double *centres, *moves, *before;
  unsigned char *held;
} rbf_run;

static int32_t vertex_of(const rbf_run *r, int32_t k) {
  return r->sheet->shape.landmark_vertices[r->active[k]];
}

/* The point of landmark k after `share` of the remaining way; for the whole way, the target bit for bit. */
static void next_place(const rbf_run *r, int32_t k, double share, double out[3]) {
  const double *p = r->sheet->shape.points + 3 * (size_t)vertex_of(r, k), *target = r->targets + 3 * (size_t)k;
  for (int c = 0; c < 3; c++) {
    out[c] = share >= 1 ? target[c] : p[c] + share * (target[c] - p[c]);
  }
  if (share < 1) {
    orb_normalize(out);
  }
}

/* One step. *good 0: its fold cannot be untangled, and nothing has changed. */
static orb_status try_step(rbf_run *r, double share, int *good) {
  orb_sheet *s = r->sheet;
  int32_t vertices = s->shape.mesh.vertex_count;
  size_t bytes = 3 * (size_t)vertices * sizeof(double);
  orb_warp warp;
  double *next = r->moves + 3 * (size_t)r->count;
  for (int32_t k = 0; k < r->count; k++) {
    memcpy(r->centres + 3 * (size_t)k, s->shape.points + 3 * (size_t)vertex_of(r, k), 3 * sizeof(double));
    next_place(r, k, share, next + 3 * (size_t)k);
    orb_sub(next + 3 * (size_t)k, r->centres + 3 * (size_t)k, r->moves + 3 * (size_t)k);
  }
  ORB_TRY(orb_warp_create(r->ctx, r->centres, r->moves, r->radii, r->count, &warp));
  memcpy(r->before, s->shape.points, bytes);
  orb_warp_apply(r->ctx, &warp, r->before, vertices, s->shape.points);
  orb_warp_free(r->ctx, &warp);
  for (int32_t k = 0; k < r->count; k++) {
    memcpy(s->shape.points + 3 * (size_t)vertex_of(r, k), next + 3 * (size_t)k, 3 * sizeof(double));
  }
  int64_t left = 0;
  orb_certificate certificate = {0};
  ORB_TRY(orb_untangle(r->ctx, s, r->held, &left));
  if (left == 0) {
    ORB_TRY(orb_certify(r->ctx, s->shape.points, vertices, s->shape.mesh.triangles, s->shape.mesh.triangle_count,
                        &certificate));
  }
  *good = certificate.valid;
  if (!*good) {
    memcpy(s->shape.points, r->before, bytes);
  }
  return ORB_OK;
}

static orb_status refuse(const rbf_run *r) {
  orb_status status =
      orb_fail(r->ctx, ORB_E_BAD_LANDMARKS,
               "The warp folds shape %d near some landmarks and cannot be repaired: they may be crossed. "
               "Move or drop them, or use the method pin.",
               r->shape);
  orb_error *error = orb_context_error_edit(r->ctx);
  error->shape = r->shape;
  for (int32_t k = 0; k < r->count && error->landmark_count < ORB_ERROR_ITEMS; k++) {
    if (memcmp(r->sheet->shape.points + 3 * (size_t)vertex_of(r, k), r->targets + 3 * (size_t)k, 3 * sizeof(double))) {
      error->landmarks[error->landmark_count++] = r->active[k];
    }
  }
  return status;
}

static orb_status warp_shape(rbf_run *r, int32_t steps) {
  double done = 0, step = 1.0 / steps;
  for (int halvings = 0, relaxations = 0; done < 1;) {
    double share = done + step >= 1 - LAST_SHARE ? 1 : step / (1 - done);
    int good = 0;
    ORB_TRY(try_step(r, share, &good));
    ORB_TRY(orb_context_check(r->ctx));
    if (good) {
      done = share >= 1 ? 1 : done + step;
      step = step * 2 < 1.0 / steps ? step * 2 : 1.0 / steps;
      halvings = halvings > 0 ? halvings - 1 : 0;
    } else if (halvings < HALVINGS) {
      step /= 2;
      halvings++;
    } else if (relaxations < RELAXATIONS) {
      ORB_TRY(orb_pin_relax(r->ctx, r->sheet, r->active, r->count, ORB_PRESET_FAST, RELAX_SWEEPS));
      relaxations++;
    } else {
      orb_pin_room room = {ORB_PIN_GROWTH, ORB_PIN_WORK};
      ORB_TRY(orb_pin_patches(r->ctx, r->sheet, r->active, r->count, r->targets, ORB_PRESET_FAST, &room, &good));
      return good ? ORB_OK : refuse(r);
    }
  }
  return ORB_OK;
}

/* Sets where the active landmarks of all shapes will meet. */
static void set_targets(const orb_sheet *sheets, int32_t shape_count, const int32_t *active, int32_t count, int one_way,
                        double *targets) {
  for (int32_t k = 0; k < count; k++) {
    double sum[3] = {0, 0, 0}, *target = targets + 3 * (size_t)k;
    const double *first = NULL;
    int met = 1;
    for (int32_t s = 0; s < shape_count; s++) {
      const double *p = sheets[s].shape.points + 3 * (size_t)sheets[s].shape.landmark_vertices[active[k]];
      first = first ? first : p;
      met = met && memcmp(p, first, 3 * sizeof *p) == 0;
      for (int c = 0; c < 3; c++) {
        sum[c] += p[c];
      }
    }
    memcpy(target, one_way || met ? first : sum, 3 * sizeof *target);
    if (!one_way && !met && orb_normalize(target) < LEAST_MEAN * shape_count) {
      memcpy(target, first, 3 * sizeof *target);
    }
  }
}

static orb_status run_shape(orb_context *ctx, orb_sheet *sheet, int32_t shape, const int32_t *active, int32_t count,
                            const double *targets, const double *radii, int32_t steps) {
  orb_status status = ORB_OK;
  size_t vertices = (size_t)sheet->shape.mesh.vertex_count;
  rbf_run r = {.ctx = ctx, .sheet = sheet, .shape = shape, .active = active, .count = count};
  r.targets = targets;
  r.radii = radii;
  r.centres = ORB_NEW(ctx, double, 3 * (size_t)count);
  r.moves = ORB_NEW(ctx, double, 6 * (size_t)count);
  r.before = ORB_NEW(ctx, double, 3 * vertices);
  r.held = ORB_NEW0(ctx, unsigned char, vertices);
  if (!r.centres || !r.moves || !r.before || !r.held) {
    status = ORB_E_NO_MEMORY;
    goto end;
  }
  for (int32_t k = 0; k < count; k++) {
    r.held[vertex_of(&r, k)] = 1;
  }
  status = warp_shape(&r, steps);
end:
  orb_free(ctx, r.centres);
  orb_free(ctx, r.moves);
  orb_free(ctx, r.before);
  orb_free(ctx, r.held);
  return status;
}

orb_status orb_align_rbf(orb_context *ctx, orb_sheet *sheets, int32_t shape_count, const orb_landmark *given,
                         const int32_t *landmarks, int32_t count, const orb_align_options *options) {
  orb_status status = ORB_OK;
  int32_t *active = ORB_NEW(ctx, int32_t, count);
  double *targets = ORB_NEW(ctx, double, 3 * (size_t)count), *radii = ORB_NEW(ctx, double, count);
  if (!active || !targets || !radii) {
    status = ORB_E_NO_MEMORY;
    goto end;
  }
  ORB_GO(status, orb_rotate_by_landmarks(ctx, sheets, shape_count, landmarks, count), end);
  int32_t taken = 0;
  for (int32_t pass = INT32_MIN; taken < count;) {
    int32_t next = INT32_MAX;
    for (int32_t k = 0; k < count; k++) {
      int32_t own = given[landmarks[k]].pass;
      next = (own > pass || taken == 0) && own < next ? own : next;
    }
    for (int32_t k = 0; k < count; k++) {
      const orb_landmark *landmark = &given[landmarks[k]];
      if (landmark->pass == next) {
        radii[taken] = landmark->radius > 0      ? landmark->radius
                       : options->rbf_radius > 0 ? options->rbf_radius
                                                 : DEFAULT_RADIUS;
        active[taken++] = landmarks[k];
      }
    }
    pass = next;
    set_targets(sheets, shape_count, active, taken, options->one_way, targets);
    for (int32_t s = options->one_way ? 1 : 0; s < shape_count; s++) {
      ORB_GO(status, run_shape(ctx, &sheets[s], s, active, taken, targets, radii, options->rbf_steps), end);
      orb_progress(ctx, "align", (double)taken / count * (s + 1) / shape_count);
    }
  }
end:
  orb_free(ctx, active);
  orb_free(ctx, targets);
  orb_free(ctx, radii);
  return status;
}
