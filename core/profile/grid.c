#include "profile/grid.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "format/gltf_write.h"

enum { SHORT = 5122, STRIDE = 8 };
/* The largest integer of the base, and the largest of a delta with room for the rounding of both ends. */
static const double GRID_MOST = 65535, DELTA_MOST = 32766;

typedef struct box {
  double least[3], most[3];
} box;

static void box_add(box *b, const double p[3]) {
  for (int c = 0; c < 3; c++) {
    b->least[c] = p[c] < b->least[c] ? p[c] : b->least[c];
    b->most[c] = p[c] > b->most[c] ? p[c] : b->most[c];
  }
}

static double box_diagonal(const box *b) {
  double sum = 0;
  for (int c = 0; c < 3; c++) {
    sum += (b->most[c] - b->least[c]) * (b->most[c] - b->least[c]);
  }
  return sqrt(sum);
}

/* boxes[0]: of the base; boxes[1 + k]: of target k at full weight. *delta: the largest coordinate of all deltas. */
static orb_status add_boxes(orb_context *ctx, const orb_source *source, const cJSON *primitive, int32_t targets,
                            box *boxes, double *delta) {
  int32_t base = orb_source_number(cJSON_GetObjectItemCaseSensitive(primitive, "attributes"), "POSITION"), frame = 0;
  if (base < 0 || base >= source->accessor_count ||
      !orb_source_is_floats(source, base, 3, source->accessors[base].count)) {
    return orb_source_corrupt(ctx);
  }
  int32_t count = source->accessors[base].count;
  const cJSON *target, *list = cJSON_GetObjectItemCaseSensitive(primitive, "targets");
  float *from = ORB_NEW(ctx, float, 3 * (size_t)count), *to = ORB_NEW(ctx, float, 3 * (size_t)count);
  orb_status status = from && to ? ORB_OK : ORB_E_NO_MEMORY;
  for (int32_t i = 0; status == ORB_OK && i < count; i++) {
    if (i == 0) {
      orb_source_floats(source, base, NULL, from);
    }
    box_add(&boxes[0], (double[]){(double)from[3 * i], (double)from[3 * i + 1], (double)from[3 * i + 2]});
  }
  cJSON_ArrayForEach(target, list) {
    int32_t number = orb_source_number(target, "POSITION");
    frame++;
    if (status == ORB_OK && (frame > targets || !orb_source_is_floats(source, number, 3, count))) {
      status = orb_source_corrupt(ctx);
    }
    status = status == ORB_OK ? orb_context_check(ctx) : status;
    if (status != ORB_OK) {
      break;
    }
    orb_source_floats(source, number, NULL, to);
    for (int32_t i = 0; i < count; i++) {
      double p[3];
      for (int32_t c = 0; c < 3; c++) {
        double d = (double)to[3 * (size_t)i + (size_t)c];
        p[c] = (double)from[3 * (size_t)i + (size_t)c] + d;
        *delta = fabs(d) > *delta ? fabs(d) : *delta;
      }
      box_add(&boxes[frame], p);
    }
  }
  status = status == ORB_OK && frame != targets ? orb_source_corrupt(ctx) : status;
  orb_free(ctx, from);
  orb_free(ctx, to);
  return status;
}

/* The nearest number with this many decimal digits: short in the JSON, which every asset carries. */
static double shortened(double value, int digits) {
  char text[40];
  snprintf(text, sizeof text, "%.*e", digits - 1, value);
  return strtod(text, NULL);
}

static void choose(const box *boxes, int32_t targets, double delta, int32_t levels, orb_grid *out) {
  double extent = 0;
  out->diagonal = box_diagonal(&boxes[0]);
  for (int32_t k = 1; k <= targets; k++) {
    double diagonal = box_diagonal(&boxes[k]);
    out->diagonal = diagonal < out->diagonal ? diagonal : out->diagonal;
  }
  for (int c = 0; c < 3; c++) {
    double width = boxes[0].most[c] - boxes[0].least[c];
    extent = width > extent ? width : extent;
  }
  /* The origin is a multiple of the step, so the base may take one level more. */
  double step = extent / (levels - 1) > delta / DELTA_MOST ? extent / (levels - 1) : delta / DELTA_MOST;
  step = step > 0x1p-120 ? step : 0x1p-120;
  out->step = shortened(step, 5) < step ? shortened(step * 1.0001, 5) : shortened(step, 5);
  for (int c = 0; c < 3; c++) {
    out->origin[c] = shortened(floor(boxes[0].least[c] / out->step) * out->step, 15);
  }
}

