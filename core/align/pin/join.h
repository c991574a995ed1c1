/* A base that all shapes share. */
#ifndef ORB_ALIGN_PIN_JOIN_H
#define ORB_ALIGN_PIN_JOIN_H

#include "align/pin/paths.h"

/* Finds a base that all sheets share: its vertices are the landmarks, its edges join landmarks that are near on every
 * sheet, and its paths are traced on all sheets at once, which are refined. at, shape-major: the sheet vertex of each
 * landmark. The base is laid out on the sphere as evenly as its connectivity allows. count ≥ 4. *good 0: as for
 * orb_base_trace(). */
ORB_MUST_CHECK orb_status orb_base_join(orb_context *ctx, orb_sheet *sheets, orb_paths *paths, int32_t shape_count,
                                        const int32_t *at, int32_t count, const int32_t *most_triangles, int64_t *work,
                                        orb_sheet *base, int *good);

#endif
