/* Spherical embeddings: every vertex of a mesh on the unit sphere, no triangle flipped, with an exact certificate. */
#ifndef ORBMORPH_EMBED_H
#define ORBMORPH_EMBED_H

#include "orbmorph/mesh.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Holds exactly for the stored doubles. valid = flipped 0, degenerate 0 and degree 1: every orientation
 * orient(0,p,q,r) is exactly positive and the map covers the sphere once. */
typedef struct orb_certificate {
  int valid, exact;
  int64_t flipped, degenerate; /* triangles of negative, of zero orientation */
  int32_t degree;              /* of the map: how often it covers the sphere, with sign */
  double min_determinant;      /* the smallest det(p,q,r), rounded */
} orb_certificate;

/* Certifies points (3 per vertex, unit up to rounding) of a closed triangle list. A static filter decides
 * orientations; exact integers decide the rest. The degree is a signed count of the triangles that cover one direction
 * in general position. (The sum of solid angles / 4π is the same number, but only up to rounding.) Every triangle at
 * a point that is not finite counts as degenerate. The result is in out->valid; the call itself fails only if memory
 * runs out or the caller cancels it. O(F). */
ORB_API ORB_MUST_CHECK orb_status orb_certify(orb_context *ctx, const double *points, int32_t vertex_count,
                                              const int32_t *triangles, int32_t triangle_count, orb_certificate *out);

enum { ORB_HISTOGRAM_BINS = 64 };
typedef struct orb_measure {
  double mean, median, p99, max, std; /* weighted by source area */
  int32_t bins;
  double edges[ORB_HISTOGRAM_BINS + 1];
  double counts[ORB_HISTOGRAM_BINS]; /* triangles in each bin */
} orb_measure;

/* How a map distorts triangles, after both surfaces are scaled to the same area. The image of a triangle is the flat
 * triangle between the images of its corners; σ₁ ≥ σ₂ are the singular values of the map onto it. Source triangles of
 * zero area (to rounding: |U×W| ≤ 1e-13 (U² + W²)) have no weight; if no other exists, every number is 0. */
typedef struct orb_distortion {
  orb_measure symmetric_dirichlet; /* ¼(σ₁²+σ₁⁻²+σ₂²+σ₂⁻²), 1 = isometric */
  orb_measure angle;               /* σ₁/σ₂ */
  orb_measure area;                /* ln σ₁σ₂ */
  orb_measure aspect;              /* circumradius / 2 inradius of the image triangle */
  double stretch_efficiency;       /* 1 / mean(½(σ₁⁻²+σ₂⁻²)) */
} orb_distortion;

/* Measures the map from positions to images, both 3 per vertex, over the same triangles. O(F). */
ORB_API ORB_MUST_CHECK orb_status orb_distortion_measure(orb_context *ctx, const double *positions,
                                                         const double *images, const int32_t *triangles,
                                                         int32_t triangle_count, orb_distortion *out);

typedef enum orb_embed_method { ORB_EMBED_NEWTON = 0, ORB_EMBED_KERNEL_SAMPLING } orb_embed_method;
typedef enum orb_preset { ORB_PRESET_DEFAULT = 0, ORB_PRESET_FAST, ORB_PRESET_QUALITY } orb_preset;

/* Options of both methods; start from orb_embed_defaults(). */
typedef struct orb_embed_options {
  orb_embed_method method; /* default: ORB_EMBED_NEWTON */
  /* newton */
  orb_preset preset;    /* default: ORB_PRESET_DEFAULT */
  double energy_weight; /* w of E = Σ D (w + a²/d²): 1 symmetric Dirichlet (default), 0 Praun & Hoppe's L2 stretch */
  /* kernel-sampling: Peng & Timalsena 2016, sections 4 to 6 */
  double area_exponent;          /* ϱ of Eq. 3; default: 3 */
  double aspect_exponent;        /* φ of Eq. 3; default: 12 */
  double step;                   /* step of s and t in Eq. 2; default: 0.11 */
  double displacement_threshold; /* of Algorithm 1; default: 1e-6 */
  int32_t max_iterations;        /* of Algorithm 1; default: 25 */
  int32_t first_optimization;    /* vertices inserted before the first global optimisation; default: 25 */
  double growth;                 /* factor of that number after each global optimisation; default: 1.25 */
  int32_t qem_until; /* simplify by QEM down to this many vertices, then by Eq. 1 (section 9.2); default: 6000 */
} orb_embed_options;
ORB_API void orb_embed_defaults(orb_embed_options *options);

typedef struct orb_embed_timings {
  double check, simplify, embed, certify, total; /* seconds; check is 0: the caller measures orb_mesh_repair() */
} orb_embed_timings;

typedef struct orb_embedding {
  int32_t vertex_count;
  double *points; /* 3 per vertex: |p| = 1 within 1e-12; what is certified */
  orb_certificate certificate;
  orb_distortion distortion;
  orb_embed_timings timings;
} orb_embedding;

/* Embeds a mesh that orb_mesh_repair() accepted. The result is certified; otherwise the call returns
 * ORB_E_NOT_CERTIFIED and no embedding. newton takes vertices of any valence. kernel-sampling has no limit on valence
 * either, but near vertices with several hundred triangles a kernel may become too narrow for doubles: after three
 * bounded attempts the call fails with ORB_E_NOT_CERTIFIED and recommends newton. (A mesh with two vertices of valence
 * 200 and one ring between them embeds; with five rings, or valence 2,000, it fails within seconds.) The result has the
 * same bytes for any number of threads on one machine; its last bits may depend on the instruction set (AVX-512, AVX2
 * or neither), which is chosen at run time. Stages: "simplify", "embed", "certify". O(n log n) time, at most 250 bytes
 * a triangle beside the mesh. docs/method.md describes the method. */
ORB_API ORB_MUST_CHECK orb_status orb_embed(orb_context *ctx, const orb_mesh *mesh, const orb_embed_options *options,
                                            orb_embedding *out);
ORB_API void orb_embedding_free(orb_context *ctx, orb_embedding *embedding);

#ifdef __cplusplus
}
#endif
#endif
