/* orb_merge(): align, remesh, transfer (the reports), write. */
#include "orbmorph/merge.h"

#include <stdio.h>
#include <string.h>

#include "base/check.h"
#include "base/context.h"
#include "base/error.h"
#include "base/memory.h"
#include "carry/carry.h"
#include "carry/check.h"
#include "merge/coarse.h"
#include "merge/report.h"
#include "merge/torn.h"
#include "mesh/refuse.h"
#include "orbmorph/utf8.h"
#include "transfer/holes.h"
#include "transfer/keep.h"

void orb_merge_defaults(orb_merge_options *options) {
  memset(options, 0, sizeof *options);
  orb_align_defaults(&options->align);
  orb_remesh_defaults(&options->remesh);
  orb_asset_defaults(&options->asset);
}

void orb_merge_result_free(orb_context *ctx, orb_merge_result *result) {
  orb_alignment_free(ctx, &result->alignment);
  orb_supermesh_free(ctx, &result->supermesh);
  orb_free(ctx, result->shapes);
  orb_free(ctx, result->coarse);
  orb_free(ctx, result->landmark_residuals);
  orb_free(ctx, result->found_residuals);
  orb_free(ctx, result->found_names);
  orb_free(ctx, result->pairs);
  orb_free(ctx, result->warnings);
  orb_free(ctx, result->transforms);
  orb_free(ctx, result->fits);
  orb_free(ctx, result->asset_vertices);
  orb_free(ctx, result->dropped);
  orb_free(ctx, result->carried);
  orb_buffer_free(ctx, &result->asset);
  memset(result, 0, sizeof *result);
}

static orb_status transfer_reports(orb_context *ctx, const orb_align_shape *shapes, const orb_landmark *landmarks,
                                   const orb_remesh_options *remesh, orb_merge_result *out) {
  int is_template = remesh->method == ORB_REMESH_TEMPLATE;
  const int32_t *number = is_template ? shapes[0].mesh->source_triangle : NULL;
  int32_t shape_count = out->supermesh.shape_count;
  out->shapes = ORB_NEW0(ctx, orb_shape_report, shape_count);
  if (!out->shapes) {
    return ORB_E_NO_MEMORY;
  }
  orb_progress(ctx, "transfer", 0);
  for (int32_t s = 0; s < shape_count; s++) {
    ORB_TRY(orb_shape_measure(ctx, &out->alignment.shapes[s], &out->supermesh, s, &out->shapes[s]));
    orb_progress(ctx, "transfer", 0.8 * (s + 1) / shape_count);
  }
  if (is_template) {
    ORB_TRY(orb_report_torn(ctx, shapes[0].mesh, out));
    ORB_TRY(orb_report_coarse(ctx, shapes[0].mesh, remesh->tolerance, out));
  }
  ORB_TRY(orb_report_landmarks(ctx, shapes, landmarks, out));
  ORB_TRY(orb_report_found(ctx, shapes, out));
  ORB_TRY(orb_report_pairs(ctx, number, out));
  orb_progress(ctx, "transfer", 1);
  return ORB_OK;
}

static orb_status check_shapes(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count) {
  if (shape_count < 2) {
    return orb_fail(ctx, ORB_E_BAD_OPTION, "A merge needs two shapes or more.");
  }
  for (int32_t s = 0; s < shape_count; s++) {
    orb_status status = orb_refuse_size(ctx, shapes[s].mesh);
    if (status != ORB_OK) {
      orb_context_error_edit(ctx)->shape = s;
      return status;
    }
  }
  return ORB_OK;
}

static int keeps_document(const orb_merge_options *options) {
  return options->remesh.method == ORB_REMESH_TEMPLATE && options->file && options->file_bytes;
}

static orb_document document_of(const orb_merge_options *options) {
  return (orb_document){options->file, options->file_bytes, options->file_size, options->file_parts};
}

/* Parts of a document are named, and no document is kept: the error lists them. */
static orb_status refuse_parts(orb_context *ctx, const orb_document_parts *parts, orb_remesh_method method) {
  orb_status status =
      method == ORB_REMESH_TEMPLATE
          ? orb_fail(ctx, ORB_E_BAD_OPTION,
                     "\"template\" names meshes or nodes, but the first shape is not glTF; omit that member.")
          : orb_fail(ctx, ORB_E_BAD_OPTION,
                     "\"template\" names meshes or nodes of a document that the method '%s' does not keep; omit that "
                     "member, or use the method 'template'.",
                     orb_remesh_method_name(method));
  orb_error *error = orb_context_error_edit(ctx);
  error->shape = 0;
  error->element_total = (int64_t)parts->mesh_count + parts->node_count;
  for (int32_t i = 0; i < error->element_total && i < ORB_ERROR_ITEMS; i++) {
    orb_error_element *element = &error->elements[error->element_count++];
    if (i < parts->mesh_count) {
      (void)snprintf(element->where, sizeof element->where, "meshes[%d]", parts->meshes[i]);
    } else {
      (void)snprintf(element->where, sizeof element->where, "nodes");
      (void)orb_utf8_copy(element->name, sizeof element->name, parts->nodes[i - parts->mesh_count]);
    }
  }
  return status;
}

