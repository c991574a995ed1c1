/* Method `pin`: landmarks are constraints of the embeddings. The walk on a coarse level nearly always succeeds. Where
 * it fails, because landmarks would have to pass through each other or a level has too little room, traced patches
 * succeed: a piecewise linear map with enough triangles carries any distinct points of a sphere to any others. */
#include "align/pin/pin.h"

#include <string.h>

#include "align/pin/joint.h"
#include "align/pin/patches.h"
#include "align/pin/walk.h"
#include "align/rotate/rotate.h"
#include "align/sheet/landmarks.h"
#include "base/check.h"
#include "base/error.h"
#include "base/memory.h"

/* Chosen by trial. */
enum {
  COARSE = 300,          /* least vertices of the level of the first walk, */
  COARSE_A_LANDMARK = 6, /* and for each landmark */
  WALKS = 2              /* walks, each on a level of twice as many vertices */
};
/* Growth of a sheet, relative to its triangles, that is tried first: enough for landmarks that merely cross. */
static const double GROWTH_SMALL = 0.35;
/* Visits of nodes and vertices, see orb_pin_room, of each trial in the search for the landmark to name. */
static const int64_t WORK_OF_TRIAL = 80000000;

/* Moves all other shapes onto the landmarks of shape 0, whose embedding stays. *stuck: the first shape for which that
 * failed; 0: none. */
static orb_status carry_onto_first(orb_context *ctx, orb_sheet *sheets, int32_t shape_count, const int32_t *landmarks,
                                   int32_t count, orb_preset preset, orb_pin_room *room, int32_t *stuck) {
  orb_status status = ORB_OK;
  double *points = NULL;
  *stuck = 0;
  ORB_GO(status, orb_rotate_by_landmarks(ctx, sheets, shape_count, landmarks, count), end);
  ORB_GO(status, orb_landmark_points(ctx, sheets, shape_count, landmarks, count, &points), end);
  for (int32_t s = 1; s < shape_count; s++) {
    int held = 0;
    ORB_GO(status, orb_pin_patches(ctx, &sheets[s], landmarks, count, points, preset, room, &held), end);
    if (!held) {
      *stuck = s;
      break;
    }
  }
end:
  orb_free(ctx, points);
  return status;
}

/* Tries the ways one after the other. *held 0: all failed, the last on shape *shape, and sheets may have been rotated
 * or refined. */
static orb_status meet(orb_context *ctx, orb_sheet *sheets, int32_t shape_count, const int32_t *landmarks,
                       int32_t count, const orb_align_options *options, int64_t work, int *held, int32_t *shape) {
  orb_preset preset = options->preset;
  orb_walk_options walk = {.preset = preset,
                           .coarse = COARSE_A_LANDMARK * count > COARSE ? COARSE_A_LANDMARK * count : COARSE};
  double most = options->max_growth > 0 ? options->max_growth : ORB_PIN_GROWTH;
  orb_pin_room room = {most < GROWTH_SMALL ? most : GROWTH_SMALL, work};
  int stuck = 1;
  *held = 1;
  *shape = 0;
  for (int attempt = 0; attempt < WALKS && stuck; attempt++, walk.coarse *= 2) {
    ORB_TRY(orb_pin_walk(ctx, sheets, shape_count, landmarks, count, &walk, NULL, &stuck));
  }
  if (!stuck) {
    return ORB_OK;
  }
  ORB_TRY(carry_onto_first(ctx, sheets, shape_count, landmarks, count, preset, &room, shape));
  if (*shape == 0) {
    return ORB_OK;
  }
  *held = 0;
  room = (orb_pin_room){most, room.work > work / 2 ? room.work : work / 2}; /* leaves the next stage a chance */
  if (count >= 4) {
    ORB_TRY(orb_pin_joint(ctx, sheets, shape_count, landmarks, count, preset, &room, held));
  }
  if (!*held) {
    ORB_TRY(carry_onto_first(ctx, sheets, shape_count, landmarks, count, preset, &room, shape));
    *held = *shape == 0;
  }
  return ORB_OK;
}

/* The same on copies, which are freed. */
static orb_status could_meet(orb_context *ctx, const orb_sheet *sheets, int32_t shape_count, const int32_t *landmarks,
                             int32_t count, const orb_align_options *options, int *held) {
  orb_status status = ORB_OK;
  int32_t shape;
  orb_sheet *copies = ORB_NEW0(ctx, orb_sheet, shape_count);
  if (!copies) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t s = 0; s < shape_count; s++) {
    ORB_GO(status, orb_sheet_copy(ctx, &sheets[s], &copies[s]), end);
  }
  status = meet(ctx, copies, shape_count, landmarks, count, options, WORK_OF_TRIAL, held, &shape);
end:
  for (int32_t s = 0; s < shape_count; s++) {
    orb_sheet_free(ctx, &copies[s]);
  }
  orb_free(ctx, copies);
  return status;
}

/* Names the first landmark that cannot be met together with those before it. */
static orb_status refuse(orb_context *ctx, const orb_sheet *sheets, int32_t shape_count, const int32_t *landmarks,
                         int32_t count, const orb_align_options *options, int32_t shape) {
  int32_t fine = 0, most = count;
  while (most - fine > 1) {
    int32_t middle = fine + (most - fine) / 2;
    int held;
    ORB_TRY(could_meet(ctx, sheets, shape_count, landmarks, middle, options, &held));
    fine = held ? middle : fine;
    most = held ? most : middle;
  }
  orb_status status = orb_fail(ctx, ORB_E_BAD_LANDMARKS,
                               "Landmark %d cannot be met on shape %d together with the landmarks before it: the map "
                               "would have to wind around them too tightly. Move it or remove it.",
                               landmarks[most - 1], shape);
  orb_error *error = orb_context_error_edit(ctx);
  error->shape = shape;
  error->landmark_count = 1;
  error->landmarks[0] = landmarks[most - 1];
  return status;
}

orb_status orb_align_pin(orb_context *ctx, orb_sheet *sheets, int32_t shape_count, const int32_t *landmarks,
                         int32_t count, const orb_align_options *options) {
  int held;
  int32_t shape;
  ORB_TRY(meet(ctx, sheets, shape_count, landmarks, count, options, ORB_PIN_WORK, &held, &shape));
  return held ? ORB_OK : refuse(ctx, sheets, shape_count, landmarks, count, options, shape);
}
