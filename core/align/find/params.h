/* The thresholds, weights and counts of the search for correspondences, for this folder, given/ and auto/. A constant
 * that only one function needs stays beside it: two in align/auto/auto.c, two in suspects.c.
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

/* Steps that the map of a further shape is expected to take, those for each of its vertices, and those for each vertex
 * of a shape that follows its copy; only progress depends on them (context.h). Of 13 pairs of people, animals and
 * objects with 2,800 to 14,000 vertices, with landmarks and without, each takes 1.5 to 10 million, 4 in the median. */
static const double ORB_FIND_STEPS_MAP = 1e6, ORB_FIND_STEPS_VERTEX = 500, ORB_FIND_STEPS_LIFTED = 60;
/* The same for each vertex where no map is composed: three stages of a walk (pin/walk.c), or a rotation. */
static const double ORB_FIND_STEPS_PLACED = 60;

/* Alignments that begin with another one (given/again.c). One with more energy than MOST, or with more above 1 than
 * TIMES that of its start, and MORE, is aligned anew: a landmark was moved to another limb, or the start was wrong. Of
 * three pairs whose landmarks were moved by up to 0.08 of the diagonal, the largest rise was from 0.10 to 0.18. These
 * pairs chose the limits; no others were looked at. */
static const double ORB_AGAIN_MOST = 2, ORB_AGAIN_TIMES = 1.25, ORB_AGAIN_MORE = 0.1;

/* Matches (match.c). */

enum {
  ORB_FIND_SMALL = 350, /* vertices of the copies of which trials are made: the time of each grows with the square of
                           this. With 500, as many pairs of animals are right. Rejected: to raise trials of 280 vertices
                           as well: of 84 pairs (seed 31) as many are right, and one more where one shape is
                           turned, for 15 % of the time of all */
  ORB_FIND_SMALL_AGAIN = 50, /* each further search has small copies with this many vertices more than the one before */
  ORB_FIND_AGAIN = 2,     /* further searches. Of two pairs of spiders that had gone astray, the best matches cost 0.28
                             to 0.30 with 400 and 450 vertices, and 0.37 and 0.53 with 350 */
  ORB_FIND_RAISED = 5,    /* trials that are raised to coarse copies: of 84 pairs of animals of other kinds, a right one
                             is among the first four in 72, and among all in 73 */
  ORB_FIND_COARSE = 1000, /* vertices of the copies on which raised trials are ranked, and of those of suspects.c */
  ORB_FIND_FINE = 8000,   /* vertices of the finer copies on which the best match is settled: with 4000, fingers are too
                             coarse for starts to follow, and maps of 20 pairs have 2 % more energy */
  ORB_FIND_FINE_BENT = 3000, /* the same where shapes bend more than ORB_FIND_WALKS_FIRST: walks take samples only */
  ORB_FIND_SETTLE = 3, /* rounds in which they settle: with 6, maps of 20 pairs of people are no nearer to the truth, */
  ORB_FIND_SETTLE_BENT = 6, /* but walks of shapes that bend more than ORB_FIND_WALKS_FIRST take samples of the targets,
                               and no slide follows: with 3, dog-walk to elephant-stand goes wrong */
  ORB_FIND_SPECTRAL = 6, /* spectral maps that are tried: of 40 pairs of posed people, the right one was among the first
                            two in 39, and the sixth of emmy-neutral and dan-twist. With 48, no more of 84
                            pairs of animals have a right map among them */
  ORB_FIND_ROTATIONS = 3, /* rotations of the spheres that are tried: the best of the rotation search */
  ORB_FIND_TIPS = 6 /* matches of tips that are tried (tips.h): with 12 or 24, no more pairs of animals are right */
};

/* A rotation by π in space multiplies the cost of a map by 1 + this, because files usually have shapes upright and
 * facing one way: a man matched back to front bends hardly more than one matched correctly. Of 131 pairs of animals of
 * other kinds, 4 more have the right map first than with 0.5; with 0.1 to 0.2 as many do. All of 40 pairs of people are
 * right with either. */
static const double ORB_FIND_ROTATION_COST = 0.15;
/* A trial costs its bend to this power, times exp(these times how much its poses resize the copies and how unlike they
 * leave normals) (evidence.h). Near the weights of a conditional logistic regression on the drawn pairs of the seeds
 * 17, 19 and 29, but lower, since with twice as much a pair of people and one of real meshes go wrong. Of these 252
 * pairs 240 have a right map first, and 234 by the bend alone; of as many of the seeds 23, 31 and 37 238 and 235. Limbs
 * go elsewhere in 10 of all 504 instead of 18. The power keeps the ratio of two costs about as large as that of bends.
 */
