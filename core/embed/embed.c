/* Embedding: a mesh in, a certified embedding out. README.md of this folder is the guide. */
#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/context.h"
#include "base/error.h"
#include "base/memory.h"
#include "embed/kernel_sampling/kernel_sampling.h"
#include "embed/newton/newton.h"

void orb_embed_defaults(orb_embed_options *options) {
  *options = (orb_embed_options){.method = ORB_EMBED_NEWTON,
                                 .preset = ORB_PRESET_DEFAULT,
                                 .energy_weight = 1,
                                 .area_exponent = 3.0,
                                 .aspect_exponent = 12.0,
                                 .step = 0.11,
                                 .displacement_threshold = 1e-6,
                                 .max_iterations = 25,
                                 .first_optimization = 25,
                                 .growth = 1.25,
                                 .qem_until = 6000};
}

static orb_status run_kernel_sampling(orb_context *ctx, const orb_mesh *mesh, const orb_embed_options *options,
                                      orb_embedding *out) {
  orb_ks_report report = {0};
  ORB_TRY(orb_kernel_sampling(ctx, mesh, options, out->points, &report));
  out->timings.simplify = report.simplify_seconds;
  out->timings.embed = report.place_seconds + report.optimize_seconds;
  return ORB_OK;
}

static orb_status run_method(orb_context *ctx, const orb_mesh *mesh, const orb_embed_options *options,
                             orb_embedding *out) {
  switch (options->method) {
    case ORB_EMBED_NEWTON:
      return orb_newton_run(ctx, mesh, options, out->points, &out->timings);
    case ORB_EMBED_KERNEL_SAMPLING:
      return run_kernel_sampling(ctx, mesh, options, out);
  }
  return orb_fail(ctx, ORB_E_UNSUPPORTED, "This build has no such embedding method; use newton.");
}

static orb_status refuse(orb_context *ctx, const orb_certificate *certificate) {
  return orb_fail(
      ctx, ORB_E_NOT_CERTIFIED,
      "The embedding was computed but is not valid (%lld triangles flipped, %lld degenerate, degree %d), so "
      "no result is returned. Remove the thinnest triangles of the mesh and try again.",
      (long long)certificate->flipped, (long long)certificate->degenerate, certificate->degree);
}

orb_status orb_embed(orb_context *ctx, const orb_mesh *mesh, const orb_embed_options *options, orb_embedding *out) {
  double start = orb_clock();
  orb_embed_options defaults;
  if (!options) {
    orb_embed_defaults(&defaults);
    options = &defaults;
  }
  memset(out, 0, sizeof *out);
  out->vertex_count = mesh->vertex_count;
  out->points = ORB_NEW(ctx, double, 3 * (int64_t)mesh->vertex_count);
  if (!out->points) {
    return ORB_E_NO_MEMORY;
  }
  orb_status status;
  ORB_GO(status, run_method(ctx, mesh, options, out), done);
  double before = orb_clock();
  ORB_GO(status,
         orb_certify(ctx, out->points, mesh->vertex_count, mesh->triangles, mesh->triangle_count, &out->certificate),
         done);
  if (!out->certificate.valid) {
    status = refuse(ctx, &out->certificate);
    goto done;
  }
  orb_progress(ctx, "certify", 0.5);
  ORB_GO(status,
         orb_distortion_measure(ctx, mesh->positions, out->points, mesh->triangles, mesh->triangle_count,
                                &out->distortion),
         done);
  orb_progress(ctx, "certify", 1);
  out->timings.certify = orb_clock() - before;
  out->timings.total = orb_clock() - start;
done:
  if (status != ORB_OK) {
    orb_embedding_free(ctx, out);
  }
  return status;
}

void orb_embedding_free(orb_context *ctx, orb_embedding *embedding) {
  orb_free(ctx, embedding->points);
  memset(embedding, 0, sizeof *embedding);
}
