/* A similarity of space: x ↦ scale · rotation · x + shift. */
#ifndef ORB_ALIGN_FIND_INSET_SIMILARITY_H
#define ORB_ALIGN_FIND_INSET_SIMILARITY_H

#include "align/rotate/procrustes.h"

typedef struct orb_similarity {
  double rotation[9], shift[3], scale;
} orb_similarity;

static inline void orb_similarity_apply(const orb_similarity *s, const double x[3], double out[3]) {
  orb_rotate_point(s->rotation, x, out);
  for (int k = 0; k < 3; k++) {
    out[k] = s->scale * out[k] + s->shift[k];
  }
}

/* Weighted sums over points x that go to y: Σ w, Σ w x, Σ w y, Σ w |x|² and Σ w y xᵀ. */
typedef struct orb_similarity_sums {
  double weight, from[3], to[3], square, covariance[9];
} orb_similarity_sums;

void orb_similarity_add(orb_similarity_sums *sums, double weight, const double x[3], const double y[3]);

/* The similarity of least squares (Umeyama 1991). Returns 0 where the points leave it open. Uses up the sums. */
int orb_similarity_solve(orb_similarity_sums *sums, orb_similarity *out);

/* The inverse, applied to x. */
static inline void orb_similarity_undo(const orb_similarity *s, const double x[3], double out[3]) {
  double p[3];
  for (int k = 0; k < 3; k++) {
    p[k] = (x[k] - s->shift[k]) / s->scale;
  }
  for (int k = 0; k < 3; k++) {
    out[k] = s->rotation[k] * p[0] + s->rotation[3 + k] * p[1] + s->rotation[6 + k] * p[2];
  }
}

#endif
