#include "align/find/survey.h"

#include <math.h>
#include <string.h>

#include "align/map/engine/surface.h"
#include "base/check.h"
#include "base/context.h"
#include "base/memory.h"
#include "spectral/distances.h"

static orb_status measure(orb_context *ctx, const orb_mesh *mesh, float *apart) {
  const size_t n = (size_t)mesh->vertex_count;
  orb_distances distances = {0};
  orb_status status;
  double *row = ORB_NEW(ctx, double, n);
  if (!row) {
    return ORB_E_NO_MEMORY;
  }
  ORB_GO(status, orb_distances_create(ctx, mesh, &distances), end);
  for (size_t v = 0; v < n; v++) {
    orb_distances_from(&distances, (int32_t)v, row);
    for (size_t u = 0; u < n; u++) {
      apart[v * n + u] = (float)row[u];
    }
    ORB_GO(status, orb_context_check(ctx), end);
  }
end:
  orb_distances_free(ctx, &distances);
  orb_free(ctx, row);
  return status;
}

orb_status orb_survey_create(orb_context *ctx, const orb_mesh *mesh, int measured, orb_survey *out) {
  memset(out, 0, sizeof *out);
  ORB_TRY(orb_surroundings_create(ctx, mesh, &out->around));
  ORB_TRY(orb_nearest_create(ctx, mesh->positions, mesh->triangles, mesh->triangle_count, &out->tree));
  if (!measured) {
    return ORB_OK;
  }
  out->apart = ORB_NEW(ctx, float, (size_t)mesh->vertex_count *(size_t)mesh->vertex_count);
  return out->apart ? measure(ctx, mesh, out->apart) : ORB_E_NO_MEMORY;
}

void orb_survey_free(orb_context *ctx, orb_survey *survey) {
  orb_surroundings_free(ctx, &survey->around);
  orb_nearest_destroy(ctx, survey->tree);
  orb_free(ctx, survey->apart);
  memset(survey, 0, sizeof *survey);
}

int32_t orb_survey_nearest(const orb_survey *survey, const orb_mesh *mesh, const double point[3]) {
  orb_place place;
  (void)orb_nearest_query(survey->tree, point, INFINITY, &place);
  return orb_map_nearest_corner(mesh->triangles, &place);
}

void orb_survey_images(const orb_survey *survey, const orb_mesh *mesh, const double *points, int32_t count,
                       int32_t *out) {
  for (int32_t i = 0; i < count; i++) {
    out[i] = orb_survey_nearest(survey, mesh, points + 3 * (size_t)i);
  }
}
