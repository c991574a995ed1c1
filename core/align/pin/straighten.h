/* Straightening a new path. */
#ifndef ORB_ALIGN_PIN_STRAIGHTEN_H
#define ORB_ALIGN_PIN_STRAIGHTEN_H

#include "align/pin/paths.h"

/* Removes vertices of a new path, from vertex `first` on, where that changes no shape. Vertices and triangles behind
 * them are renumbered. */
void orb_paths_straighten(orb_sheet *sheet, orb_paths *paths, int32_t first);

#endif
