/* Local repair of folded spherical meshes. */
#ifndef ORB_ALIGN_SHEET_UNTANGLE_H
#define ORB_ALIGN_SHEET_UNTANGLE_H

#include "align/sheet/sheet.h"

/* Tries to make every triangle of the sheet exactly positive, by moving vertices around those that are not, in place:
 * first the vertices of the flipped triangles, then more and more rings around them. Each vertex goes to where the
 * least height of its star grows. held: flags of vertices that do not move. *left: flipped triangles that remain. */
ORB_MUST_CHECK orb_status orb_untangle(orb_context *ctx, orb_sheet *sheet, const unsigned char *held, int64_t *left);

#endif
