/* Pins all shapes on a base that suits them all: for landmarks whose order differs much between the shapes. */
#include <string.h>

#include "align/pin/join.h"
#include "align/pin/joint.h"
#include "align/pin/patches.h"
#include "align/pin/relax.h"
#include "base/check.h"
#include "base/memory.h"

typedef struct joint {
  orb_sheet *sheets; /* copies that are refined */
  orb_paths *paths;
  int32_t *at, *limits;
  orb_sheet base;
} joint;

static orb_status run(orb_context *ctx, joint *j, const orb_sheet *given, int32_t shape_count, const int32_t *landmarks,
                      int32_t count, orb_preset preset, orb_pin_room *room, int *held) {
  for (int32_t s = 0; s < shape_count; s++) {
    ORB_TRY(orb_sheet_copy(ctx, &given[s], &j->sheets[s]));
    j->limits[s] = orb_pin_limit(&given[s], room->growth);
    for (int32_t k = 0; k < count; k++) {
      j->at[(size_t)s * (size_t)count + (size_t)k] = given[s].shape.landmark_vertices[landmarks[k]];
    }
  }
  ORB_TRY(orb_base_join(ctx, j->sheets, j->paths, shape_count, j->at, count, j->limits, &room->work, &j->base, held));
  for (int32_t s = 0; s < shape_count && *held; s++) {
    ORB_TRY(orb_patch_embed(ctx, &j->sheets[s], &j->base, j->at + (size_t)s * (size_t)count, &j->paths[s], &room->work,
                            held));
    if (*held) {
      ORB_TRY(orb_pin_slim(ctx, &j->sheets[s], landmarks, count, preset, &room->work));
    }
  }
  return ORB_OK;
}

orb_status orb_pin_joint(orb_context *ctx, orb_sheet *sheets, int32_t shape_count, const int32_t *landmarks,
                         int32_t count, orb_preset preset, orb_pin_room *room, int *held) {
  orb_status status = ORB_E_NO_MEMORY;
  joint j = {.sheets = ORB_NEW0(ctx, orb_sheet, shape_count), .paths = ORB_NEW0(ctx, orb_paths, shape_count)};
  j.at = ORB_NEW(ctx, int32_t, (size_t)shape_count * (size_t)count);
  j.limits = ORB_NEW(ctx, int32_t, shape_count);
  *held = 0;
  if (j.sheets && j.paths && j.at && j.limits) {
    status = run(ctx, &j, sheets, shape_count, landmarks, count, preset, room, held);
  }
  for (int32_t s = 0; s < shape_count; s++) {
    if (status == ORB_OK && *held) {
      orb_sheet_free(ctx, &sheets[s]);
      sheets[s] = j.sheets[s];
      memset(&j.sheets[s], 0, sizeof j.sheets[s]);
    }
    if (j.sheets) {
      orb_sheet_free(ctx, &j.sheets[s]);
    }
    if (j.paths) {
      orb_paths_free(ctx, &j.paths[s]);
    }
  }
  orb_sheet_free(ctx, &j.base);
  orb_free(ctx, j.sheets);
  orb_free(ctx, j.paths);
  orb_free(ctx, j.at);
  orb_free(ctx, j.limits);
  return status;
}
