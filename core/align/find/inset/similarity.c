#include "align/find/inset/similarity.h"

#include <string.h>

#include "numeric/rotation.h"
#include "numeric/vec3.h"

void orb_similarity_add(orb_similarity_sums *s, double weight, const double x[3], const double y[3]) {
  s->weight += weight;
  s->square += weight * orb_dot(x, x);
  orb_add_outer(s->covariance, y, x, weight);
  for (int k = 0; k < 3; k++) {
    s->from[k] += weight * x[k];
    s->to[k] += weight * y[k];
  }
}

int orb_similarity_solve(orb_similarity_sums *s, orb_similarity *out) {
  double rotation[9], trace = 0, moved[3];
  if (!(s->weight > 0)) {
    return 0;
  }
  for (int i = 0; i < 9; i++) {
    s->covariance[i] -= s->to[i / 3] * s->from[i % 3] / s->weight;
  }
  const double square = s->square - orb_dot(s->from, s->from) / s->weight;
  if (!(square > 0) || !orb_nearest_rotation(s->covariance, rotation)) {
    return 0;
  }
  for (int i = 0; i < 9; i++) {
    trace += rotation[i] * s->covariance[i];
  }
  if (!(trace > 0)) {
    return 0;
  }
  memcpy(out->rotation, rotation, sizeof rotation);
  out->scale = trace / square;
  orb_rotate_point(rotation, s->from, moved);
  for (int k = 0; k < 3; k++) {
    out->shift[k] = (s->to[k] - out->scale * moved[k]) / s->weight;
  }
  return 1;
}
