/* Thinning: removing vertices that splits made and nothing needs any more. */
#ifndef ORB_ALIGN_SHEET_THIN_H
#define ORB_ALIGN_SHEET_THIN_H

#include "align/sheet/sheet.h"

/* Removes vertices that splits made, other than landmarks, where the flat surface about them and the sphere allow: an
 * edge collapse that keeps every triangle in its parent and exactly positive both there and on the sphere. Vertices of
 * the given mesh keep their numbers; others and triangles are renumbered. *removed: how many vertices went. */
ORB_MUST_CHECK orb_status orb_sheet_thin(orb_context *ctx, orb_sheet *sheet, int32_t *removed);

#endif
