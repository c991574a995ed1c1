/* The entry: checks the request and chooses between given.c and auto.c. */
#include "orbmorph/align.h"

#include <math.h>
#include <string.h>

#include "align/find/suspects.h"
#include "align/methods.h"
#include "base/check.h"
#include "base/context.h"
#include "base/error.h"

void orb_align_defaults(orb_align_options *options) {
  memset(options, 0, sizeof *options);
  options->method = ORB_ALIGN_PIN;
  options->rbf_steps = 10;
}

static orb_status check_weights(orb_context *ctx, const orb_landmark *landmarks, int32_t landmark_count,
                                const orb_align_options *options) {
  for (int32_t l = 0; l < landmark_count; l++) {
    const double weight = landmarks[l].weight;
    if (!(weight >= 0 && weight <= 1)) {
      return orb_fail(ctx, ORB_E_BAD_OPTION, "The weight of landmark %d is not between 0 and 1.", l);
    }
    if (weight > 0 && weight < 1 && options->method != ORB_ALIGN_PIN && options->method != ORB_ALIGN_AUTO) {
      return orb_fail(ctx, ORB_E_BAD_OPTION,
                      "Landmark %d has a weight below 1, which the method pin alone understands. Choose pin, or leave "
                      "the weight out.",
                      l);
    }
  }
  return ORB_OK;
}

static orb_status check_request(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                                int32_t landmark_count, const orb_align_options *options) {
  if (shape_count < 1 || landmark_count < 0) {
    return orb_fail(ctx, ORB_E_BAD_OPTION, "At least one shape must be given.");
  }
  if ((options->method == ORB_ALIGN_PIN || options->method == ORB_ALIGN_RBF) && landmark_count == 0) {
    return orb_fail(ctx, ORB_E_BAD_OPTION,
                    "This alignment needs landmarks; give some, or use the method rotate or auto.");
  }
  if (options->method < ORB_ALIGN_PIN || options->method > ORB_ALIGN_AUTO || options->rbf_steps < 1 ||
      options->rbf_steps > 10000 || !(options->rbf_radius >= 0) || !(options->max_growth >= 0)) {
    return orb_fail(ctx, ORB_E_BAD_OPTION,
                    "An alignment option is out of range: 1 to 10000 steps, radius ≥ 0, growth ≥ 0.");
  }
  for (int32_t s = 0; s < shape_count; s++) {
    if (!shapes[s].mesh || !shapes[s].points || shapes[s].mesh->triangle_count < 4) {
      return orb_fail(ctx, ORB_E_BAD_OPTION, "Shape %d has no embedding.", s);
    }
  }
  return ORB_OK;
}

orb_status orb_align(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                     const orb_landmark *landmarks, int32_t landmark_count, const orb_align_options *options,
                     orb_alignment *out) {
  memset(out, 0, sizeof *out);
  ORB_TRY(check_request(ctx, shapes, shape_count, landmark_count, options));
  ORB_TRY(check_weights(ctx, landmarks, landmark_count, options));
  const char *before = orb_progress_only(ctx, "align"); /* hides the stages of the embeddings that alignment makes */
  orb_status status;
  if (options->method == ORB_ALIGN_AUTO && landmark_count == 0 && shape_count > 1) {
    status = orb_align_auto(ctx, shapes, shape_count, options, out);
  } else {
    status = orb_align_given(ctx, shapes, shape_count, landmarks, landmark_count, options, out);
    status = status == ORB_OK ? orb_align_suspects(ctx, shapes, landmarks, options, out) : status;
  }
  if (status != ORB_OK) {
    orb_alignment_free(ctx, out);
  }
  if (status == ORB_OK) {
    orb_progress(ctx, "align", 1);
  }
  (void)orb_progress_only(ctx, before);
  return status;
}