orb_status orb_grid_choose(orb_context *ctx, const orb_source *source, const cJSON *primitives, int32_t levels,
                           orb_grid *out) {
  const cJSON *primitive;
  int32_t targets = cJSON_GetArraySize(cJSON_GetObjectItemCaseSensitive(cJSON_GetArrayItem(primitives, 0), "targets"));
  box *boxes = ORB_NEW(ctx, box, targets + 1);
  orb_status status = boxes ? ORB_OK : ORB_E_NO_MEMORY;
  double delta = 0;
  for (int32_t k = 0; boxes && k <= targets; k++) {
    boxes[k] = (box){{DBL_MAX, DBL_MAX, DBL_MAX}, {-DBL_MAX, -DBL_MAX, -DBL_MAX}};
  }
  cJSON_ArrayForEach(primitive, primitives) {
    if (status == ORB_OK) {
      status = add_boxes(ctx, source, primitive, targets, boxes, &delta);
    }
  }
  if (status == ORB_OK) {
    choose(boxes, targets, delta, levels, out);
  }
  orb_free(ctx, boxes);
  return status;
}

static void note(orb_stream *stream, int32_t i, int c, double value) {
  stream->min[c] = i == 0 || value < stream->min[c] ? value : stream->min[c];
  stream->max[c] = i == 0 || value > stream->max[c] ? value : stream->max[c];
}

static void raise_error(double *error, const double off[3]) {
  double distance = sqrt(off[0] * off[0] + off[1] * off[1] + off[2] * off[2]);
  *error = distance > *error ? distance : *error;
}

orb_status orb_grid_base(orb_context *ctx, const orb_grid *grid, const float *positions, int32_t count, orb_stream *out,
                         double *error) {
  *out =
      (orb_stream){.count = count, .stride = STRIDE, .components = 3, .component_type = ORB_GLTF_USHORT, .bounded = 1};
  ORB_TRY(orb_stream_allocate(ctx, out, 0));
  uint16_t *to = (uint16_t *)(void *)out->bytes;
  for (int32_t i = 0; i < count; i++) {
    double off[3];
    for (int c = 0; c < 3; c++) {
      double p = (double)positions[3 * (size_t)i + (size_t)c];
      double q = floor((p - grid->origin[c]) / grid->step + 0.5);
      q = q < 0 ? 0 : q > GRID_MOST ? GRID_MOST : q;
      to[4 * (size_t)i + (size_t)c] = (uint16_t)q;
      off[c] = grid->origin[c] + grid->step * q - p;
      note(out, i, c, q);
    }
    raise_error(error, off);
  }
  return ORB_OK;
}

orb_status orb_grid_target(orb_context *ctx, const orb_grid *grid, const float *positions, const float *deltas,
                           const orb_stream *base, orb_stream *out, double *error) {
  *out = (orb_stream){.count = base->count, .stride = STRIDE, .components = 3, .component_type = SHORT, .bounded = 1};
  ORB_TRY(orb_stream_allocate(ctx, out, 0));
  const uint16_t *from = (const uint16_t *)(const void *)base->bytes;
  int16_t *to = (int16_t *)(void *)out->bytes;
  for (int32_t i = 0; i < base->count; i++) {
    double off[3];
    for (int c = 0; c < 3; c++) {
      size_t at = 3 * (size_t)i + (size_t)c;
      double p = (double)positions[at] + (double)deltas[at], start = from[4 * (size_t)i + (size_t)c];
      double q = floor((p - grid->origin[c]) / grid->step + 0.5) - start;
      q = q < -32767 ? -32767 : q > 32767 ? 32767 : q;
      to[4 * (size_t)i + (size_t)c] = (int16_t)q;
      off[c] = grid->origin[c] + grid->step * (start + q) - p;
      note(out, i, c, q);
    }
    raise_error(error, off);
  }
  return ORB_OK;
}

/* Per coordinate, six roundings of values that are at most the largest sum: scale and translation to float32, the
 * product of weight and delta, its sum with the base, that scaled, and moved. */
double orb_grid_rounding(const orb_grid *grid) {
  double sum = 0;
  for (int c = 0; c < 3; c++) {
    double most = fabs(grid->origin[c]) + grid->step * (GRID_MOST + DELTA_MOST);
    sum += most * most;
  }
  return 6 * 0x1p-24 * sqrt(sum);
}
