/* Collapses of vertices that splits made: what they may do, and doing it. */
#ifndef ORB_ALIGN_SHEET_COLLAPSE_H
#define ORB_ALIGN_SHEET_COLLAPSE_H

#include "align/sheet/sheet.h"

enum { ORB_STAR_MAX = 48 };

/* det over the longest edge squared: 0.87 of a small equilateral triangle, 0 of a needle. */
double orb_fatness(const double a[3], const double b[3], const double c[3]);

/* The star of v: half-edges that leave it; 0 where there are too many. */
int orb_star_read(const orb_sheet *sheet, int32_t v, int32_t star[ORB_STAR_MAX]);

/* The least fatness on the sphere of the star with its centre at u, one of its ring; 0: it may not go there, since a
 * triangle would leave its parent or turn over, decided exactly there and on the sphere. */
double orb_star_fatness_at(const orb_sheet *sheet, const int32_t *star, int count, int32_t u);

/* Only the two vertices beside edge v–u are neighbours of both, and u would not get too many. */
int orb_star_link_is_clean(const orb_sheet *sheet, const int32_t *star, int count, int32_t u);

/* Collapses half-edge h, of the star of its origin, onto its end. Its origin and the triangles of h and its twin are
 * out of use afterwards but still in the arrays. The star's corners take the end's values on their side. */
void orb_star_collapse(orb_sheet *sheet, int32_t h, const int32_t *star, int count);

/* Attributes of one corner, to another. */
void orb_corner_copy(orb_mesh *mesh, int32_t from, int32_t to);

#endif
