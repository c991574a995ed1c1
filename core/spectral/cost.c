/* The cost of a map, from three measures; no single one decides.
 *
 * - Distances along the surface tell the right map from wrong permutations of limbs, but hardly from its twin (left and
 *   right swapped with front and back).
 * - Relief, the heights of points over the tangent planes of others nearby, tells bulges from hollows, and so a map
 *   from its twin. Bending changes it only at joints.
 * - Orientation shows a map that takes one limb as it is and another as its mirror image. */
#include "spectral/cost.h"

#include <math.h>

/* Chosen by trial on the pairs of posed people with even numbers (tests/bench/correspond.py --half choose). */
static const float NEAR = 0.25F;              /* of √area: points whose heights are compared */
static const double RELIEF = 2, FACING = 0.5; /* weights beside the logarithm of the distortion */
static const double LEAST = 1e-6;             /* distortion and relief are at least this: a shape on itself */

enum { S = ORB_SPECTRAL_SAMPLES };

/* Adds the measures in one direction, from a shape whose samples go to those of another. */
static void add_direction(const orb_spectral_shape *from, const orb_spectral_shape *to, int detail,
                          const int32_t *image, orb_zoom_cost *out) {
  const double *shares = from->share[detail];
  int32_t samples = orb_spectral_samples(detail);
  double stretched = 0, mean = 0, moved = 0, heights = 0;
  for (int i = 0; i < samples; i++) {
    const float *near = from->distance + i * S, *there = to->distance + image[i] * S;
    const float *height = from->height + i * S, *image_height = to->height + image[i] * S;
    double row_stretched = 0, row_mean = 0, row_moved = 0, row_heights = 0;
    for (int k = 0; k < samples; k++) {
      double share = shares[k];
      row_stretched += share * fabsf(near[k] - there[image[k]]);
      row_mean += share * near[k];
      if (near[k] < NEAR) {
        row_moved += share * fabsf(height[k] - image_height[image[k]]);
        row_heights += share * fabsf(height[k]);
      }
    }
    stretched += shares[i] * row_stretched;
    mean += shares[i] * row_mean;
    moved += shares[i] * row_moved;
    heights += shares[i] * row_heights;
  }
  out->distortion += mean > 0 ? stretched / mean / 2 : 0;
  out->relief += heights > 0 ? moved / heights / 2 : 0;
}

void orb_zoom_measure(const orb_zoom_pair *pair, const orb_zoom *map, orb_zoom_cost *out) {
  *out = (orb_zoom_cost){0};
  add_direction(pair->shape[0], pair->shape[1], map->detail, map->forth, out);
  add_direction(pair->shape[1], pair->shape[0], map->detail, map->back, out);
  out->facing = orb_zoom_facing(pair, map);
  out->cost = log(fmax(LEAST, out->distortion)) + RELIEF * log(fmax(LEAST, out->relief)) - FACING * out->facing;
}

double orb_zoom_difference(const orb_zoom_pair *pair, const orb_zoom *map, const orb_zoom *other) {
  double sum = 0;
  for (int s = 0; s < orb_spectral_samples(map->detail); s++) {
    sum += pair->shape[0]->share[map->detail][s] * pair->shape[1]->distance[map->forth[s] * S + other->forth[s]];
  }
  return sum;
}
