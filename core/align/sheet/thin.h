/* Thinning: removes vertices that splits made and that are no longer needed. */
#ifndef ORB_ALIGN_SHEET_THIN_H
#define ORB_ALIGN_SHEET_THIN_H

#include "align/sheet/sheet.h"

/* Removes vertices that splits made, except landmarks, by edge collapses that keep every triangle in its parent and
 * exactly positive both there and on the sphere. Vertices of the given mesh keep their numbers; other vertices and
 * triangles are renumbered. *removed: the number of vertices removed. */
ORB_MUST_CHECK orb_status orb_sheet_thin(orb_context *ctx, orb_sheet *sheet, int32_t *removed);

#endif
