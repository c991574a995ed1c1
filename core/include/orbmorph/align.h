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
  uint64_t seed;
} orb_align_options;
void orb_align_defaults(orb_align_options *options);

typedef struct orb_align_shape {
  const orb_mesh *mesh;
  const double *points; /* its certified embedding, 3 a vertex */
} orb_align_shape;

/* A shape after alignment. Its mesh is the same surface, perhaps with more vertices (landmarks inside triangles or
 * on edges, edges split): every triangle lies in triangle parent[t] of the mesh that was given. */
typedef struct orb_aligned_shape {
  orb_mesh mesh;
  int32_t *parent;
  double *points; /* certified on the aligned sphere */
  orb_certificate certificate;
  int32_t *landmark_vertices; /* landmark_count: each landmark is this vertex (−1: inside a triangle, rotate/rbf) */
} orb_aligned_shape;

typedef struct orb_alignment {
  int32_t shape_count, landmark_count;
  orb_aligned_shape *shapes;
  orb_place *found;   /* auto: landmark_count × shape_count places that were found, on the given meshes */
  double *confidence; /* landmark_count */
  double energy;      /* composed symmetric Dirichlet, capped, area-weighted; lower is better; NaN if not measured */
} orb_alignment;

/* Aligns. pin: landmark vertices have bit-equal points on all shapes. Errors: ORB_E_BAD_LANDMARKS names those that
 * contradict or cannot be met; ORB_E_BAD_OPTION for pin and rbf without landmarks. */
ORB_MUST_CHECK orb_status orb_align(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                                    const orb_landmark *landmarks, int32_t landmark_count,
                                    const orb_align_options *options, orb_alignment *out);
void orb_alignment_free(orb_context *ctx, orb_alignment *alignment);

#ifdef __cplusplus
}
#endif
#endif
