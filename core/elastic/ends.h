/* Ends of limbs that a pose has crumpled, such as hands.
 *
 * Small copies have no fingers. So a hand that a coarse pose has turned by some tens of degrees, or bent at the wrist,
 * arrives with its fingers on the palm of the other one, and closest points then crumple it. Along the surface, an end
 * is what lies beyond a wrist: a ring that the pose carries well. mend.h starts from that ring. */
#ifndef ORB_ELASTIC_ENDS_H
#define ORB_ELASTIC_ENDS_H

#include "elastic/registration.h"

enum { ORB_ENDS_MOST = 8 }; /* ends of one search; two hands and two feet are four */

/* Distances along edges from what is crumpled, in radii of a ball of the shape's area, times the scale of a search.
 * Up to NEAR a vertex belongs to the end, from there to FAR to the wrist, and up to PIECE to what holds it. First
 * guesses. With 0.1 and 0.25 for the first two, the maps of seven pairs of people have 0.7 % more energy. */
static const double ORB_END_NEAR = 0.15, ORB_END_FAR = 0.35, ORB_END_PIECE = 0.5;

typedef struct orb_end {
  double *away;          /* of each vertex of a: its distance from what is crumpled; INFINITY from ORB_END_PIECE on */
  double from[3], to[3]; /* the middle of the wrist, in the mesh as given and in the pose */
  double turn[9];        /* the wrist's rotation, row-major */
  double axis[3];        /* unit, in the pose: from the wrist to the end, if the end has turned as the wrist has */
} orb_end;

typedef struct orb_ends {
  int32_t count;
  orb_end end[ORB_ENDS_MOST]; /* those with more area first */
} orb_ends;

/* Finds the ends of a registration that has settled. scale: 1 finds hands, 0.5 fingers too. Free `out` in any case.
 * O(n) for each end on meshes whose triangles are not extremely long. */
ORB_MUST_CHECK orb_status orb_ends_find(const orb_registration *r, double scale, orb_ends *out);
void orb_ends_free(orb_context *ctx, orb_ends *ends);

#endif
