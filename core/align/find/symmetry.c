#include "align/find/symmetry.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "elastic/elastic.h"
#include "spectral/spectral.h"

/* What all candidates share. */
typedef struct mirroring {
  orb_context *ctx;
  const orb_mesh *mesh;
  const orb_survey *survey;
  orb_mesh mirrored;
  orb_elastic_pose pose; /* of it */
  orb_spectral_list list;
  orb_spectral_dense dense;
  double bend[ORB_FIND_MIRRORS];
  int32_t *image[ORB_FIND_MIRRORS];
} mirroring;

static orb_status mirroring_create(orb_context *ctx, const orb_mesh *mesh, const orb_survey *survey, mirroring *m) {
  const size_t n = 3 * (size_t)mesh->vertex_count, count = 3 * (size_t)mesh->triangle_count;
  *m = (mirroring){.ctx = ctx, .mesh = mesh, .survey = survey};
  m->mirrored.vertex_count = mesh->vertex_count;
  m->mirrored.triangle_count = mesh->triangle_count;
  m->mirrored.positions = ORB_NEW(ctx, double, n);
  m->mirrored.triangles = ORB_NEW(ctx, int32_t, count);
  m->pose.position = ORB_NEW(ctx, double, n);
  m->pose.rotation = ORB_NEW(ctx, double, 3 * n);
  if (!m->mirrored.positions || !m->mirrored.triangles || !m->pose.position || !m->pose.rotation) {
    return ORB_E_NO_MEMORY;
  }
  for (size_t i = 0; i < n; i++) {
    m->mirrored.positions[i] = i % 3 == 0 ? -mesh->positions[i] : mesh->positions[i];
  }
  for (size_t i = 0; i < count; i += 3) {
    m->mirrored.triangles[i] = mesh->triangles[i];
    m->mirrored.triangles[i + 1] = mesh->triangles[i + 2];
    m->mirrored.triangles[i + 2] = mesh->triangles[i + 1];
  }
  return ORB_OK;
}

static void mirroring_free(mirroring *m) {
  orb_free(m->ctx, m->mirrored.positions);
  orb_free(m->ctx, m->mirrored.triangles);
  orb_free(m->ctx, m->pose.position);
  orb_free(m->ctx, m->pose.rotation);
  orb_free(m->ctx, m->dense.forth);
  orb_free(m->ctx, m->dense.back);
  for (int i = 0; i < ORB_FIND_MIRRORS; i++) {
    orb_free(m->ctx, m->image[i]);
  }
}

static int compare(const void *x, const void *y) {
  const double a = *(const double *)x, b = *(const double *)y;
  return (a > b) - (a < b);
}

/* How much a map of the mesh to itself changes the distances along it: of the vertices, the median of their mean
 * differences, over the mean distance. */
static orb_status measure_stretch(const mirroring *m, const int32_t *image, double *stretch) {
  const int32_t n = m->mesh->vertex_count;
  double sum = 0, *off = ORB_NEW0(m->ctx, double, n);
  if (!off) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t v = 0; v < n; v++) {
    for (int32_t u = 0; u < n; u++) {
      const double apart = orb_survey_apart(m->survey, m->mesh, v, u);
      off[v] += fabs(apart - orb_survey_apart(m->survey, m->mesh, image[v], image[u]));
      sum += apart;
    }
  }
  qsort(off, (size_t)n, sizeof *off, compare);
  *stretch = sum > 0 ? off[n / 2] * n / sum : INFINITY;
  orb_free(m->ctx, off);
  return ORB_OK;
}

/* Registers the mirror image along candidate i. One that does not keep distances gets an infinite bend. */
static orb_status try_candidate(mirroring *m, int32_t i) {
  const size_t n = (size_t)m->mesh->vertex_count;
  const orb_rough_map map = {m->dense.forth + (size_t)i * n, m->dense.back + (size_t)i * n};
  double stretch;
  m->image[i] = ORB_NEW(m->ctx, int32_t, n);
  if (!m->image[i]) {
    return ORB_E_NO_MEMORY;
  }
  ORB_TRY(orb_elastic_register(m->ctx, &m->mirrored, m->mesh, &m->survey->around, &map, NULL, &m->pose, &m->bend[i]));
  orb_survey_images(m->survey, m->mesh, m->pose.position, m->mesh->vertex_count, m->image[i]);
  ORB_TRY(measure_stretch(m, m->image[i], &stretch));
  if (!(stretch <= ORB_FIND_SYMMETRIC_STRETCH)) {
    m->bend[i] = INFINITY;
  }
  return orb_context_check(m->ctx);
}

/* Moves the candidates that bend little to `out`, the best first. */
static void take_best(mirroring *m, orb_symmetry *out) {
  double most = ORB_FIND_SYMMETRIC;
  while (out->count < ORB_FIND_SYMMETRIES) {
    int32_t best = -1;
    for (int32_t i = 0; i < m->list.count; i++) {
      best = m->image[i] && m->bend[i] <= (best < 0 ? most : m->bend[best]) ? i : best;
    }
    if (best < 0) {
      return;
    }
    if (out->count == 0) {
      most = fmin(most, ORB_FIND_SYMMETRIC_BEHIND * m->bend[best]);
    }
    out->image[out->count++] = m->image[best];
    m->image[best] = NULL;
  }
}

orb_status orb_symmetry_find(orb_context *ctx, const orb_survey *survey, const orb_spectral_shape *shape,
                             orb_symmetry *out) {
  mirroring m;
  orb_status status;
  *out = (orb_symmetry){0};
  ORB_GO(status, mirroring_create(ctx, shape->mesh, survey, &m), end);
  ORB_GO(status, orb_spectral_find_mirror(ctx, shape, ORB_FIND_MIRRORS, &m.list, &m.dense), end);
  for (int32_t i = 0; i < m.list.count; i++) {
    ORB_GO(status, try_candidate(&m, i), end);
  }
  take_best(&m, out);
end:
  mirroring_free(&m);
  return status;
}

void orb_symmetry_free(orb_context *ctx, orb_symmetry *symmetry) {
  for (int i = 0; i < ORB_FIND_SYMMETRIES; i++) {
    orb_free(ctx, symmetry->image[i]);
  }
  memset(symmetry, 0, sizeof *symmetry);
}
