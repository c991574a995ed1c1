/* Alignment: embeddings of several shapes and their landmarks -> embeddings in which the landmarks coincide. */
#ifndef ORBMORPH_ALIGN_H
#define ORBMORPH_ALIGN_H

#include "orbmorph/embed.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum orb_align_method { ORB_ALIGN_PIN = 0, ORB_ALIGN_RBF, ORB_ALIGN_ROTATE, ORB_ALIGN_AUTO } orb_align_method;

/* One landmark: a place on each shape, in their order. */
typedef struct orb_landmark {
  char name[ORB_NAME_MAX];
  const orb_place *at; /* shape_count places; on the meshes as given to orb_align() */
  int32_t pass;        /* rbf: 0 major first, then 1, … */
  double radius;       /* rbf: of its influence, chord length on the unit sphere; 0: the default */
  double confidence;   /* of found ones, 0 to 1; 1 of given ones */
} orb_landmark;

typedef struct orb_align_options {
  orb_align_method method;
  orb_preset preset; /* fast: no composed map */
  int32_t rbf_steps; /* 10 */
  int32_t one_way;   /* rbf: move the later shapes only (Fig. 9) */
  double rbf_radius; /* for all landmarks; 0: default */
  double max_growth; /* pin: a mesh may get so many times its triangles (or 2000 if it has fewer) more, at most 800000,
                        before landmarks are refused; 0: 64 */
} orb_align_options;
ORB_API void orb_align_defaults(orb_align_options *options);

typedef struct orb_align_shape {
  const orb_mesh *mesh;
  const double *points; /* its certified embedding, 3 a vertex */
} orb_align_shape;

/* A shape after alignment. Its mesh is the same surface, perhaps with more vertices (landmarks inside triangles or
 * on edges, edges split): every triangle lies in triangle parent[t] of the mesh that was given. New vertices have
 * mesh.source −1; attributes of corners are interpolated. */
typedef struct orb_aligned_shape {
  orb_mesh mesh;
  int32_t *parent;
  double *points; /* certified on the aligned sphere */
  orb_certificate certificate;
  int32_t *landmark_vertices; /* landmark_count: each landmark is this vertex */
} orb_aligned_shape;

enum { ORB_FOUND_MAX = 12 };

typedef struct orb_alignment {
  int32_t shape_count, landmark_count;
  orb_aligned_shape *shapes;
  /* auto without landmarks: at most ORB_FOUND_MAX pairs of places that show the correspondence, far from each other on
   * the first shape. They are for a reader to correct and to send as landmarks; they are not vertices. */
  int32_t found_count;
  orb_place *found;     /* found_count × shape_count places, on the given meshes */
  double *found_points; /* found_count × 3: their common points on the aligned sphere */
  double *confidence;   /* found_count, 0 to 1: 1 where the map nearby is rigid up to one scale for all, less the more
                           it stretches, and less for all where another correspondence that was tried is nearly as
                           good, see auto; it does not say whether the right things were matched */
  double energy;        /* composed symmetric Dirichlet, capped, area-weighted; lower is better; NaN if not measured */
} orb_alignment;

/* Aligns shape_count ≥ 1 shapes; the first keeps its place unless the method says otherwise. Every result is certified.
 *
 * - rotate: rotations only, by landmarks (generalised Procrustes; Peng & Timalsena 2016, section 7.1), or without any
 *   by a search over SO(3) for the rotation under which the map between the shapes is nearest to a rigid motion. Where
 *   landmarks leave a turn open (one, two, or all about one axis) the search finds it; so too in pin and rbf.
 * - rbf: the paper's warp (7.2) from there, in rbf_steps steps a pass, to the spherical means, or one_way to the first
 *   shape's points. A landmark's influence ends at its radius (0: rbf_radius; that 0: 1.0). A step that folds is
 *   untangled locally, else halved, else the sphere is relaxed before it; landmarks that cross on their way are carried
 *   over as pin would.
 * - pin: the shapes are embedded anew with the landmarks as constraints, meeting at their spherical means; landmarks
 *   that would have to pass through one another meet on surfaces with more edges, at the first shape's points or at
 *   new ones. After pin and rbf a landmark's vertices have bit-equal points on all shapes.
 * - auto: pin where landmarks are given, else the rotation search. Where the map that comes of bending one shape onto
 *   the other in space has an energy above 1.2, other correspondences are tried on coarse copies, by further rotations
 *   and by tips of limbs, and the best one is composed in full and taken if it lowers the energy (not with the preset
 *   fast). `found` then says what was matched.
 *
 * Landmarks at one and the same place on every shape are merged: they share a vertex. Errors: ORB_E_BAD_LANDMARKS names
 * those that are out of range or share a place on some shapes only; of a set
 * that cannot be met, the first that cannot be met together with those before it; ORB_E_BAD_OPTION for pin and rbf
 * without landmarks. About O(n log n) in triangles; random far-apart landmarks cost much more than like ones, but no
 * more than a bound: what needs more work than about a minute's is refused as such that cannot be met. */
ORB_API ORB_MUST_CHECK orb_status orb_align(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                                            const orb_landmark *landmarks, int32_t landmark_count,
                                            const orb_align_options *options, orb_alignment *out);
ORB_API void orb_alignment_free(orb_context *ctx, orb_alignment *alignment);

#ifdef __cplusplus
}
#endif
#endif
