/* Refinement of a map between two shapes in their eigenfunctions. */
#ifndef ORB_SPECTRAL_ZOOM_H
#define ORB_SPECTRAL_ZOOM_H

#include "spectral/shape.h"

enum {
  ORB_ZOOM_START = 6, /* functions of the first matrix, the constant one included: the starts permute the others */
  ORB_ZOOM_LEVELS = 7 /* level_size in zoom.c has the functions of each level */
};

/* A map between shapes a and b: a linear map of their functions, and where the samples go. */
typedef struct orb_zoom {
  int32_t size;   /* functions of each shape that it relates */
  int32_t detail; /* which samples it relates: the first orb_spectral_samples(detail) of each shape */
  /* Function i of b, brought to a, is the sum over k of matrix[i][k] · function k of a; orthogonal, nearly. */
  double matrix[ORB_SPECTRAL_FUNCTIONS][ORB_SPECTRAL_FUNCTIONS];
  int32_t forth[ORB_SPECTRAL_SAMPLES]; /* the sample of b that each sample of a goes to, and the other way */
  int32_t back[ORB_SPECTRAL_SAMPLES];
} orb_zoom;

/* What all refinements of a pair share. */
typedef struct orb_zoom_pair {
  const orb_spectral_shape *shape[2];
  double *fit[2][ORB_ZOOM_LEVELS]; /* from values at samples to coefficients: functions × samples */
} orb_zoom_pair;

/* Free `out` in any case. The shapes must be usable and outlive it. */
ORB_MUST_CHECK orb_status orb_zoom_pair_create(orb_context *ctx, const orb_spectral_shape *a,
                                               const orb_spectral_shape *b, orb_zoom_pair *out);
void orb_zoom_pair_free(orb_context *ctx, orb_zoom_pair *pair);

/* Starts from a map of the first functions after the constant one: function k + 1 of a goes to function to[k] of b,
 * negated where bit k of signs is set. */
void orb_zoom_start(const int to[ORB_ZOOM_START - 1], uint32_t signs, orb_zoom *out);

/* Refines a map over levels [from, to). Any thread. */
void orb_zoom_refine(const orb_zoom_pair *pair, int from, int to, orb_zoom *map);

/* The vertex of b that a sample of a goes to, or with `back` that of a that a sample of b goes to: nearest over all
 * vertices. O(n). */
int32_t orb_zoom_image(const orb_zoom_pair *pair, const orb_zoom *map, int32_t sample, int back);

/* The same for any vertex. */
int32_t orb_zoom_vertex_image(const orb_zoom_pair *pair, const orb_zoom *map, int32_t vertex, int back);

/* How much of shape a keeps its orientation under the map, by the triple products: −1 to 1. */
double orb_zoom_facing(const orb_zoom_pair *pair, const orb_zoom *map);

#endif