static const double ORB_FIND_BEND_POWER = 2.0 / 3, ORB_FIND_RESIZED_COST = 1, ORB_FIND_SCATTERED_COST = 1.33;
/* An area that counts as no smaller, in squared radii of a ball of the shape's area. A small copy's triangles have
 * 0.018 in the mean, a coarse one's 0.006. With ten times as much, one of 252 pairs fewer (seeds 23, 31 and 37) has a
 * right map first. */
static const double ORB_FIND_RESIZED_LEAST = 1e-4;
/* A spectral map that costs this much more than the first is not tried: among the pairs of posed people, none was
 * right. */
static const double ORB_FIND_SPECTRAL_BEHIND = 0.8;
/* Matches of tips (tips.h). First guesses, not varied. Lengths are in radii of a ball of the shape's area. */

/* A tip is farther out than every vertex within this distance, and at least this many times as far as the mean. */
static const double ORB_FIND_TIP_NEAR = 0.5, ORB_FIND_TIP_FAR = 0.9;
/* Partners are at most this far apart on the sphere, in radians: other proportions shift tips by up to 0.7. The angles
 * between two tips and between their partners differ by at most as much. */
static const double ORB_FIND_TIP_ANGLE = 1;
/* What a tip without a partner adds to the cost: as much as a mean angle of 17°. */
static const double ORB_FIND_TIP_ALONE = 0.3;
/* Shifts weigh as the inverse square of this plus the squared distance from a tip, against this weight of no shift.
 * Lengths on the unit sphere. */
static const double ORB_FIND_TIP_AT = 1e-4, ORB_FIND_TIP_STAYS = 1;

/* Matches of tips by how limbs branch (branches.h, branched.h). Chosen by trial on 16 of 48 pairs of people, one of
 * each pair with the proportions of an ape, or on 48 other pairs of the bodies of those 16. Where no line says so,
 * first guesses, not varied. */

enum {
  ORB_FIND_BRANCHED = 4, /* matches that are tried: left and right, and front and back, make four that branch alike */
  ORB_FIND_BRANCHED_AGAIN = 2 /* registrations after the first. With none, 12 of the 16 pairs are right instead of 14 */
};
/* An angle of one radian between partners costs as much as a trunk that differs by this. In radii of a ball of the
 * shape's area. */
static const double ORB_FIND_BRANCH_ANGLE = 0.3;
/* The length of a limb without a partner, in those radii, costs this many times as much: where one body sits, its knees
 * are tips as well, and with 0 they took the partners of feet: 38 of 48 pairs were right instead of 42. 0.1 and 1 do as
 * well. */
static const double ORB_FIND_BRANCH_LEFT = 0.3;
/* How places along limbs are bounded. With the middle of the shape instead of the far end of the trunk, 33 of the 48
 * pairs are right instead of 38: arms that are raised draw the middle to the shoulders. 0.1 and 0.9 for the root
 * give 37.
 *
 * The far end of the trunk is at least and at most this share of the way from a tip to the vertex farthest from it, and
 * the root of its limb this share of the way to that end. */
static const double ORB_FIND_TRUNK_LEAST = 0.2, ORB_FIND_TRUNK_MOST = 0.9;
static const double ORB_FIND_ROOT_LEAST = 0.2, ORB_FIND_ROOT_MOST = 0.8;
/* Tips weigh as the inverse square of this plus the place along the limb, where its root is at 1. */
static const float ORB_FIND_BRANCH_NEAR = 0.2F;
/* The cosine of the angle by which a place misses that to which the spheres carry it weighs this much against the
 * squared difference along the limbs. 0.1 does as well, and 1 a little worse. */
static const double ORB_FIND_BRANCH_SIDE = 0.3;
/* A trial that costs more than this many times what the best one costs is not improved. Before places followed the
 * trunk, 11 of the 16 pairs were right with 1, 13 with 1.2, and 14 with 1.5; but then a cow's nose goes to a leg of an
 * animal (test_align_match.c). */
static const double ORB_FIND_BRANCHED_BEHIND = 1.2;

