/* Matches of tips by how limbs branch, whatever their lengths.
 *
 * Where proportions differ much, as between an ape and a man, the long arms of one are as long as the legs of the
 * other. Distances between tips, rotations of the spheres and eigenfunctions then all take arms to legs. But in both,
 * the arms and the head branch off together, and the legs together. The paths between four tips along the surface are
 * nearly those of a tree, and of the three sums d(i,j) + d(k,l), d(i,k) + d(j,l) and d(i,l) + d(j,k) the least one
 * tells which two pairs branch off together (the four-point condition, Buneman 1974). The length of a limb is in all
 * three sums, so their differences do not depend on it: they are lengths of the trunk between the limbs.
 *
 * Left and right, and front and back, branch alike, so some matches are about as good. Registrations tell them apart.
 */
#ifndef ORB_ALIGN_FIND_BRANCHES_H
#define ORB_ALIGN_FIND_BRANCHES_H

#include "align/find/tips.h"

enum {
  ORB_BRANCHES_TIPS = 7
}; /* tips of a shape that are matched at most, the farthest first: with 8, a match of all
      has 40,000 ways */

/* The matches of least cost that take each tip of the shape with fewer to one of the other, at most `most`, the best
 * first; none if a shape has fewer than four tips. cost: the mean by which those differences differ, in radii of a ball
 * of the shapes' area, plus the weighted angle between partners, in radians, and the weighted length of the limbs that
 * are left over. Tries all: up to 0.01 s. */
int32_t orb_branches_match(const orb_tips *first, const orb_tips *second, int32_t most, orb_tip_match *out);

/* A copy whose tips are matched. The survey has distances. All is borrowed. */
typedef struct orb_branches {
  const orb_coarse_copy *copy;
  const orb_survey *survey;
  const orb_tips *tips;
} orb_branches;

/* The rough maps that a match gives, a vertex of the other copy for each vertex of either one: each goes where it is at
 * the same place along the limbs and the trunk between them, on the side of the limb to which the spheres carry it.
 * Only tips with a partner count: knees and elbows, which one shape has and the other has not, part no limb. O(n² ·
 * pairs): about 0.004 s for 350 vertices. */
ORB_MUST_CHECK orb_status orb_branches_map(orb_context *ctx, const orb_branches both[2], const orb_tip_match *match,
                                           int32_t *const out[2]);

#endif
