#include "embed/newton/newton.h"

#include "base/check.h"
#include "embed/newton/advance.h"
#include "embed/newton/hierarchy.h"
#include "embed/newton/multires.h"
#include "embed/newton/refiner.h"

static orb_status run(orb_context *ctx, const orb_mesh *mesh, const orb_embed_options *options, int keep_angles,
                      double *points, orb_embed_timings *timings) {
  orb_hierarchy *hierarchy = NULL;
  orb_refiner *refiner = NULL;
  double start = orb_clock();
  orb_status status;
  ORB_GO(status, orb_hierarchy_create(ctx, mesh, NULL, 0, &hierarchy), done);
  double between = orb_clock();
  timings->simplify = between - start;
  ORB_GO(status, orb_refiner_create(ctx, hierarchy, options, &refiner), done);
  if (keep_angles) {
    orb_refiner_keep_angles(refiner);
  }
  orb_refiner_one_way(refiner);
  ORB_GO(status, orb_refiner_advance(ctx, refiner, mesh->vertex_count), done);
  if (mesh->vertex_count == 4) {
    ORB_GO(status, orb_refiner_sweep(ctx, refiner, 50, NULL), done);
  }
  orb_level_free(ctx, &refiner->level); /* first, so that the points do not raise the peak of memory */
  orb_refiner_points(refiner, points);
  timings->embed = orb_clock() - between;
done:
  orb_refiner_abandon(ctx, refiner);
  orb_hierarchy_destroy(ctx, hierarchy);
  return status;
}

orb_status orb_newton_run(orb_context *ctx, const orb_mesh *mesh, const orb_embed_options *options, double *points,
                          orb_embed_timings *timings) {
  return run(ctx, mesh, options, 0, points, timings);
}

orb_status orb_newton_run_angles(orb_context *ctx, const orb_mesh *mesh, const orb_embed_options *options,
                                 double *points) {
  orb_embed_timings timings;
  return run(ctx, mesh, options, 1, points, &timings);
}
