/* Maps between two shapes without landmarks, from the vibrations of their surfaces.
 *
 * In: two closed meshes of a few hundred to two thousand vertices, as decimation leaves them. Out: a list of maps that
 * differ, best first, each as pairs of vertices and a cost. Bending a surface hardly changes its eigenfunctions, so a
 * pose does not matter; proportions may differ by a third. Read in this order:
 *
 *   distances.h  distances along a surface
 *   eigen.h      the lowest eigenpairs of a sparse matrix
 *   shape.h      eigenfunctions of a shape, and its samples
 *   zoom.h       refines a map, and keeps it from being a mirror image
 *   cost.h       what ranks maps
 *   spectral.h   starts, and the list
 *
 * Where the true map is in the list, it is often not the first: a body whose front and back are alike has a twin that
 * swaps left with right and front with back, and their costs lie close together. So try several of the list.
 */
#ifndef ORB_SPECTRAL_SPECTRAL_H
#define ORB_SPECTRAL_SPECTRAL_H

#include "spectral/shape.h"

enum {
  ORB_SPECTRAL_MAX = 8,   /* candidates of a list */
  ORB_SPECTRAL_PAIRS = 48 /* pairs of a candidate */
};

/* A map as vertices of both meshes that correspond. No vertex is in two pairs. The first pairs are spread over the
 * shapes and include the ends of limbs. */
typedef struct orb_spectral_candidate {
  int32_t count;
  int32_t first[ORB_SPECTRAL_PAIRS], second[ORB_SPECTRAL_PAIRS];
  double cost;       /* ranks the maps of a pair: log(distortion) + 2 log(relief) − facing / 2 */
  double distortion; /* mean difference of distances along the surfaces, relative to the mean distance */
  double relief;     /* difference of local heights over tangent planes, relative to the heights */
  double facing;     /* how much of the surface keeps its orientation: −1 to 1; 0.3 and above is usual of true maps */
} orb_spectral_candidate;

typedef struct orb_spectral_list {
  int32_t count; /* 0: a mesh has fewer than 124 vertices, or no eigenfunctions */
  double clear;  /* how much more the second costs than the first: the more, the more likely the first is right */
  orb_spectral_candidate candidate[ORB_SPECTRAL_MAX];
} orb_spectral_list;

/* Where each candidate of a list takes every vertex of either mesh, as vertices of the other; the caller frees both. */
typedef struct orb_spectral_dense {
  int32_t *forth; /* candidates × vertices of a */
  int32_t *back;  /* candidates × vertices of b */
} orb_spectral_dense;

/* Finds the candidates, the best first. mirrored: those that reverse orientation; of a shape to itself these are its
 * mirror symmetries, which show which of its parts correspond to each other. The result has the same bytes for any
 * number of threads. About 0.1 s for two meshes of a thousand vertices. */
ORB_MUST_CHECK orb_status orb_spectral_find(orb_context *ctx, const orb_mesh *a, const orb_mesh *b, int mirrored,
                                            orb_spectral_list *out);

/* The same of shapes that may serve several searches: at most `most` candidates that keep orientation, with where each
 * takes every vertex. A shape that is not usable has none. */
ORB_MUST_CHECK orb_status orb_spectral_find_dense(orb_context *ctx, const orb_spectral_shape *a,
                                                  const orb_spectral_shape *b, int32_t most, orb_spectral_list *out,
                                                  orb_spectral_dense *dense);

/* Maps of a shape to itself that reverse orientation, at most `most`: its mirror symmetries, if it has any, are among
 * them. It starts from 32 maps, where a search between two shapes starts from 448. */
ORB_MUST_CHECK orb_status orb_spectral_find_mirror(orb_context *ctx, const orb_spectral_shape *shape, int32_t most,
                                                   orb_spectral_list *out, orb_spectral_dense *dense);

#endif
