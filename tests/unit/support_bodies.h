/* Three bodies with embeddings and landmarks, for the tests of alignment. */
#ifndef SUPPORT_BODIES_H
#define SUPPORT_BODIES_H

#include "orbmorph/align.h"

enum { BODIES = 3, BODIES_LANDMARKS_MAX = 150 };

/* Three star-shaped bodies with different triangulations; their embedding is the ball that they were made from. */
typedef struct bodies {
  orb_context *ctx;
  orb_mesh mesh[BODIES];
  double *points[BODIES];
  orb_align_shape shape[BODIES];
  orb_place at[BODIES_LANDMARKS_MAX][BODIES];
  orb_landmark landmark[BODIES_LANDMARKS_MAX];
} bodies;

void bodies_open(bodies *b, const orb_context_options *options);
void bodies_close(bodies *b);

/* The vertex exactly at a place, or −1. */
int32_t bodies_vertex_at(const orb_mesh *mesh, const orb_place *place);

/* `count` distinct random vertices on each shape, in random order. */
void bodies_random(bodies *b, int count, uint64_t seed);

/* The vertex nearest to each of `count` directions of a lattice, the same on all shapes. */
void bodies_like(bodies *b, int count);

/* Defaults of a method with the preset `fast`. */
orb_align_options bodies_options(orb_align_method method);

#endif
