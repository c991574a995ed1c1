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
  const orb_place *at; /* shape_count places, on the meshes given to orb_align() */
  int32_t pass;        /* rbf: landmarks of pass 0, the major ones, meet first, then those of pass 1, … */
  double radius;       /* rbf: radius of its influence, as a chord of the unit sphere; 0: rbf_radius */
  double confidence;   /* of a found landmark, 0 to 1; 1 for a given one */
} orb_landmark;

typedef struct orb_align_options {
  orb_align_method method;
  orb_preset preset; /* fast: no composed map */
  int32_t rbf_steps; /* steps of each pass; 10 */
  int32_t one_way;   /* rbf: move only the later shapes (Peng & Timalsena 2016, Fig. 9) */
  double rbf_radius; /* radius of landmarks that have none; 0: 1.0 */
  double max_growth; /* pin: how many triangles splits may add to a mesh, as a multiple of its own number (of 2000 if it
                        has fewer), and at most 800000. Landmarks that need more are refused. 0: 64 */
} orb_align_options;
ORB_API void orb_align_defaults(orb_align_options *options);

typedef struct orb_align_shape {
  const orb_mesh *mesh;
  const double *points; /* its certified embedding, 3 a vertex */
} orb_align_shape;

/* A shape after alignment. Its mesh is the same surface, perhaps with more vertices (landmarks within triangles or on
 * edges, and split edges). Triangle t lies in triangle parent[t] of the given mesh. New vertices have mesh.source −1;
 * attributes of corners are interpolated. */
typedef struct orb_aligned_shape {
  orb_mesh mesh;
  int32_t *parent;
  double *points; /* certified on the aligned sphere */
  orb_certificate certificate;
  int32_t *landmark_vertices; /* landmark_count: the vertex of each landmark */
} orb_aligned_shape;

enum { ORB_FOUND_MAX = 12 };

typedef struct orb_alignment {
  int32_t shape_count, landmark_count;
  orb_aligned_shape *shapes;
  /* auto without landmarks: at most ORB_FOUND_MAX found landmarks, which show the correspondence; they are far from
   * each other on the first shape. A client can correct them and send them as landmarks. They are not vertices. */
  int32_t found_count;
  orb_place *found;     /* found_count × shape_count places, on the given meshes */
  double *found_points; /* found_count × 3: their common points on the aligned sphere */
  double *confidence; /* found_count, 0 to 1. 1: the map nearby is rigid, up to one scale for the whole shape; it falls
                         with the distortion of the map nearby, and falls for all found landmarks if another candidate
                         is nearly as good. It does not say whether the right parts were matched */
  double energy;      /* symmetric Dirichlet energy of the composed maps, capped for each triangle and weighted by area;
                         lower is better; NaN if not measured */
} orb_alignment;

/* Aligns shape_count ≥ 1 shapes; the points of the first stay unless the method says otherwise. Every result is
 * certified.
 *
 * - rotate: rotations only. With landmarks, by generalised Procrustes (Peng & Timalsena 2016, section 7.1); without, by
 *   a search over SO(3) for the rotation under which the map between the shapes is nearest to a rigid motion. Where
 *   landmarks leave the rotation around an axis open (one or two landmarks, or all on one axis), the search finds it.
 *   The same holds in pin and rbf.
 * - rbf: after the rotations, the warp of the paper (section 7.2), in rbf_steps steps a pass, to the spherical means;
 *   one_way: to the first shape's points. The influence of a landmark ends at its radius. A step that folds is
 *   untangled locally. If that fails, the step is halved several times; if that fails too, the sphere is relaxed before
 *   it. Landmarks that still do not get past each other meet as in pin, where edges are split.
 * - pin: embeds the shapes anew with the landmarks as constraints, which meet at their spherical means. Where landmarks
 *   would have to pass through one another, pin splits edges, and the landmarks meet at the first shape's points or at
 *   new ones. After pin and rbf the vertices of a landmark have bit-equal points on all shapes.
 * - auto: pin with landmarks, else the rotation search followed by non-rigid registration. If the energy of that map is
 *   above 1.05, auto tries other candidates on coarse copies: further rotations, and tip maps. It composes the best one
 *   in full and returns it if it lowers the energy. The preset fast skips all but the rotation search. `found` shows
 *   what was matched.
 *
 * Landmarks at the same place on every shape are merged: they share a vertex. Errors: ORB_E_BAD_LANDMARKS names
 * landmarks that are out of range or share a place on some shapes only; in a set that cannot be met, it names the first
 * landmark that cannot be met together with those before it. ORB_E_BAD_OPTION: pin or rbf without landmarks. About
 * O(n log n) in triangles. Landmarks that lie at unrelated places of the shapes cost much more than landmarks that
 * roughly correspond; a set that needs more than about a minute of work is refused as one that cannot be met. */
ORB_API ORB_MUST_CHECK orb_status orb_align(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                                            const orb_landmark *landmarks, int32_t landmark_count,
                                            const orb_align_options *options, orb_alignment *out);
ORB_API void orb_alignment_free(orb_context *ctx, orb_alignment *alignment);

#ifdef __cplusplus
}
#endif
#endif
