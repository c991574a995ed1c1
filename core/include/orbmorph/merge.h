/* The whole way from embedded shapes to the asset and its report: align, remesh, transfer, write. */
#ifndef ORBMORPH_MERGE_H
#define ORBMORPH_MERGE_H

#include "orbmorph/asset.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct orb_merge_options {
  orb_align_options align;
  orb_remesh_options remesh;
  orb_asset_options asset;
} orb_merge_options;
void orb_merge_defaults(orb_merge_options *options);

typedef struct orb_merge_timings {
  double align, remesh, transfer, write, total; /* seconds */
} orb_merge_timings;

/* Distortion of the composed map from shape a to shape b, on the supermesh's triangles that are no slivers on either (a
 * height above a ninetieth or so of the longest side): a < b, all pairs up to four shapes, else neighbours in their
 * order. */
typedef struct orb_pair_report {
  int32_t a, b;
  /* Its means have no bound: one triangle that collapses at one end only can carry them off. median and p99 do not
   * care, and orb_alignment.energy is the mean with each triangle's value capped. */
  orb_distortion distortion;
  /* Share of the triangles that are turned in space, at either end, against the input surface: its smooth normals at
   * their corners, and its face at their centre as well. Those of no area to speak of (1e-12 of the squared diagonal)
   * do not count. */
  double inverted_fraction;
} orb_pair_report;

typedef struct orb_merge_result {
  orb_alignment alignment;
  orb_supermesh supermesh;
  orb_shape_report *shapes; /* shape_count */
  /* landmark_count × shape_count: from the place asked for to the landmark's supermesh vertex, in
   * units of each shape's diagonal. A landmark without a vertex: to where the supermesh has the sphere's point. NaN
   * where the method keeps no vertex. */
  double *landmark_residuals;
  /* found_count × shape_count: from each place that an alignment without landmarks found to where the supermesh has it,
   * likewise. */
  double *found_residuals;
  int32_t pair_count;
  orb_pair_report *pairs;
  orb_asset_facts asset_facts;
  int32_t *asset_vertices; /* asset_facts.vertex_count: the supermesh vertex that each vertex of the asset stands for */
  double *transforms;      /* shape_count × 16, see orb_asset_transforms() */
  orb_buffer asset;
  orb_merge_timings timings;
} orb_merge_result;

/* Merges shape_count ≥ 2 embedded shapes. Stages: "align", "remesh", "transfer", "write". Landmark `at` arrays as for
 * orb_align(). names: shape_count names for the morph targets. Errors: those of its parts, and ORB_E_DEGENERATE for a
 * shape without a size that float32 could show, such as one whose vertices all lie in one place. */
ORB_MUST_CHECK orb_status orb_merge(orb_context *ctx, const orb_align_shape *shapes, const char *const *names,
                                    int32_t shape_count, const orb_landmark *landmarks, int32_t landmark_count,
                                    const orb_merge_options *options, orb_merge_result *out);
void orb_merge_result_free(orb_context *ctx, orb_merge_result *result);

#ifdef __cplusplus
}
#endif
#endif
