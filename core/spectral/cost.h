/* The measures that rank maps in eigenfunctions. */
#ifndef ORB_SPECTRAL_COST_H
#define ORB_SPECTRAL_COST_H

#include "spectral/zoom.h"

/* The measures of orb_spectral_candidate, see there. */
typedef struct orb_zoom_cost {
  double cost, distortion, relief, facing;
} orb_zoom_cost;

/* O(samples²). Any thread. */
void orb_zoom_measure(const orb_zoom_pair *pair, const orb_zoom *map, orb_zoom_cost *out);

/* The mean distance, along the second shape (of area 1), between the images of the first shape's samples. */
double orb_zoom_difference(const orb_zoom_pair *pair, const orb_zoom *map, const orb_zoom *other);

#endif
