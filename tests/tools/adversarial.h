/* Meshes made to break an embedding: closed, manifold, genus zero, but otherwise as bad as possible. */
#ifndef ADVERSARIAL_H
#define ADVERSARIAL_H

#include <stdint.h>

typedef enum adversarial_kind {
  ADV_CYLINDER,   /* a tube 500 times as long as wide */
  ADV_SPIRAL,     /* a tube coiled six times */
  ADV_NECK,       /* two balls joined by a thread */
  ADV_URCHIN,     /* a ball with many spikes */
  ADV_NOISE,      /* a ball whose radius jumps at each vertex */
  ADV_CRUMPLE,    /* the same over orders of magnitude */
  ADV_COMB,       /* long thin teeth side by side */
  ADV_FLATTENED,  /* a ball pressed to a ten-thousandth */
  ADV_DUPLICATED, /* a third of the vertices at a neighbour's place */
  ADV_ALL_EQUAL,  /* every vertex at one place */
  ADV_POLE,       /* two poles of valence up to 2,000 */
  ADV_RANDOM,     /* random positions on a random triangulation */
  ADV_LIMBS,      /* a tree of limbs on limbs */
  ADV_NEEDLES,    /* triangles squeezed to needles */
  ADV_KIND_COUNT
} adversarial_kind;

typedef struct adversarial_mesh {
  int32_t vertex_count, triangle_count;
  double *positions;  /* 3 per vertex */
  int32_t *triangles; /* 3 per triangle */
} adversarial_mesh;

const char *adversarial_name(adversarial_kind kind);

/* Generates a mesh of a kind with about `triangles` triangles. Equal arguments give equal bytes. Allocates with
 * malloc() and exits the program when out of memory. */
adversarial_mesh adversarial_make(adversarial_kind kind, uint64_t seed, int32_t triangles);
void adversarial_free(adversarial_mesh *mesh);

#endif
