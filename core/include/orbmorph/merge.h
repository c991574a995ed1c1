/* From embedded shapes to the asset and its report: align, remesh, transfer, write. */
#ifndef ORBMORPH_MERGE_H
#define ORBMORPH_MERGE_H

#include "orbmorph/align.h"
#include "orbmorph/asset.h"
#include "orbmorph/carry.h"
#include "orbmorph/kept.h"
#include "orbmorph/profile.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct orb_merge_options {
  orb_align_options align;
  orb_remesh_options remesh;
  orb_asset_options asset;
  /* ORB_REMESH_TEMPLATE: the first shape as orb_mesh_read() gave it, before repairs; NULL: after repairs. */
  const orb_mesh *file;
  /* If that file is glTF or GLB: its bytes; the asset is then this document with targets added. NULL: a new document.
   */
  const unsigned char *file_bytes;
  size_t file_size;
  orb_document_parts file_parts; /* see orb_document */
  /* What to carry onto the supermesh besides positions; files: of the shapes that it names, shape_count. */
  const orb_carry *carries;
  int32_t carry_count;
  const orb_shape_file *files;
} orb_merge_options;
ORB_API void orb_merge_defaults(orb_merge_options *options);

typedef struct orb_merge_timings {
  double align, remesh, transfer, write, total; /* seconds */
} orb_merge_timings;

/* Distortion of the composed map from shape a to shape b, a < b. Triangles of the supermesh that are slivers
 * on a or b (height below about a ninetieth of the longest side) do not count, unless nearly all are. Up to four shapes
 * have a report for each pair; more shapes have one for the first with each other one, and for each pair of neighbours
 * in their order. */
enum { ORB_INVERTED_LISTED = 32 };

typedef struct orb_pair_report {
  int32_t a, b;
  /* Its means are unbounded: a single triangle that collapses on one of the shapes can dominate them. median and p99
   * are robust, and orb_alignment.energy is the mean with each triangle's value capped. */
  orb_distortion distortion;
  /* Share of the triangles that are inverted on a or b: they face away from the input's smooth normals at their corners
   * and from its face at their centre. Degenerate ones (twice the area at most 1e-12 of the squared
   * diagonal) do not count. */
  double inverted_fraction;
  int64_t inverted_count;
  /* With the method template, the largest of them (on a or b) as numbers of the first shape's file, the largest first.
   * Triangles that a repair made have none and are not listed. */
  int32_t inverted_listed, inverted_triangles[ORB_INVERTED_LISTED];
} orb_pair_report;

enum { ORB_WARNING_PARTS = 4, ORB_WARNING_TRIANGLES = 32 };

typedef enum orb_warning_kind {
  ORB_WARNING_STRETCHED, /* the symmetric Dirichlet energy is above 20 on more than 1 % of the area */
  ORB_WARNING_THIN       /* patches keep less than half of their area halfway through the linear morph, after a fit by
                            similarity: the map twists a limb there, or the pose rotates it far */
} orb_warning_kind;

/* A connected part of what a warning is about. Index 0 is shape a of the pair, 1 shape b. */
typedef struct orb_warning_part {
  double share;                                 /* of the shape's area: of the shape on which it is larger */
  double centre[2][3], radius[2];               /* a ball around the part, in the shape's units */
  int32_t triangle_count;                       /* listed: at most ORB_WARNING_TRIANGLES, the largest on either shape */
  int32_t triangles[3 * ORB_WARNING_TRIANGLES]; /* vertices of the supermesh */
} orb_warning_part;

/* Where the map between the shapes of a pair is bad. */
typedef struct orb_warning {
  orb_warning_kind kind;
  int32_t a, b;
  double share;       /* of the area, all parts, also those that are not listed */
  int32_t part_count; /* by falling share */
  orb_warning_part parts[ORB_WARNING_PARTS];
} orb_warning;

enum { ORB_COARSE_LISTED = 32 };

/* Which triangles of a template are too coarse for a shape: at samples, they and the shape are farther apart than the
 * tolerance. */
typedef struct orb_coarse {
  double share;  /* of the template's area on the shape */
  int64_t count; /* of the triangles */
  /* The farthest of them, the farthest first, as numbers of the first shape's file, with their distances in the shape's
   * units. Triangles that a repair made have no number and are not listed. */
  int32_t listed, triangles[ORB_COARSE_LISTED];
  double errors[ORB_COARSE_LISTED];
} orb_coarse;

