/* Straightening a path that was just laid. */
#ifndef ORB_ALIGN_PIN_STRAIGHTEN_H
#define ORB_ALIGN_PIN_STRAIGHTEN_H

#include "align/pin/paths.h"

/* Takes vertices of a path that was just laid, from vertex `first` on, out of it again where that changes no shape; the
 * vertices and triangles behind them are renumbered. */
void orb_paths_straighten(orb_sheet *sheet, orb_paths *paths, int32_t first);

#endif
