#include "carry/skin.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/context.h"
#include "base/memory.h"

enum { CHECK_EVERY = 16384 };                /* vertices between two checks for cancellation */
enum { JOINTS_MOST = 16 * ORB_CARRY_BLEND }; /* of a blend: each vertex has at most four sets of four */
static const double STEP = 1.0 / (1 << 24);  /* multiples of it up to 1 are float32, and so are their sums */

/* Sorts the heaviest `most` to the front: by weight, then by number. */
static void sort_heaviest(int32_t *joints, double *weights, int32_t count, int32_t most) {
  for (int32_t i = 0; i < count && i < most; i++) {
    int32_t best = i;
    for (int32_t j = i + 1; j < count; j++) {
      if (weights[j] > weights[best] || (weights[j] == weights[best] && joints[j] < joints[best])) {
        best = j;
      }
    }
    int32_t joint = joints[i];
    double weight = weights[i];
    joints[i] = joints[best];
    weights[i] = weights[best];
    joints[best] = joint;
    weights[best] = weight;
  }
}

void orb_four_heaviest(int32_t *joints, double *weights, int32_t count, uint16_t joint[4], float weight[4]) {
  double sum = 0, exact = 0, rest = 1;
  sort_heaviest(joints, weights, count, 4);
  int32_t kept = count < 4 ? count : 4;
  for (int32_t i = 0; i < kept; i++) {
    sum += weights[i];
    exact += (double)(float)weights[i];
  }
  for (int32_t i = 0; i < 4; i++) {
    joint[i] = 0;
    weight[i] = 0;
  }
  if (!(sum > 0)) {
    weight[0] = 1;
    return;
  }
  int is_exact = exact == 1;
  for (int32_t i = 3; i >= 0; i--) { /* the heaviest gets what is left */
    double value = i < kept ? weights[i] / sum : 0;
    value = is_exact ? (i < kept ? (double)(float)weights[i] : 0) : i == 0 ? rest : round(value / STEP) * STEP;
    rest -= value;
    weight[i] = (float)value;
    joint[i] = value > 0 ? (uint16_t)joints[i] : 0;
  }
}

static void blend(const orb_carry_source *source, const orb_given_skin *given, int32_t v, uint16_t joint[4],
                  float weight[4]) {
  orb_blend from;
  int32_t joints[JOINTS_MOST], count = 0;
  double weights[JOINTS_MOST];
  orb_carry_blend(source, v, &from);
  for (int32_t b = 0; b < from.count; b++) {
    for (int32_t i = 0; i < given->influences; i++) {
      int64_t at = (int64_t)given->influences * from.vertex[b] + i;
      int32_t found = 0;
      if (!(given->weights[at] > 0)) {
        continue;
      }
      while (found < count && joints[found] != given->joints[at]) {
        found++;
      }
      if (found == count) {
        joints[count] = given->joints[at];
        weights[count++] = 0;
      }
      weights[found] += from.weight[b] * (double)given->weights[at];
    }
  }
  orb_four_heaviest(joints, weights, count, joint, weight);
}

orb_status orb_carry_skin(orb_context *ctx, const orb_carry_source *source, orb_carried_skin *out) {
  memset(out, 0, sizeof *out);
  out->given.skin = -1;
  if (!source->file->bytes) {
    return ORB_OK;
  }
  orb_given_file file = orb_carry_given(source);
  ORB_TRY(orb_given_skin_read(ctx, &file, &out->given));
  if (out->given.skin < 0) {
    return ORB_OK;
  }
  int32_t count = source->supermesh->vertex_count;
  out->joints = orb_alloc(ctx, (size_t)count, sizeof *out->joints);
  out->weights = orb_alloc(ctx, (size_t)count, sizeof *out->weights);
  orb_status status = out->joints && out->weights ? ORB_OK : ORB_E_NO_MEMORY;
  for (int32_t v = 0; status == ORB_OK && v < count; v++) {
    blend(source, &out->given, v, out->joints[v], out->weights[v]);
    status = v % CHECK_EVERY == 0 ? orb_context_check(ctx) : ORB_OK;
  }
  return status;
}

void orb_carried_skin_free(orb_context *ctx, orb_carried_skin *skin) {
  orb_given_skin_free(ctx, &skin->given);
  orb_free(ctx, skin->joints);
  orb_free(ctx, skin->weights);
  memset(skin, 0, sizeof *skin);
}