/* Maps extended from what they agree on (agreed.h, extended.h). Chosen by trial on 18 pairs of animals of other kinds
 * that bend much, as generated by tests/samples, on copies of a thousand vertices; AGREED_INNER on 106
 * (docs/method.md). Lengths are in radii of a ball of the shape's area. */

/* If the best map bends the shapes more than this, all are extended. If it does even so, those that come near it are
 * crossed (crossed.h). People in poses bend less, and their maps are right. */
static const double ORB_FIND_EXTENDS = 0.14;
enum {
  ORB_FIND_EXTENSIONS = 3,         /* times that each is; with 6, no more pairs are right */
  ORB_FIND_EXTENSIONS_MIRRORED = 1 /* the same if trials are mirrored afterwards (mirrored.h): with 3, as many are */
};
/* A map that costs more than this many times what the best one costs is not crossed. Of 165 pairs of real meshes, the
 * best map afterwards cost up to 1.09 times as much before on coarse copies, and up to 1.16 in 95 % on small ones, of
 * which the best five are raised; a half of all maps cost more. */
static const double ORB_FIND_CROSSED_BEHIND = 1.15;
/* A vertex agrees if it comes back within this distance: an edge and a half of a small copy. */
static const double ORB_FIND_AGREED = 0.33;
/* If more than this share of the vertices agrees, nothing is left to extend: the next map bends the shapes by 1 or 2 %
 * less. */
static const double ORB_FIND_AGREED_ALL = 0.9;
/* The first time a map is extended, this share of the marks counts, the inner ones. With 1, 94 of 106 pairs come out
 * right instead of 99. */
static const double ORB_FIND_AGREED_INNER = 0.4;
/* A map is not extended again if an extension costs more than this many times what the best map cost at first: such
 * maps do not come back. */
static const double ORB_FIND_EXTENDS_BEHIND = 3;
/* Standard deviation of the logarithm by which true distances differ between the shapes, and what is added to
 * distances before: half the edge of a small copy. Without these weights, maps bend the shapes by 3 % more. */
static const double ORB_FIND_AGREED_STRETCH = 0.3, ORB_FIND_AGREED_EDGE = 0.1;
/* A mark weighs as the inverse square of its distance plus this. 0.1 and 0.3 do as well. */
static const float ORB_FIND_AGREED_NEAR = 0.2F;

/* If the best trial of small copies bends the shapes by this at most, trials of coarse copies are made too. People in
 * poses bend small copies by up to 0.15. Without, one of 80 pairs of people comes out wrong, emmy-sidebend and
 * fay-neutral. */
static const double ORB_FIND_COARSE_TOO = 0.2;
/* So they are if the raised trials bend the coarse copies by this at most, as much as people in poses do (EXTENDS):
 * thin legs have too few vertices on small copies, and the right match of two spiders bends these by 0.2 to 0.26. Of 42
 * pairs of animals of other kinds, each second one of the seed 17, one bends like that. */
static const double ORB_FIND_COARSE_BEND = 0.14;
/* Where a match bends coarse copies by at most COARSE_BEND, and its map has more energy than this, limbs are in wrong
 * places, and orbmorph searches ORB_FIND_AGAIN times more. Right maps have less (POSED_POOR): those of people whose
 * vertices were moved at random by a fifth of an edge have at most 1.5, and of spiders whose legs went astray 2.5 and
 * more. */
static const double ORB_FIND_AGAIN_ABOVE = 1.8;
/* Trials that take the first small copy to places this near, as a mean share of the diagonal, are one trial: the better
 * one is raised. A wrong limb moves more than this. */
static const double ORB_FIND_RAISED_APART = 0.04;

/* Symmetries (symmetry.h, mirrored.h). Chosen by trial on the 168 pairs of animals of other kinds that
 * tests/bench/correspond.py draws by the seeds 11 and 13, but for SYMMETRIC_STRETCH. */

enum {
  ORB_FIND_MIRRORS = 3, /* spectral maps of a shape to itself that are tried: of 28 animals in poses, the symmetry was
                           among the first three in 24 */
  ORB_FIND_SYMMETRIES = 2, /* symmetries that are kept: of a slim body, the best one need not be the right one */
  ORB_FIND_MIRRORED = 3    /* trials that are mirrored: with 6, no more pairs are right */
};
/* A map of a shape to itself that bends it more than this is no symmetry: those of bodies in poses bend them by 0.02 to
 * 0.14, and most maps that take a limb to a wrong one bend by more. */
