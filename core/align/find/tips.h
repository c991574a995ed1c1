/* Tips of limbs, and the rotations of the sphere of one shape that take most of them to those of another.
 *
 * Spheres that keep areas place limbs much alike, whatever their proportions. So a few tips that meet under a rotation
 * tell which limb is which, and no mirror image can pass. A spectral map has no such hold: other proportions change the
 * order of eigenfunctions. */
#ifndef ORB_ALIGN_FIND_TIPS_H
#define ORB_ALIGN_FIND_TIPS_H

#include "align/find/survey.h"
#include "align/sheet/copy.h"

enum { ORB_TIPS_MAX = 10 }; /* a body has 5 to 8 */

/* The vertices that are farther from all others, in the mean, than every vertex near them (Hilaga et al. 2001), the
 * farthest first. */
typedef struct orb_tips {
  int32_t count;
  int32_t vertex[ORB_TIPS_MAX];
  double point[ORB_TIPS_MAX][3];                /* on the sphere */
  double apart[ORB_TIPS_MAX][ORB_TIPS_MAX];     /* distances along the surface */
  double log_apart[ORB_TIPS_MAX][ORB_TIPS_MAX]; /* their logarithms */
} orb_tips;

/* Some tips of one shape and theirs on another, and the rotation that takes them there best. */
typedef struct orb_tip_match {
  int32_t count;            /* pairs */
  int32_t to[ORB_TIPS_MAX]; /* the tip of the second shape for each of the first, or −1; −1 beyond the last tip */
  double rotation[9];       /* of the first sphere */
  double cost; /* mean angle between partners, in radians, plus the mean logarithm by which distances between tips
                  differ, plus ORB_FIND_TIP_ALONE for each tip that could have a partner and has none */
} orb_tip_match;

/* Finds the tips of a copy of area 4π whose distances are measured. O(n²). */
ORB_MUST_CHECK orb_status orb_tips_find(orb_context *ctx, const orb_coarse_copy *copy, const orb_survey *survey,
                                        orb_tips *out);

/* The matches of least cost that differ, at most `most`, the best first; each has four pairs or more. Returns how many.
 * Starts from all pairs of tips on both shapes, as in RANSAC (Fischler & Bolles 1981): about 0.01 s. */
int32_t orb_tips_match(const orb_tips *first, const orb_tips *second, int32_t most, orb_tip_match *out);

/* Sets the rotation that takes the tips of the first shape best to their partners. */
void orb_tip_match_fit(const orb_tips *first, const orb_tips *second, orb_tip_match *match);

/* The mean angle between partners under the rotation, in radians. */
double orb_tip_match_angle(const orb_tips *first, const orb_tips *second, const orb_tip_match *match);

/* Inserts a match into a list of at most `most`, by rising cost, unless its pairs are listed. Returns how many are
 * listed then. */
int32_t orb_tip_match_keep(const orb_tip_match *match, int32_t most, int32_t count, orb_tip_match *list);

/* Where a match takes a point of one sphere (s 0: the first) on the other: the rotation, and near tips a shift that
 * takes them to their partners. */
void orb_tip_match_carry(const orb_tips *const tips[2], const orb_tip_match *match, int s, const double point[3],
                         double out[3]);

#endif