/* A template has the triangles of the first shape, however many a request allows. */
static orb_status check_limit(orb_context *ctx, const orb_mesh *first, const orb_remesh_options *remesh) {
  if (remesh->method != ORB_REMESH_TEMPLATE || remesh->max_triangles == 0 ||
      first->triangle_count <= remesh->max_triangles) {
    return ORB_OK;
  }
  return orb_fail(
      ctx, ORB_E_BAD_OPTION,
      "The method 'template' keeps the %d triangles of the first shape, more than max_triangles = %lld; omit "
      "that member, or use 'adaptive' for fewer.",
      first->triangle_count, (long long)remesh->max_triangles);
}

orb_status orb_merge_check(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                           const orb_merge_options *options) {
  const int is_document = keeps_document(options);
  ORB_TRY(check_shapes(ctx, shapes, shape_count));
  ORB_TRY(check_limit(ctx, shapes[0].mesh, &options->remesh));
  if (!is_document && options->file_parts.mesh_count + options->file_parts.node_count > 0) {
    return refuse_parts(ctx, &options->file_parts, options->remesh.method);
  }
  if (is_document) {
    orb_document document = document_of(options);
    ORB_TRY(orb_document_try(ctx, shapes[0].mesh, &document));
  }
  orb_carry_wish wish = {.given = shapes,
                         .files = options->files,
                         .shape_count = shape_count,
                         .carries = options->carries,
                         .carry_count = options->carry_count,
                         .document = is_document ? options->file : NULL,
                         .document_bytes = options->file_bytes,
                         .document_size = options->file_size};
  return orb_carry_check(ctx, &wish);
}

/* Writes the GLB by the method's own way. */
static orb_status write_glb(orb_context *ctx, const orb_align_shape *given, const char *const *names,
                            const orb_merge_options *options, const orb_asset_options *asset, orb_merge_result *out) {
  const orb_aligned_shape *shapes = out->alignment.shapes;
  if (out->is_document) {
    orb_document document = document_of(options);
    return orb_asset_write_document(ctx, &out->supermesh, shapes, &document, names, asset, &out->asset_facts,
                                    &out->asset, &out->asset_vertices, &out->dropped, &out->dropped_count);
  }
  if (options->remesh.method == ORB_REMESH_TEMPLATE) {
    return orb_asset_write_template(ctx, &out->supermesh, shapes, options->file ? options->file : given[0].mesh, names,
                                    asset, &out->asset_facts, &out->asset, &out->asset_vertices);
  }
  return orb_asset_write_mapped(ctx, &out->supermesh, shapes, names, asset, &out->asset_facts, &out->asset,
                                &out->asset_vertices);
}

/* Writes the GLB, and carries onto it what the options ask for. */
static orb_status write_carried(orb_context *ctx, const orb_align_shape *given, const char *const *names,
                                const orb_merge_options *options, orb_merge_result *out) {
  orb_carry_job job = {.supermesh = &out->supermesh,
                       .shapes = out->alignment.shapes,
                       .given = given,
                       .files = options->files,
                       .names = names,
                       .carries = options->carries,
                       .carry_count = options->carry_count,
                       .fit = options->asset.fit,
                       .is_document = out->is_document};
  orb_carrier carrier;
  orb_asset_options asset = options->asset;
  orb_status status;
  ORB_GO(status, orb_carrier_open(ctx, &job, &carrier), done);
  asset.splits = carrier.splits;
  asset.split_count = carrier.set_count;
  asset.targets = carrier.targets;
  asset.target_count = carrier.target_count;
  ORB_GO(status, write_glb(ctx, given, names, options, &asset, out), done);
  ORB_GO(status,
         orb_carrier_add(ctx, &carrier, out->asset_vertices, out->asset_facts.vertex_count, &out->asset, &out->carried,
                         &out->carried_count),
         done);
  out->has_profiles = !out->is_document && !orb_carrier_edits(&carrier);
done:
  orb_carrier_free(ctx, &carrier);
  return status;
}

