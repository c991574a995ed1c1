/* Which points of two shapes correspond, by rough maps, ranked by how much they bend the shapes and by what else tells
 * right limbs from wrong ones. If there are landmarks, they exclude maps, and draw the best of the others to their
 * partners.
 *
 * In: two meshes. Out: where each vertex of the second lies on the first. Read in this order:
 *
 *   hint.h    what landmarks say of a match
 *   survey.h  what trials share of a copy
 *   tips.h    tips of limbs, and rotations of the spheres under which they meet
 *   branches.h, branched.h
 *             matches of tips by how limbs branch, and trials of them
 *   evidence.h what a registration tells beside its bend
 *   trials.h  rough maps, registered and ranked
 *   agreed.h, extended.h
 *             rough maps that follow from the part on which a trial agrees with its way back
 *   crossed.h registrations along the way back of the other direction
 *   symmetry.h, mirrored.h
 *             the mirror symmetries of the copies, and trials that keep them
 *   raised.h  the best trials, on finer copies
 *   open_limbs.h
 *             how many limbs landmarks say nothing of
 *   hinted.h  the trial that eight landmarks or more make, without a search
 *   match.h   the best of them, its pairs and its targets
 *   inset/    whether one shape is a part of the other one (inset/inset.h)
 *   found.h   the landmarks that an alignment found, and their confidence
 *   contest.h which way leads to the better map
 *   params.h  all thresholds
 *
 * Decimated copies of both shapes are registered to each other along each rough map, in both directions
 * (elastic/elastic.h). The maps come from the eigenfunctions (spectral/spectral.h), which hardly depend on the pose,
 * and from rotations of the spheres, by positions and normals (align/rotate/correlate.h) or by tips, which hardly
 * depend on proportions. A map of the right limbs bends the copies least, even if it is off at their tips. A twin (left
 * and right swapped with front and back) bends them more, and often also rotates them in space.
 *
 * All maps are tried on small copies, where a registration takes 3 ms; where shapes bend much, those of branches are
 * added and all are extended there, those near the best are crossed, and the best are mirrored. The best few are
 * registered again on copies three times as fine, and ranked. Bodies in poses, which bend the small or the finer copies
 * little, get maps made on the finer ones as well.
 *
 * Rejected: ranking all candidates by the energy of their composed maps on the coarse copies. That energy depends on
 * the course of a walk: one right map had 4.05, and 1.37 with its tips shifted a little. Right and wrong maps differ by
 * no more than that. */
#ifndef ORB_ALIGN_FIND_MATCH_H
#define ORB_ALIGN_FIND_MATCH_H

#include "align/find/hint.h"
#include "align/find/inset/inset.h"
#include "align/map/engine/guide.h"

enum {
  ORB_MATCH_PAIRS = 12, /* most pairs of a match */
  ORB_MATCH_OTHERS = 4  /* most maps that are listed beside the best one */
};

/* Pairs of vertices that correspond roughly; the ends of limbs come first. */
typedef struct orb_match_pairs {
  int32_t count;
  int32_t first[ORB_MATCH_PAIRS], second[ORB_MATCH_PAIRS];
} orb_match_pairs;

typedef struct orb_match_other {
  double cost; /* as a multiple of the best map's: at least 1. From one direction alone where that dropped the map */
  double bend; /* how much it bends, likewise */
  orb_match_pairs pairs;
} orb_match_other;

typedef struct orb_trials orb_trials; /* trials.h */

