/* Every threshold, weight and count of the search for correspondences, for this folder and auto.c.
 *
 * Units. "Of the diagonal": a distance in space, relative to the diagonal of the shape's bounding box. Lengths of tips
 * run along the surface; their unit is the mean distance of two points of it. Angles are in radians, scores and ratios
 * have no unit.
 *
 * Origin. Chosen by trial on the `auto` rows of docs/bench-truth.md, unless a line names other data.
 *
 * Sizes of arrays that tips and tip maps share are in tips.h. Thresholds on the energy, which decide whether to search
 * and what to compose, are in align/map/engine/params.h.
 */
#ifndef ORB_ALIGN_FIND_PARAMS_H
#define ORB_ALIGN_FIND_PARAMS_H

/* Trials (candidates.c). More find more and take longer: each rotation, tip map or spectral map costs a walk and some
 * sweeps on coarse copies, each composed candidate a whole composed map of these. */
enum {
  ORB_FIND_COARSE = 1000, /* vertices of a coarse copy */
  ORB_FIND_WALK = 300,    /* least vertices of the level on which tips walk */
  ORB_FIND_ROTATIONS = 3, /* rotations of the spheres that are tried: the best of the rotation search */
  ORB_FIND_TIP_MAPS = 8,  /* tip maps by distances that are tried, beside those by rotations in space */
  ORB_FIND_SPECTRAL = 4,  /* spectral maps that are tried */
  ORB_FIND_COMPOSED = 3,  /* candidates that are composed in full */
  ORB_FIND_FINE = 4000,   /* vertices of the finer copies on which the best match is settled (match.c) */
  ORB_FIND_SAMPLES = 48   /* points of the first shape whose images tell candidates apart */
};

/* Candidates (candidates.c, auto.c). */

/* A rotation by π in space multiplies the energy beyond 1 by 1 + this, because files usually have shapes upright and
 * facing one way: a man matched back to front has nearly the energy of the right map. */
static const double ORB_FIND_ROTATION_COST = 1;
/* Of the diagonal: mean distance of the images of the samples under two candidates. Nearer ones count as one
 * correspondence: only one of them is composed, and they do not lower each other's confidence. */
static const double ORB_FIND_DIFFERENT = 0.15;
/* Ratio of a candidate's cost to that of the rotation search after its rough sweeps. Only a candidate that is clearly
 * better is worth composing on the given meshes. */
static const double ORB_FIND_BETTER = 0.95;
/* Of the diagonal, a sum over both shapes: two tips are a pair of a spectral map if they are this near to one of its
 * pairs. */
static const double ORB_FIND_BESIDE = 0.15;
/* Difference of two spectral costs, which are logarithms: by how much the second map must cost more than the first for
 * the first to be taken as right. On the 40 pairs of posed people of tests/bench/correspond.py it was right in all 29
 * that exceed this, and in 6 of the other 11. */
static const double ORB_FIND_CERTAIN = 0.2;
/* Of the diagonal: mean distance of a map's images from where the spectral map that is taken as right puts them. A map
 * that is farther away is another correspondence: as a candidate it does not count, and as the map reached so far it is
 * replaced whatever its energy. */
static const double ORB_FIND_AGREES = 0.1;

/* Matches (match.c). */

/* A rotation by π in space multiplies how much a map bends by 1 + this, for the same reason as ROTATION_COST. Less than
 * that: bends differ more than energies, and files do lie in any direction. */
static const double ORB_FIND_TURN_COST = 0.5;
/* Of the pairs of posed people, no spectral map that costs so much more than the first was the right one. */
static const double ORB_FIND_SPECTRAL_BEHIND = 0.8;
/* A map that bends this many times as much as the best one in one direction does not win by the other direction: these
 * differ by a factor of 1.5 where the map is right. */
static const double ORB_FIND_BEHIND = 2;
/* What `clear` is where all other maps were dropped or are the same. */
static const double ORB_FIND_CLEAR_ALONE = 0.5;

/* Tips (tips.c). */
enum { ORB_FIND_SOURCES = 64 };                /* points from which distances are averaged; each costs one search */
static const double ORB_FIND_TIPS_APART = 0.2; /* tips nearer to each other count as one */
static const double ORB_FIND_TIP_LEAST = 1.1;  /* mean distance of a tip; a ball, where it is 1 everywhere, has none */

/* Tip maps by distances (tip_maps.c). */
enum { ORB_FIND_TIPS_LEAST = 3 }; /* tips of a map: two leave the rotation around their axis open */
/* Two lengths agree by 1 − r², at least WORST, with r the natural logarithm of their ratio over the spread: 1 for equal
 * lengths, 0 for lengths that differ by a factor of exp(spread). PAIR_SPREAD (a factor of 1.42) is for the distance of
 * two tips, FAR_SPREAD (1.28) for a tip's mean distance from the surface. WORST keeps one limb with other proportions
 * from ruling out a map. */
static const double ORB_FIND_PAIR_SPREAD = 0.35, ORB_FIND_FAR_SPREAD = 0.25, ORB_FIND_WORST = -2;
/* Weight of the distances, relative to that of directions, where a rotation is known. Directions say more: distances
 * prefer dozens of wrong maps where proportions differ, as for a stout cow and a lean animal. */
static const double ORB_FIND_PAIR_SHARE = 0.05;

/* Choice among them (tip_choice.c). */

/* Radians between two rotations that count as one. Maps are taken alternately from each group, because the best maps by
 * distances alone are often permutations of one map. */
static const double ORB_FIND_SAME_GROUP = 1;
/* Difference of two fits (0 to 1): a map is left out if its mirror image fits better by more than this. */
static const double ORB_FIND_MIRRORED = 0.15;
/* Least factor (0 to 1) of a map's score for how well a rotation fits its tips. A map that no rotation fits keeps this
 * share of its score, so distances still rank such maps. */
static const double ORB_FIND_LEAST_FIT = 0.1;

/* Tip maps by rotations in space (tip_rotations.c). */
enum { ORB_FIND_STEPS = 8 };                       /* most steps of matching and fitting from one rotation */
static const double ORB_FIND_DIRECTIONS_APART = 1; /* radians: tips in directions farther apart are not matched */

/* Found landmarks (found.c). */

/* Triangles of the first shape whose distortion gives the confidence of a landmark. Fewer make it depend on single
 * triangles, more make it less local. */
enum { ORB_FIND_PATCH = 64 };
/* orb_candidate.clear (0 to 1) from which no confidence falls. Below, all fall in proportion: a second candidate is
 * then nearly as good. */
static const double ORB_FIND_CLEAR = 0.5;

#endif