static const double ORB_FIND_SYMMETRIC = 0.15;
/* Nor is one that changes distances along the surface by more than this, relative to the mean distance and as a median
 * over the vertices. Chosen on bodies of the seeds 17 and 19 and on one creature:
 * those of 53 of 55 animals in poses change them by 0.04 to 0.08, and of two by 0.10. A creature
 * with four limbs of unlike lengths, which has none, has maps to itself with 0.113 that bend it by 0.05. */
static const double ORB_FIND_SYMMETRIC_STRETCH = 0.11;
/* A second symmetry is kept if it bends at most this many times as much as the first: the right one of a slim body may
 * bend it a little more than a wrong one. With 1.6, three symmetries and five maps tried, as many pairs are right. */
static const double ORB_FIND_SYMMETRIC_BEHIND = 1.3;
/* A map that is off by the radius of a ball of the shape's area, in the mean, costs 1 + this times as much: right maps
 * are off by 0.1 to 0.3, those with a wrong limb by 0.4 to 1. With 0.5 to 1, as many pairs have the right map first;
 * with 0 or 2, up to 4 of 84 fewer. */
static const double ORB_FIND_ASYMMETRY_COST = 1;

/* A shape that is a part of the other one (inset/). Lengths are in radii of a ball of the part's area, but for `width`.
 * Chosen by trial on 98 pairs of heads and busts as generated by tests/samples, and on 525 pairs of other shapes. */

enum {
  ORB_FIND_INSET_PAIRS =
      24, /* vertices that are held like landmarks: with 24 true landmarks a head lies better than with 8 */
  ORB_FIND_INSET_FEWEST = 8,     /* of them that are held beside landmarks; fewer do not keep a part in its place */
  ORB_FIND_INSET_LANDMARKS = 16, /* most landmarks with which a part is looked for: more show one by themselves
                                   (map/space/part.h) */
  ORB_FIND_INSET_SAMPLES = 200,  /* vertices that follow closest points at the end */
  ORB_FIND_INSET_LOOKUPS = 48,   /* of them that are looked up in the grid: with 32, more heads come out turned */
  ORB_FIND_INSET_NODES = 18,     /* of the grid along the longest side of the large shape: a head has 6 then */
  ORB_FIND_INSET_TURNED = 4,     /* places that are turned about their middles */
  ORB_FIND_INSET_STAGES = 5,
  ORB_FIND_INSET_SIZES = 4
};

/* How places follow closest points: fewer places, more samples and narrower weights from stage to stage. With 16 places
 * at first, half of the heads come out turned. */
typedef struct orb_find_inset_stage {
  int turns;  /* the best places are turned about their middles first */
  int places; /* the best ones that differ follow; 0: all, of which those of one turn may differ in size alone */
  int samples, rounds;
  double width; /* standard deviation of the weight of a closest point, over its distance, in radii of a ball of the
                   large shape's area: at first the reach of a step of the grid, at last the depth of a face */
} orb_find_inset_stage;
static const orb_find_inset_stage ORB_FIND_INSET_STAGE[ORB_FIND_INSET_STAGES] = {
    {0, 0, 48, 6, 0.3},
    {0, 100, 64, 6, 0.2},
    {1, 60, 64, 5, 0.2},
    {0, 30, 120, 8, 0.12},
    {0, 8, ORB_FIND_INSET_SAMPLES, 8, 0.06}};
/* Shapes that bend less than this match as wholes, and no part is looked for. A head bends by 0.1 to 0.26 on a bust;
 * half of the people in poses bend less. */
static const double ORB_FIND_INSET_BENDS = 0.05;
/* A box longer than this, at the area of a ball of radius 1, is that of no body. */
static const double ORB_FIND_INSET_LONGEST = 1e3;
/* Sizes at which the part is tried, both shapes at one area. */
static const double ORB_FIND_INSET_SIZE[ORB_FIND_INSET_SIZES] = {0.74, 0.6, 0.48, 0.38};
/* A place is left early if the mean weight of its first samples is below this: half of what a place has that is off by
 * a step of the grid. */
static const double ORB_FIND_INSET_BAD = 0.15;
/* Degrees by which turns lie between those that are 44° apart: about half of that. */
static const double ORB_FIND_INSET_BETWEEN = 24;
/* A place that shrinks below this size while it follows closest points is lost: half of the smallest part. So is one
 * that grows to the size of the large shape. */