typedef struct orb_merge_result {
  orb_alignment alignment;
  orb_supermesh supermesh;
  orb_shape_report *shapes; /* shape_count */
  orb_coarse *coarse;       /* shape_count; NULL unless the method is template */
  /* landmark_count × shape_count: distance from the requested place to the landmark's supermesh vertex, in units of
   * the shape's diagonal. If a landmark has no vertex: to the shape's place at the mean of the landmark's points
   * on the sphere. */
  double *landmark_residuals;
  /* found_count × shape_count: for each found landmark, the distance from its place to the point of the supermesh
   * that lies at the landmark's point on the sphere. */
  double *found_residuals;
  /* found_count: the part of the first shape on which a found landmark lies, by its geometry: "head", "tail",
   * "left front limb" and so on, literals; NULL: not clear. Names are unique. */
  const char **found_names;
  int32_t pair_count;
  orb_pair_report *pairs;
  int32_t warning_count;
  orb_warning *warnings;
  orb_asset_facts asset_facts;
  int32_t *asset_vertices; /* asset_facts.vertex_count: the supermesh vertex of each vertex of the asset; −1: none,
                              see orb_asset_write_template() */
  double *transforms;      /* shape_count × 16, see orb_asset_transforms() */
  orb_fit_report *fits;    /* shape_count */
  int32_t dropped_count;
  orb_dropped *dropped; /* see orb_asset_dropped() */
  int32_t open_holes;   /* filled holes of the first shape that are open in the asset */
  orb_buffer asset;
  int is_document; /* the asset is the document of the first shape, see orb_asset_write_document() */
  int32_t carried_count;
  orb_carried *carried;                     /* what the options asked to carry, in the order of the asset */
  int has_profiles;                         /* 0: a kept document, or more than targets was carried onto the asset */
  orb_profile_facts profiles[ORB_PROFILES]; /* how much each profile changes the asset; 0 for float */
  orb_merge_timings timings;
} orb_merge_result;

/* Merges shape_count ≥ 2 embedded shapes. Stages: "align", "remesh", "transfer", "write". landmarks: as for
 * orb_align(). names: as for orb_asset_write(). Errors: those of its parts, and ORB_E_DEGENERATE for a shape too small
 * to show in float32, such as one whose vertices all coincide. On an error *out is zeroed; otherwise free it with
 * orb_merge_result_free(). */
ORB_API ORB_MUST_CHECK orb_status orb_merge(orb_context *ctx, const orb_align_shape *shapes, const char *const *names,
                                            int32_t shape_count, const orb_landmark *landmarks, int32_t landmark_count,
                                            const orb_merge_options *options, orb_merge_result *out);
/* Returns the error that orb_merge() would return because of the options or the files. orb_merge() calls this function
 * before it starts the work. The error names the shape, the entry of `carries` and the parts of the glTF document at
 * fault. A document is read once more, in memory of its size. */
ORB_API ORB_MUST_CHECK orb_status orb_merge_check(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                                                  const orb_merge_options *options);
/* Merges with an alignment that orb_align() or orb_alignment_read() gave for these shapes and landmarks. The result is
 * that of orb_merge(), except that timings.align is 0. Takes ownership of *alignment and zeroes it, also on an error.
 */
ORB_API ORB_MUST_CHECK orb_status orb_merge_aligned(orb_context *ctx, const orb_align_shape *shapes,
                                                    const char *const *names, int32_t shape_count,
                                                    const orb_landmark *landmarks, orb_alignment *alignment,
                                                    const orb_merge_options *options, orb_merge_result *out);
ORB_API void orb_merge_result_free(orb_context *ctx, orb_merge_result *result);

/* Marks the triangles of the supermesh that are inverted on shape s: they face away from two directions, the mean of
 * the input's smooth normals at their corners, and the normal of its triangle at their centre on the sphere. positions:
 * 3 per supermesh vertex, on the shape. inverted: receives 1 or 0 for each triangle. The report of a merge has only
 * their number: call this function to show them, or for a supermesh of orb_remesh(). */
ORB_API ORB_MUST_CHECK orb_status orb_mark_inverted(orb_context *ctx, const orb_supermesh *supermesh,
                                                    const orb_aligned_shape *shape, int32_t s, const double *positions,
                                                    unsigned char *inverted);

#ifdef __cplusplus
}
#endif
#endif
