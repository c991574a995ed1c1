#include "align/find/hint.h"

#include <math.h>
#include <string.h>

#include "align/find/params.h"
#include "base/check.h"
#include "base/context.h"
#include "base/memory.h"
#include "numeric/vec3.h"
#include "spectral/distances.h"

static int32_t nearest_vertex(const orb_mesh *mesh, const double at[3]) {
  double least = INFINITY;
  int32_t nearest = 0;
  for (int32_t v = 0; v < mesh->vertex_count; v++) {
    double d = orb_distance2(mesh->positions + 3 * (size_t)v, at);
    nearest = d < least ? v : nearest;
    least = fmin(least, d);
  }
  return nearest;
}

orb_status orb_hint_places_create(orb_context *ctx, int32_t count, int32_t few, int32_t trusted, double *at[2],
                                  const orb_coarse_copy copy[2], orb_hint_places *out) {
  *out = (orb_hint_places){.count = count, .few = few, .trusted = trusted, .at = {at[0], at[1]}};
  for (int s = 0; s < 2; s++) {
    out->vertex[s] = ORB_NEW(ctx, int32_t, count);
    if (!out->vertex[s] || !out->at[s]) {
      return ORB_E_NO_MEMORY;
    }
    for (int32_t i = 0; i < count; i++) {
      out->vertex[s][i] = nearest_vertex(&copy[s].mesh, out->at[s] + 3 * (size_t)i);
    }
  }
  return ORB_OK;
}

void orb_hint_places_free(orb_context *ctx, orb_hint_places *places) {
  for (int s = 0; s < 2; s++) {
    orb_free(ctx, places->vertex[s]);
    orb_free(ctx, places->at[s]);
  }
  memset(places, 0, sizeof *places);
}

orb_status orb_hint_anchors_create(orb_context *ctx, const orb_hint_places *places, const orb_mesh *copy, int s,
                                   orb_elastic_anchor **out) {
  *out = ORB_NEW(ctx, orb_elastic_anchor, places->count);
  if (!*out) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t i = 0; i < places->count; i++) {
    orb_elastic_anchor *one = *out + i;
    const double *at = places->at[s] + 3 * (size_t)i;
    one->vertex = nearest_vertex(copy, at);
    orb_sub(at, copy->positions + 3 * (size_t)one->vertex, one->offset);
    memcpy(one->place, places->at[1 - s] + 3 * (size_t)i, sizeof one->place);
  }
  return ORB_OK;
}

orb_status orb_hint_distances(orb_context *ctx, const orb_hint_places *places, const orb_mesh *mesh, int s,
                              int32_t sources, double *out) {
  orb_distances distances = {0};
  orb_status status = orb_distances_create(ctx, mesh, &distances);
  for (int32_t i = 0; i < sources && status == ORB_OK; i++) {
    orb_distances_from(&distances, places->vertex[s][i], out + (size_t)i * (size_t)mesh->vertex_count);
    status = orb_context_check(ctx);
  }
  orb_distances_free(ctx, &distances);
  return status;
}

/* Distances along copy s between the first `sources` landmarks and the first few: sources × few. */
static orb_status measure(orb_context *ctx, const orb_hint_places *places, const orb_mesh *mesh, int s, int32_t sources,
                          double *out) {
  const size_t n = (size_t)mesh->vertex_count;
  double *from = ORB_NEW(ctx, double, (size_t)sources *n);
  orb_status status = from ? orb_hint_distances(ctx, places, mesh, s, sources, from) : ORB_E_NO_MEMORY;
  for (int32_t i = 0; i < sources && status == ORB_OK; i++) {
    for (int32_t k = 0; k < places->few; k++) {
      out[(size_t)i * (size_t)places->few + (size_t)k] = from[(size_t)i * n + (size_t)places->vertex[s][k]];
    }
  }
  orb_free(ctx, from);
  return status;
}

orb_status orb_hint_stretch(orb_context *ctx, const orb_hint_places *places, const orb_coarse_copy copy[2],
                            double *stretch) {
  const int32_t count = places->few, sources = count < ORB_FIND_HINT_SOURCES ? count : ORB_FIND_HINT_SOURCES;
  const size_t pairs = (size_t)sources * (size_t)count;
  double *along[2] = {ORB_NEW(ctx, double, pairs), ORB_NEW(ctx, double, pairs)}, sum = 0;
  int32_t used = 0;
  orb_status status = along[0] && along[1] ? ORB_OK : ORB_E_NO_MEMORY;
  for (int s = 0; s < 2 && status == ORB_OK; s++) {
    status = measure(ctx, places, &copy[s].mesh, s, sources, along[s]);
  }
  for (size_t i = 0; i < pairs && status == ORB_OK; i++) {
    if (fmin(along[0][i], along[1][i]) >= ORB_FIND_HINT_FAR && isfinite(along[0][i] + along[1][i])) {
      sum += fabs(log(along[0][i] / along[1][i]));
      used++;
    }
  }
  *stretch = used > 0 ? sum / used : INFINITY;
  orb_free(ctx, along[0]);
  orb_free(ctx, along[1]);
  return status;
}

double orb_hint_off(const orb_hint_places *places, const orb_coarse_copy *copy, int s, const double *pose) {
  double sum = 0;
  for (int32_t i = 0; i < places->few; i++) {
    const size_t v = 3 * (size_t)places->vertex[s][i];
    double beside = sqrt(orb_distance2(copy->mesh.positions + v, places->at[s] + 3 * (size_t)i));
    double away = sqrt(orb_distance2(pose + v, places->at[1 - s] + 3 * (size_t)i));
    sum += fmax(0, away - beside); /* a landmark lies this far beside the vertex that stands for it */
  }
  return places->few > 0 ? sum / places->few : 0;
}