static const double ORB_FIND_INSET_LOST_BELOW = 0.2;
/* Places nearer than this are one: the sum of the distance of their middles and of the angle between them, in radii of
 * the part and radians. */
static const double ORB_FIND_INSET_SAME = 0.15;
/* A vertex lies on the large shape if it is this near, and if the cosine of the normals is at least FACING. */
static const double ORB_FIND_INSET_NEAR = 0.12, ORB_FIND_INSET_FACING = 0.6;
/* Shapes of sizes outside of this range are no part of each other: at 0.8 and more, one body in two poses, of which the
 * torso fits; below 0.4, anything on a limb. Heads have 0.65 to 0.7 on busts. Landmarks show a part up to 0.758
 * (part.scale in map/engine/params.c). */
static const double ORB_FIND_INSET_SMALLEST = 0.4, ORB_FIND_INSET_LARGEST = 0.75;
/* The share of the part that lies on the large shape. Of 98 heads on busts, half of them turned, 96 are found at the
 * right place, with 0.79 to 0.97. Of 525 pairs of other shapes, 5 have 0.69 to 0.75 with as little that is stray. */
static const double ORB_FIND_INSET_SHARE = 0.78;
/* From the second stage on, no landmark ends farther from its partner than OFF. In three heads on busts, the right
 * place has up to 0.3, and others have 2 and more; of 27, one is missed with 0.5. Pairs nearer to a landmark than APART
 * are not held. In radii of a ball of the part's area, and for APART of each shape's. */
static const double ORB_FIND_INSET_OFF = 0.8, ORB_FIND_INSET_APART = 0.25;
/* The similarity of the landmarks is the only start if one of them is this far from the first one, in radii of a ball
 * of each copy's area, and another one is this far beside the line through both, relative to that distance. Of
 * landmarks up to 0.03 beside a line, with 2 % of noise, two in six laid a head at a wrong turn. First guesses, not
 * varied. */
static const double ORB_FIND_INSET_SPREAD = 0.4, ORB_FIND_INSET_BESIDE = 0.15;
/* A map of a part with more energy than this is not taken: heads on busts have 1.4 to 4.3. */
static const double ORB_FIND_INSET_MOST_ENERGY = 10;
/* What the part does not cover is one piece, but for this share of the large shape. Busts have up to 0.06, and a horse
 * on whose torso the torso of a cow lies has 0.31. */
static const double ORB_FIND_INSET_STRAY = 0.12;

/* A map that costs this many times as much as the best one in one direction does not win by the other direction: the
 * bends of a right map in two directions differ by a factor of 1.5. */
static const double ORB_FIND_BEHIND = 2;
/* If the map of the best match has more energy than this, the next best match is tried as well, unless it costs
 * OTHER_BEHIND times as much. Three in four right maps of two people have at most 1.2. Of 56 pairs of real meshes and
 * five of people and animals, the next one led to the better map in three, and bent at most 1.12 times as much. */
static const double ORB_FIND_OTHER_ABOVE = 1.2, ORB_FIND_OTHER_BEHIND = 1.5;
/* The next best match replaces the best one if the bulk of its map exceeds 1 by less than this share of what the best
 * map's bulk does. From rougher registrations, the right map of dan-neutral and dan-twist had a share of 0.6 to
 * 0.91, depending on the last bits of sums. Other pairs of people, whose best match was right, had 1.02 to 1.6. */
static const double ORB_FIND_OTHER_GAIN = 0.95;
/* If a match bends the shapes more than this, walks are tried before the start from its targets. People in poses bend
 * by 0.02 to 0.13, and the start leads to the better map. Other shapes bend by 0.16 to 0.5, and mostly a walk does.
 * With 0.15, the right match of emmy-neutral and dan-twist was walked and lost. */
static const double ORB_FIND_WALKS_FIRST = 0.2;
/* If the best match bends the shapes more than this, and the start from its targets leads to a poor map, a walk comes
 * before that is drawn. People in poses, whose matches bend by 0.13 at most, are drawn first: of 40 pairs, a walk lost
 * two. Of shapes of other kinds, it saves up to half of the time. */
