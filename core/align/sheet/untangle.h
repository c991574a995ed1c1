/* Local repair of folded spherical meshes. */
#ifndef ORB_ALIGN_SHEET_UNTANGLE_H
#define ORB_ALIGN_SHEET_UNTANGLE_H

#include "align/sheet/sheet.h"

/* Tries to make every triangle of the sheet exactly positive by moving the vertices about those that are not, in place:
 * each goes to where the least height of its star grows, first on the folded triangles' own vertices, then on ever more
 * rings about them. held: flags of vertices that do not move. *left: triangles still not positive. */
ORB_MUST_CHECK orb_status orb_untangle(orb_context *ctx, orb_sheet *sheet, const unsigned char *held, int64_t *left);

#endif