typedef struct orb_match {
  int is_found;    /* 0: a shape has too few vertices, or no map was found; only is_unsure, is_unlike, leaves_open and
                      inset are filled then */
  int is_unsure;   /* 1: a map was found, but landmarks and its bend leave open whether the shapes are one body */
  int is_unlike;   /* 1: distances between landmarks exclude that the shapes are one body; a map is then only looked for
                      if the hint allows it */
  int leaves_open; /* 1: no match was looked for, because landmarks exclude one body, and several limbs have none near
                      their tips. Only if the hint asks for it, and one shape is no part of the other one */
  double walks_above; /* walks follow the best map if it bends the shapes more than this */
  double bend;        /* how much the best map bends, the mean of both directions: 0 for a rigid motion */
  double cost;        /* of its trial (trials.h) */
  double clear;       /* 0 to 1: how far the next best map that differs is behind */
  double lead; /* the geometric mean of two ratios of the nearest other map to the best one: of their bends, and of
                  their costs. About 1 if a shape looks alike from several sides */
  int moves; /* which shape moves where only one does: the second (1), unless the first (0) is clearly less round. Limbs
                that move stretch to where they go; limbs that stay are left out by the triangles of a round shape */
  orb_match_pairs pairs;
  int32_t other_count; /* maps that differ from the best one and from each other by more than ORB_FIND_DIFFERENT */
  orb_match_other other[ORB_MATCH_OTHERS]; /* by rising cost */
  orb_inset inset;    /* whether one shape is a part of the other one; only searched if `walks` or the hint says so, and
                         if the shapes bend, or landmarks exclude a match. With a hint, the map is then not finished */
  double *target;     /* the caller's to set, with orb_match_target() or orb_match_aim(); freed with the match */
  orb_trials *trials; /* the candidates, for the functions below */
} orb_match;

/* hint: NULL, or landmarks. With landmarks, a match is found only if the shapes are as much alike as the hint demands.
 * Only maps that take the first few landmarks near their partners count; the targets
 * then take all landmarks there. walks: landmark walks lead to the map of shapes that bend much; they need samples of
 * the targets only, so these come from coarser copies; and without landmarks two shapes that bend are searched for a
 * part, which takes another 0.1 s. Free `out` in any case. About 0.5 s of one thread, whatever the size. Trials run on
 * all threads, and the result has the same bytes for any number of them. */
ORB_MUST_CHECK orb_status orb_match_find(orb_context *ctx, const orb_mesh *first, const orb_mesh *second,
                                         const orb_match_hint *hint, int walks, orb_match *out);
/* orb_match_find() without a hint (number 0), or a further such search (1 and so on) from small copies of more
 * vertices: another draw where those before have led to a poor map. */
ORB_MUST_CHECK orb_status orb_match_find_again(orb_context *ctx, const orb_mesh *first, const orb_mesh *second,
                                               int32_t number, int walks, orb_match *out);
/* Computes where each vertex of a shape lies on the other one, in its space, 3 per vertex: by the best map (n 0) or by
 * other[n − 1]. moving: 0, the first shape, or 1, the second. Landmarks draw it to their partners. *target: the
 * caller's to free, also on failure; NULL if a degenerate shape cannot be registered back, which the best map excludes.
 * The meshes of the match must still exist. Targets of different n may be computed side by side, since each completes
 * its own trial; so may both targets of n 0, since the best trial is complete. About 0.1 s of one thread.
 */
ORB_MUST_CHECK orb_status orb_match_target(orb_context *ctx, const orb_match *match, int32_t n, int moving,
                                           double **target);
/* The same for the second shape and the best map, later: makes room in match->target, and sets *aim to what fills it.
 * The match must outlive it. */
ORB_MUST_CHECK orb_status orb_match_aim(orb_context *ctx, orb_match *match, orb_map_aim *aim);
/* Makes other[k] the best map; the former best map becomes the first of the others. target: NULL, or that of other[k];
 * the match takes ownership of it, also on a failure. clear: how far the former best map is behind, by the measure that
 * decided. Sets lead to 1, because the bends contradict the choice. */
ORB_MUST_CHECK orb_status orb_match_choose(orb_context *ctx, orb_match *match, int32_t k, double *target, double clear);
/* Makes the best map the first of the others, because the map that was composed follows none of them. The match is then
 * only to be described: its others no longer belong to its trials. */
void orb_match_demote(orb_match *match);
/* The confidence in a match, 0 to 1, from its bend, its `clear`, its `lead` and the energy of the map that followed it:
 * calibrated (docs/bench-confidence.md). */
double orb_match_confidence(double bend, double clear, double lead, double energy);
void orb_match_free(orb_context *ctx, orb_match *match);

#endif