static const double ORB_FIND_WALKS_EARLY = 0.14;
/* If the volume of the first shape is less than this share of that of the second, at the same area, it moves in walks.
 * Of 41 pairs, the shape that moved with less energy both ways was the less round one in 35; in the others the volumes
 * were closer than this, but for two. */
static const double ORB_FIND_LESS_ROUND = 0.8;
/* Two shapes with landmarks are about as round if the volume of one is more than this share of that of the other, at
 * the same area. Of 240 alignments of people and animals in both orders, the 148 with a smaller share had 4 % less
 * error with the less round one first (12 % where proportions differ); the other 92 had 1 % less with the rounder one
 * first (4 % where both are one animal in two poses). */
static const double ORB_FIND_AS_ROUND = 0.95;
/* The finished walk of the next best match replaces that of the best one if it exceeds 1 by less than this share of
 * what that does: walks of one match differ by as much. */
static const double ORB_FIND_CONTEST_GAIN = 0.95;
/* The second best walk is finished as well if it exceeds 1 by at most this many times what the best one does: walks
 * towards one match differ by a tenth, so they do not tell closer ones apart. */
static const double ORB_FIND_CONTEST_CLOSE = 1.15;
/* If both walks of the match have more energy than this, the next best match walks too, unless it costs CONTEST_BEHIND
 * times as much. Of 25 such contests of 117 between real meshes, it won eight. */
static const double ORB_FIND_CONTEST_POOR = 2.5, ORB_FIND_CONTEST_BEHIND = 4;
/* The next best match walks in any case if it costs at most this many times what the best one does. Of 37 pairs of
 * animals of other kinds whose match is unsure (seed 31), this changes one, from wrong to right. */
static const double ORB_FIND_CONTEST_TIE = 1.05;
/* If the mean energy of the maps of several matches is above this, their pairs are pinned. Chosen when two shapes were
 * pinned as well: three such pairs came to 1.9, 2.2 and 4.4 in 10 s. */
static const double ORB_FIND_PINS_ABOVE = 2.5;
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
  ORB_FIND_HINT_LEAST = 4,   /* landmarks; fewer do not tell a pose from other proportions */
  ORB_FIND_HINT_FEW = 8,     /* landmarks that a match must agree with: as many as a body has tips. Fewer leave open
                                where its limbs go. With 4 or 24 at
                                first, a third of the pairs folded */
  ORB_FIND_HINT_SOURCES = 6, /* landmarks from which distances are measured; each takes 1 ms */
  ORB_FIND_HINT_ALL = 16,    /* from so many on, landmarks are taken to tell of all limbs; asking fewer takes 0.05 s */
  ORB_FIND_HINT_OPEN = 2     /* limbs without a landmark from which on it is open which is which: a single one has only
                                one place to go */
};
/* A landmark tells of a limb whose tip lies this near along the surface: the length of a foot and a shank. In radii of
 * a ball of the shape's area. This, ALL and OPEN are first guesses, not varied. */
static const double ORB_FIND_HINT_TELLS = 0.6;
/* Shorter distances are not compared: the copies have edges of 0.1. In radii of a ball of the shape's area.
 */
static const double ORB_FIND_HINT_FAR = 0.5;
/* If the distances between landmarks differ by more than STRETCH_MOST, as a mean logarithm, the shapes are not one body
 * in two poses: people have 0.03 to 0.24, different animals 0.12 to 0.57. If they differ by more than STRETCH, the
 * match may bend the shapes by BEND at most, unless a landmark walk has come to a poor map: there it bends people by up
 * to 0.13, and different animals by 0.16 and more. So walks follow a match of shapes that are not one body if it bends
 * them by more than BEND. */
static const double ORB_FIND_HINT_STRETCH = 0.16, ORB_FIND_HINT_STRETCH_MOST = 0.25, ORB_FIND_HINT_BEND = 0.15;
/* If a rough map takes the landmarks farther from their partners than this mean distance, it is another map. In radii
 * of a ball of the shape's area. */
static const double ORB_FIND_HINT_OFF = 0.5;
/* The same for landmarks that do not tell whether the shapes are one body, one to three mostly: the mean over so few is
 * rough, and a right map of other kinds may leave the end of a limb far from its place. Of 84 pairs of animals of other
 * kinds with one landmark, 67, 74 and 75 were right with 0.5, 1 and 1.5. The distance as a factor of the cost did not
 * help. */
