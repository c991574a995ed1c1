/* Relaxation, and thinning between its sweeps. */
#include <string.h>

#include "align/pin/relax.h"
#include "align/sheet/thin.h"
#include "base/check.h"
#include "base/memory.h"
#include "embed/newton/advance.h"
#include "embed/newton/refiner.h"

/* Chosen by trial. */
enum {
  ROUNDS = 24,       /* most, of thinning */
  ROUND_SWEEPS = 5,  /* after each round, so that the next one finds more to remove */
  SWEEPS = 60,       /* most, at the end */
  CHECKED_SWEEPS = 5 /* between checks whether to go on */
};
static const double LITTLE = 0.02;  /* share of the new vertices: a round that removes less is the last */
static const double SETTLED = 1e-3; /* gain of the energy by CHECKED_SWEEPS sweeps that ends them */

orb_status orb_pin_relax(orb_context *ctx, orb_sheet *sheet, const int32_t *landmarks, int32_t count, orb_preset preset,
                         int32_t sweeps) {
  const orb_mesh *mesh = &sheet->shape.mesh;
  orb_hierarchy *hierarchy = NULL;
  orb_refiner *refiner = NULL;
  orb_status status = ORB_OK;
  double *points = ORB_NEW(ctx, double, 3 * (size_t)sheet->vertex_capacity);
  orb_embed_options options;
  orb_embed_defaults(&options);
  options.preset = preset;
  if (!points) {
    return ORB_E_NO_MEMORY;
  }
  ORB_GO(status, orb_refiner_resume(ctx, mesh, sheet->shape.points, &options, &hierarchy, &refiner), end);
  for (int32_t k = 0; k < count; k++) {
    orb_refiner_pin(refiner, sheet->shape.landmark_vertices[landmarks[k]], 1);
  }
  for (int32_t done = 0; done < sweeps; done += CHECKED_SWEEPS) {
    double gain;
    ORB_GO(status, orb_refiner_sweep(ctx, refiner, CHECKED_SWEEPS, &gain), end);
    ORB_GO(status, orb_context_check(ctx), end);
    if (gain < SETTLED) {
      break;
    }
  }
  orb_refiner_points(refiner, points);
  orb_certificate certificate;
  ORB_GO(status, orb_certify(ctx, points, mesh->vertex_count, mesh->triangles, mesh->triangle_count, &certificate),
         end);
  if (certificate.valid) {
    double *old = sheet->shape.points;
    sheet->shape.points = points;
    points = old;
  }
end:
  orb_free(ctx, points);
  orb_refiner_destroy(ctx, refiner);
  orb_hierarchy_destroy(ctx, hierarchy);
  return status;
}

orb_status orb_pin_slim(orb_context *ctx, orb_sheet *sheet, const int32_t *landmarks, int32_t count, orb_preset preset,
                        int64_t *work) {
  for (int round = 0; *work > 0 && round < ROUNDS; round++) {
    int32_t removed, more;
    ORB_TRY(orb_sheet_thin(ctx, sheet, &removed));
    more = sheet->shape.mesh.vertex_count - sheet->given_vertices;
    if (removed == 0 || removed < LITTLE * more) {
      break;
    }
    ORB_TRY(orb_pin_relax(ctx, sheet, landmarks, count, ORB_PRESET_FAST, ROUND_SWEEPS));
    *work -= ROUND_SWEEPS * (int64_t)sheet->shape.mesh.vertex_count;
  }
  return orb_pin_relax(ctx, sheet, landmarks, count, preset, SWEEPS);
}
