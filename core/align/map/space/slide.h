/* The last step towards targets, and of a landmark walk: the best map slides to where the two shapes fit each other in
 * space. */
#ifndef ORB_ALIGN_MAP_SPACE_SLIDE_H
#define ORB_ALIGN_MAP_SPACE_SLIDE_H

#include "align/map/engine/run.h"

/* Replaces the best map, which must have its places on the current fixed shape, unless that would cost more energy than
 * params.slide.most allows, or raise the energy to `below` or more: only a map below the energy of the alignment as
 * given is kept. */
ORB_MUST_CHECK orb_status orb_map_slide(orb_map_run *run, double below);

#endif