static const double ORB_FIND_HINT_OFF_FEW = 1.5;
/* A rough map is not registered either if it maps the landmarks this many times as far from their partners as the best
 * one, and farther than that distance. For five pairs of people, all maps that came near the partners started at 0.16
 * to 0.5, the best one at 0.16 to 0.3, and others at up to 3. */
static const double ORB_FIND_HINT_ROUGH = 2;

/* The trial that landmarks make (hinted.c). */

enum {
  ORB_FIND_HINTED_LEAST = 8, /* landmarks; a first guess, not varied: the fewer, the more places are as far from all */
  ORB_FIND_HINTED_MOST =
      24, /* that are used, a multiple of 4: 48 million differences for two copies of 1,000 vertices */
  ORB_FIND_HINTED_AGAIN = 2 /* registrations after the first: a third one more changes little */
};
/* A difference of distances counts relative to the distance and this length. In radii of a ball of the shape's area. Of
 * three pairs with landmarks of docs/bench-truth.md, none bends by more than 6 % more with 0.05, 0.2, 0.5 or 2. */
static const double ORB_FIND_HINTED_NEAR = 0.5;
/* It is taken without a search if it bends the shapes by at most BEND, as little as a match must where distances
 * between landmarks leave it open. If it bends them by more than UNLIKE, a first guess, no search is expected to bend
 * them by that little: before it was registered again, those of a search bent a dozen pairs of docs/bench-truth.md and
 * of people 0.8 to 1.1 times as much. */
static const double ORB_FIND_HINTED_BEND = 0.15, ORB_FIND_HINTED_UNLIKE = 0.2;

/* If landmarks bend a pose more than this many times as much as it bends without them, they have twisted it. In 77
 * comparisons of people, with 8 and 24 landmarks, they bent it 0.7 to 1.4 times as much, or 6.6 times and more. */
static const double ORB_FIND_DRAWN_BEND = 2;

/* If both ways lead to maps of more energy than POOR, all other starts are tried as well. Right maps of people have at
 * most 1.5. Of two shapes, they are only tried if the match leads to more than LOST: of 11 pairs of animals of other
 * kinds with 8 landmarks whose matches led to 1.8 to 2.7, other starts took 1.3 CPU seconds each and led to less energy
 * in 4, by 3 to 5 %; where a match led to 3.4, they led to 1.6. If landmarks exclude that two shapes are one body, a
 * match is made where pins lead to no map or to one above LED; with fewer than ORB_FIND_HINT_FEW landmarks, to one
 * above energy.poor; with FEW or more that leave limbs open, to one above energy.good. With POOR instead of LED, 13 of
 * 334 alignments of pairs of animals of other kinds (seeds 31 and 41, 8 and 24
 * landmarks) had another map and a mean error of 4.2 instead of 3.7; matches of the 7 that pins led to 1.5 to 1.55
 * changed their error by little. */
static const double ORB_FIND_POSED_POOR = 1.8, ORB_FIND_POSED_LOST = 3, ORB_FIND_POSED_LED = 1.55;
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
 * lower them. Fitted by logistic regression with a weak ridge (tests/bench/confidence.py) to 299 pairs, 32 of them
 * wrong: the 251 drawn pairs of the seeds 17, 19 and 29 that were measured, and 48 of people and animals of the half
 * `choose`. Rounded, and the first one lowered by 0.3 for caution, since another draw may have more wrong ones.
 * docs/bench-confidence.md has what they give on other pairs. */
static const double ORB_FIND_SURE = 3.5, ORB_FIND_SURE_CLEAR = 3.8, ORB_FIND_SURE_BEND = 3.9,
                    ORB_FIND_SURE_ENERGY = 5.7;
/* Confidence in a part. Of 35 measured parts all were right, but they are heads and busts of one generator, so the
 * match does not count as sure. */
static const double ORB_FIND_SURE_PART = 0.75;
/* Two maps share the confidence as 1 to exp(−(lead − 1) / this): half of it is left if they bend the shapes alike. This
 * is about how much the bend of one map varies with the triangles of its shapes: a pear on a box of 11 to 26 edges a
 * side has 0.041 to 0.055. Of 0.05, 0.07, 0.1, 0.15 and 0.2 it has the least squared error on the half `choose`. */
static const double ORB_FIND_TIE = 0.1;
/* The assumed energy of a map whose energy is not known: that of a bad one. */
static const double ORB_FIND_SURE_UNMEASURED = 10;

#endif
