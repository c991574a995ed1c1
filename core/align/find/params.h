/* The thresholds, weights and counts of the search for correspondences, for this folder, given/ and auto.c. A constant
 * that only one function needs stays beside it: two in align/auto.c, two in suspects.c.
 *
 * Units. "Of the diagonal": a distance in space, relative to the diagonal of the shape's bounding box. Costs and
 * ratios have no unit.
 *
 * Origin. Chosen by trial on the half `choose` of the pairs of posed people of tests/bench/correspond.py, unless a line
 * names other data. Thresholds on the energy, which decide whether pairs are pinned, are in align/map/engine/params.h;
 * those of the registration are in the files of elastic/.
 */
#ifndef ORB_ALIGN_FIND_PARAMS_H
#define ORB_ALIGN_FIND_PARAMS_H

/* Matches (match.c). */

enum {
  ORB_FIND_COARSE = 1000, /* vertices of the copies that are registered, here and in suspects.c: the time of each trial
                             grows with the square of this */
  ORB_FIND_FINE = 8000,   /* vertices of the finer copies on which the best match is settled: with 4000, fingers are too
                             coarse for starts to follow, and maps of 20 pairs have 2 % more energy */
  ORB_FIND_FINE_BENT = 3000, /* the same where shapes bend more than ORB_FIND_WALKS_FIRST: walks take samples only */
  ORB_FIND_SETTLE = 3, /* rounds in which they settle: with 6, maps of 20 pairs of people are no nearer to the truth, */
  ORB_FIND_SETTLE_BENT = 6, /* but walks of shapes that bend more than ORB_FIND_WALKS_FIRST take samples of the targets,
                               and no slide follows: with 3, dog-walk to elephant-stand goes wrong */
  ORB_FIND_SPECTRAL = 6, /* spectral maps that are tried: of 40 pairs of posed people, the right one was among the first
                            two in 39, and the sixth of emmy-neutral and dan-twist. Each takes 0.03 s */
  ORB_FIND_ROTATIONS = 3 /* rotations of the spheres that are tried: the best of the rotation search */
};

/* A rotation by π in space multiplies the bend of a map by 1 + this, because files usually have shapes upright and
 * facing one way: a man matched back to front bends hardly more than one matched correctly. With 1 instead, bodies
 * whose files face away from each other are matched back to front. */
static const double ORB_FIND_ROTATION_COST = 0.5;
/* A spectral map that costs this much more than the first is not tried: among the pairs of posed people, none was
 * right. */
static const double ORB_FIND_SPECTRAL_BEHIND = 0.8;
/* A map that bends this many times as much as the best one in one direction does not win by the other direction: the
 * two directions of a right map differ by a factor of 1.5. */
static const double ORB_FIND_BEHIND = 2;
/* If the map of the best match has more energy than this, the next best match is tried as well, unless it bends
 * OTHER_BEHIND times as much. Three in four right maps of two people have at most 1.2. The factor is from rougher
 * registrations, in which the right match of dan-neutral and dan-twist bent 3.2 times as much as the wrong one. */
static const double ORB_FIND_OTHER_ABOVE = 1.2, ORB_FIND_OTHER_BEHIND = 4;
/* The next best match replaces the best one if the bulk of its map exceeds 1 by less than this share of what the best
 * map's bulk does. In those rougher registrations, the right map of that pair had a share of 0.6 to 0.91, depending on
 * the last bits of sums. Other pairs of people, whose best match was right, had 1.02 to 1.6. */
static const double ORB_FIND_OTHER_GAIN = 0.95;
/* If a match bends the shapes more than this, walks are tried before the start from its targets. People in poses bend
 * by 0.02 to 0.13, and the start leads to the better map. Other shapes bend by 0.16 to 0.5, and mostly a walk does.
 * With 0.15, the right match of emmy-neutral and dan-twist, the second of that pair, is walked and lost. */
static const double ORB_FIND_WALKS_FIRST = 0.2;
/* If the best match bends the shapes more than this, and the start from its targets leads to a poor map, a walk comes
 * before further starts. Of 40 pairs of people in poses, whose matches bend by 0.13 at most, two were lost by such a
 * walk: further starts led to the right map. Of shapes of other kinds, it saves up to half of the time. */
static const double ORB_FIND_WALKS_EARLY = 0.14;
/* If the volume of the first shape is less than this share of that of the second, at the same area, it moves in walks.
 * Of 41 pairs, the shape that moved with less energy both ways was the less round one in 35; in the others the volumes
 * were closer than this, but for two. */
static const double ORB_FIND_LESS_ROUND = 0.8;
/* The map of a match that bends more replaces that of the other one if it exceeds 1 by less than this share of what the
 * other does: maps of one match differ by as much. */
static const double ORB_FIND_CONTEST_GAIN = 0.95;
/* The second best walk is finished as well if its score is at most this many times the best one: walks towards one
 * match differ by a tenth, so they do not tell closer ones apart. */
static const double ORB_FIND_CONTEST_CLOSE = 1.15;
/* If the walks of the two best matches have more energy than this, the third one walks too, and what fits best in
 * space. That takes 1 s of processor time. With 1.7, one more pair of animals is right, person-walk to elephant-stand,
 * and every third of the 210 pairs takes that second. */
static const double ORB_FIND_CONTEST_POOR = 2.5;
/* If the mean energy of the maps of several matches is above this, their pairs are pinned. Chosen when two shapes were
 * pinned as well: three such pairs came to 1.9, 2.2 and 4.4 in 10 s. */
