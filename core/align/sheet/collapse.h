/* Collapses of vertices that splits made: whether they are allowed, and the collapse itself. */
#ifndef ORB_ALIGN_SHEET_COLLAPSE_H
#define ORB_ALIGN_SHEET_COLLAPSE_H

#include "align/sheet/sheet.h"

enum { ORB_STAR_MAX = 48 }; /* triangles of a star; vertices with more are left alone. Chosen by trial */

/* The determinant over the square of the longest edge: 0.87 for a small equilateral triangle, 0 for a needle. */
double orb_fatness(const double a[3], const double b[3], const double c[3]);

/* The star of v: the half-edges that leave it; 0 if there are too many. */
int orb_star_read(const orb_sheet *sheet, int32_t v, int32_t star[ORB_STAR_MAX]);

/* The least fatness on the sphere of the star with its centre moved to u, a vertex of its ring. 0: not allowed, since a
 * triangle would leave its parent or flip, decided exactly in the parent and on the sphere. */
double orb_star_fatness_at(const orb_sheet *sheet, const int32_t *star, int count, int32_t u);

/* Are the two vertices opposite to edge v–u the only common neighbours, and does u not get too many? */
int orb_star_link_is_clean(const orb_sheet *sheet, const int32_t *star, int count, int32_t u);

/* Collapses the origin of half-edge h onto its end. star: that of the origin. The origin and the triangles of h and its
 * twin are unused afterwards but still in the arrays. The star's corners get the end's values on their side. */
void orb_star_collapse(orb_sheet *sheet, int32_t h, const int32_t *star, int count);

/* Copies the attributes of one corner to another. */
void orb_corner_copy(orb_mesh *mesh, int32_t from, int32_t to);

#endif