static orb_status write_asset(orb_context *ctx, const orb_align_shape *given, int32_t shape_count,
                              const char *const *names, const orb_merge_options *options, orb_merge_result *out) {
  const orb_aligned_shape *shapes = out->alignment.shapes;
  out->is_document = keeps_document(options);
  ORB_TRY(write_carried(ctx, given, names, options, out));
  if (!out->is_document) {
    ORB_TRY(orb_asset_dropped(ctx, shapes, shape_count, &options->asset, &out->dropped, &out->dropped_count));
  }
  ORB_TRY(orb_dropped_holes(ctx, &out->supermesh, &out->alignment, &options->asset,
                            options->remesh.method == ORB_REMESH_TEMPLATE && options->file, &out->open_holes,
                            &out->dropped, &out->dropped_count));
  out->transforms = ORB_NEW(ctx, double, 16 * (size_t)shape_count);
  out->fits = ORB_NEW(ctx, orb_fit_report, shape_count);
  if (!out->transforms || !out->fits) {
    return ORB_E_NO_MEMORY;
  }
  ORB_TRY(orb_asset_transforms(ctx, &out->supermesh, shapes, options->asset.fit, out->transforms, out->fits));
  ORB_TRY(orb_carried_settle(ctx, out->carried, out->carried_count, &out->dropped, &out->dropped_count));
  for (int p = ORB_PROFILE_QUANTIZED; p < ORB_PROFILES && out->has_profiles; p++) {
    ORB_TRY(orb_profile_write(ctx, out->asset.data, out->asset.size, (orb_profile)p, &out->profiles[p], NULL));
  }
  return ORB_OK;
}

/* An unsure match rotates no shape. */
static orb_merge_options for_match(const orb_merge_options *options, const orb_match_facts *match) {
  orb_merge_options believed = *options;
  if (options->asset.fit == ORB_FIT_AUTO && match->is_measured && match->confidence < ORB_MATCH_LIKELY) {
    believed.asset.fit = ORB_FIT_AUTO_UNSURE;
  }
  return believed;
}

orb_status orb_merge_aligned(orb_context *ctx, const orb_align_shape *shapes, const char *const *names,
                             int32_t shape_count, const orb_landmark *landmarks, orb_alignment *alignment,
                             const orb_merge_options *options, orb_merge_result *out) {
  double start = orb_clock(), mark = start, now;
  orb_status status;
  memset(out, 0, sizeof *out);
  out->alignment = *alignment;
  memset(alignment, 0, sizeof *alignment);
  ORB_GO(status, check_shapes(ctx, shapes, shape_count), fail);
  if (out->alignment.shape_count != shape_count) {
    status = orb_fail(ctx, ORB_E_BAD_OPTION, "The alignment is of %d shapes.", out->alignment.shape_count);
    goto fail;
  }
  orb_remesh_options remesh = options->remesh;
  remesh.rims = options->asset.holes == ORB_HOLES_REOPEN;
  orb_progress(ctx, "remesh", 0);
  ORB_GO(status,
         orb_remesh(ctx, out->alignment.shapes, shape_count, out->alignment.landmark_count, &remesh, &out->supermesh),
         fail);
  out->timings.remesh = (now = orb_clock()) - mark;
  mark = now;
  ORB_GO(status, transfer_reports(ctx, shapes, landmarks, &remesh, out), fail);
  out->timings.transfer = (now = orb_clock()) - mark;
  mark = now;
  const orb_merge_options believed = for_match(options, &out->alignment.match);
  ORB_GO(status, write_asset(ctx, shapes, shape_count, names, &believed, out), fail);
  out->timings.write = (now = orb_clock()) - mark;
  out->timings.total = now - start;
  return ORB_OK;
fail:
  orb_merge_result_free(ctx, out);
  return status;
}

orb_status orb_merge(orb_context *ctx, const orb_align_shape *shapes, const char *const *names, int32_t shape_count,
                     const orb_landmark *landmarks, int32_t landmark_count, const orb_merge_options *options,
                     orb_merge_result *out) {
  const double start = orb_clock();
  orb_alignment alignment;
  memset(out, 0, sizeof *out);
  ORB_TRY(orb_merge_check(ctx, shapes, shape_count, options));
  orb_progress(ctx, "align", 0);
  ORB_TRY(orb_align(ctx, shapes, shape_count, landmarks, landmark_count, &options->align, &alignment));
  const double seconds = orb_clock() - start;
  ORB_TRY(orb_merge_aligned(ctx, shapes, names, shape_count, landmarks, &alignment, options, out));
  out->timings.align = seconds;
  out->timings.total += seconds;
  return ORB_OK;
}