static const double ORB_FIND_PINS_ABOVE = 2.5;
/* If the map of two shapes has more energy than this after all matches, a start from what fits best in space competes.
 * Of eight pairs of other kinds, six came down by up to a half (human_man to shrec397, 5.6 to 2.7).
 * Where a contest is held, the same start takes part in it. It takes as long as a match. */
static const double ORB_FIND_SPACE_ABOVE = 2.5;
/* Up to this energy of rotated spheres the shapes are alike, such as balls with small features, and keep their given
 * spheres. The rotated spheres of people in poses have 4 and more. */
static const double ORB_FIND_ALIKE = 2;
/* The value of `clear` if all other maps are the same. */
static const double ORB_FIND_CLEAR_ALONE = 0.5;

/* The value of `lead` if all other maps are the same, and its largest value. */
static const double ORB_FIND_LEAD_ALONE = 2, ORB_FIND_LEAD_MOST = 100;

/* The mean distance of the images of vertices under two maps, as a share of the diagonal. Nearer maps count as one
 * correspondence and do not lower each other's confidence. */
static const double ORB_FIND_DIFFERENT = 0.15;

/* Matches that must agree with landmarks (hint.c). */

enum {
  ORB_FIND_HINT_LEAST = 4,  /* landmarks; fewer do not tell a pose from other proportions */
  ORB_FIND_HINT_FEW = 8,    /* landmarks that a match must agree with: as many as a body has tips. With 4 or 24 at
                               first, a third of the pairs folded */
  ORB_FIND_HINT_SOURCES = 6 /* landmarks from which distances are measured; each takes 1 ms */
};
/* Shorter distances are not compared: the copies have edges of 0.1. In radii of a ball of the shape's area.
 */
static const double ORB_FIND_HINT_FAR = 0.5;
/* If the distances between landmarks differ by more than STRETCH_MOST, as a mean logarithm, the shapes are not one body
 * in two poses: people have 0.03 to 0.24, different animals 0.12 to 0.57. If they differ by more than STRETCH, the
 * match may bend the shapes by BEND at most, unless a landmark walk has come to a poor map: there it bends people by up
 * to 0.13, and different animals by 0.16 and more. */
static const double ORB_FIND_HINT_STRETCH = 0.16, ORB_FIND_HINT_STRETCH_MOST = 0.25, ORB_FIND_HINT_BEND = 0.15;
/* If a rough map takes the landmarks farther from their partners than this mean distance, it is another map. In radii
 * of a ball of the shape's area. */
static const double ORB_FIND_HINT_OFF = 0.5;
/* A rough map is not registered either if it maps the landmarks this many times as far from their partners as the best
 * one, and farther than that distance. For five pairs of people, all maps that came near the partners started at 0.16
 * to 0.5, the best one at 0.16 to 0.3, and others at up to 3. */
static const double ORB_FIND_HINT_ROUGH = 2;

/* If landmarks bend a pose more than this many times as much as it bends without them, they have twisted it. In 77
 * comparisons of people, with 8 and 24 landmarks, they bent it 0.7 to 1.4 times as much, or 6.6 times and more. */
static const double ORB_FIND_DRAWN_BEND = 2;

/* If the map that such a match leads to has more energy than this, all other starts are tried as well: shrec397 to
 * shrec393 had 3.1 from noisy targets, and 1.4 from other starts. Right maps of people have at most 1.5. */
static const double ORB_FIND_POSED_POOR = 1.8;
/* A pose is given up after its first start if the pins have a map of this share of its energy or less. With 1, a pose
 * of two people that had 1.32 was given up for pins with 1.28, and would have come to 1.13; where shapes of other kinds
 * were, pins had 0.85 to 0.94. */
static const double ORB_FIND_POSED_BEATEN = 0.95;
/* No other starts are tried if the pinned map and that of the match differ by this share of the energy at most: where
 * two ways end alike, a third has not been seen to end better. Not varied; the share that two walks had to agree by. */
static const double ORB_FIND_POSED_AGREE = 0.03;

/* Found landmarks (found.c). */

/* Triangles of the first shape whose distortion gives the confidence of a landmark. Fewer make it depend on single
 * triangles, more make it less local. */
enum { ORB_FIND_PATCH = 64 };
/* No confidence falls while orb_match.clear (0 to 1) is at least this. Below it all fall in proportion: a second
 * candidate is then nearly as good. */
static const double ORB_FIND_CLEAR = 0.5;

/* Confidence in a match (match.c): 1 / (1 + exp(−odds)), where the odds, a natural logarithm, are these weights of 1,
 * of orb_match.clear (at most ORB_FIND_CLEAR), of orb_match.bend and of ln(energy of the composed map); the last two
 * lower them. Fitted by logistic regression with a weak ridge to 21 pairs of people and animals of the half `choose`, 3
 * of them wrong, and rounded. docs/bench-confidence.md has the pairs, and the half `report`. */
static const double ORB_FIND_SURE = 3, ORB_FIND_SURE_CLEAR = 3, ORB_FIND_SURE_BEND = 7, ORB_FIND_SURE_ENERGY = 10;
/* Two maps share the confidence as 1 to exp(−(lead − 1) / this): half of it is left if they bend the shapes alike. This
 * is about how much the bend of one map varies with the triangles of its shapes: a pear on a box of 11 to 26 edges a
 * side has 0.041 to 0.055. Of 0.05, 0.07, 0.1, 0.15 and 0.2 it has the least squared error on the half `choose`. */
static const double ORB_FIND_TIE = 0.1;
/* The assumed energy of a map whose energy is not known: that of a bad one. */
static const double ORB_FIND_SURE_UNMEASURED = 10;

#endif
