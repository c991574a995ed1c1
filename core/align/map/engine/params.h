/* Every threshold, weight and count of the composed map and its starts; params.c has their values for each preset.
 *
 * Units. An energy is the symmetric Dirichlet energy of the composed map, 1 for an isometry. Lengths in space are those
 * of shapes scaled to area 4π, unless a field says "of the diagonal". A level size is a number of vertices. Work is
 * counted in steps of single vertices, divided by the number of vertices of the moving shape.
 *
 * Origin. A field that names no origin was chosen by trial on the pairs of docs/bench-truth.md. Sizes of parallel
 * slices stay where they are used: no result depends on them.
 */
#ifndef ORB_ALIGN_MAP_ENGINE_PARAMS_H
#define ORB_ALIGN_MAP_ENGINE_PARAMS_H

#include "orbmorph/embed.h"

/* Sizes of arrays; chosen by trial where no reason is given. */
enum {
  ORB_MAP_COLOURS = 64,          /* colours of the vertices of a level: bits of a uint64_t */
  ORB_MAP_LANES = 8,             /* triangles of a star that are computed at once: doubles of a vector of 512 bits */
  ORB_MAP_RING_MAX = 256,        /* triangles of a star; a vertex with more does not move */
  ORB_MAP_STEP_RING_MAX = 62,    /* triangles of a star that the vector loops step; step.c steps larger ones */
  ORB_MAP_MIRROR_SAMPLES = 200,  /* samples of a surface that test a mirror plane */
  ORB_MAP_MIRROR_PLANES = 3,     /* mirror planes of one shape that are kept */
  ORB_MAP_SPECTRAL_SAMPLES = 48, /* at most; as many as orb_spectral_find() has */
  ORB_MAP_LIMBS = 12,            /* rotated parts of a surface that are examined for a twist, the largest first */
  ORB_MAP_BANDS = 16,            /* rings of a limb: more resolve the twist better, fewer have more vertices each */
  ORB_MAP_IRON_ROUNDS = 4,       /* of ironing, each of other parts */
  ORB_MAP_GUIDED = 6,            /* guided walks; one takes 0.1 to 0.4 s on its coarse level */
  ORB_MAP_GUIDED_FEW = 2,        /* those with few samples */
  ORB_MAP_CROSSINGS = 400,       /* edges that one step of a vertex crosses at most; a guard against rounding */
  ORB_MAP_RING_CROSSINGS = 8192  /* the same for a ring around a limb */
};

typedef struct orb_map_params {
  /* What the energy of a map says. */
  struct {
    double good; /* up to this energy the shapes correspond, and no further start is tried */
    double poor; /* above this energy a start has been caught on the way */
    double cap;  /* of one triangle; keeps a few nearly degenerate ones from hiding the others */
    double bulk; /* the cap for the bulk of a map, which says whether limbs go to their limbs. The energy also says how
                    much the map crumples, and that is close to chance. Of ten comparisons of a right match of people
                    with a wrong one, the energy misled six times, the bulk never */
  } energy;

  /* How long to continue: more work finds better maps of shapes that differ, and takes longer. */
  struct {
    int all;          /* for clearing flips and for further starts. Default: two meshes of 15,000 triangles align in
                         about 2 s */
    int given_up;     /* the work that a start counts for if it is given up at once. Without it the draws would run
                         for longer than if the start had run, and gain nothing */
    int untwisted;    /* least work left for registrations after an untwisting that helped */
    int untwist;      /* least work left for loosening while limbs are untwisted */
    int passes;       /* most registrations through samples of the best map */
    double pass_gain; /* passes end with one that does not bring the energy below this share of the last one's */
    double far_above; /* a start registered through the best map is given up if its first map has this many times the
                         energy of that map: in trials none came to a better one */
    int rough;        /* 1: the alignment as given is only refined far enough to be sampled */
  } work;

  /* Which shape moves. */
  struct {
    double share; /* share of the moving shape's triangles whose images are inverted; fewer are no reason to swap */
    double ratio; /* of that share to the share with the shapes swapped; more is a reason to swap */
  } swap;

  /* Levels of a start, and sweeps on them. */
  struct {
    int32_t spatial;    /* level at which a start from spatial targets begins. Coarser is faster and folds more */
    int32_t given;      /* the same for the start that follows a crumpled one */
    int32_t mapped;     /* level at which a start from a map begins: a coarser one would fold it */
    int32_t last;       /* level beyond which a start gives up untangling */
    int32_t kept;       /* least vertices of the coarsest level if vertices are kept on it, */
    int32_t kept_each;  /* and least vertices of it for each kept one */
    double growth;      /* from level to level; less is more careful */
    double last_growth; /* a level that all vertices exceed by less than this factor becomes the level of all */
    int first_sweeps;   /* most sweeps on the first level, */
    int coarse_sweeps;  /* on a later one of fewer than `coarse` vertices, */
    int level_sweeps;   /* on a later one, */
    int final_sweeps;   /* and on the level of all vertices */
    int rough_sweeps;   /* most sweeps on each level of a rough refinement */
    int32_t coarse;
    int new_steps;    /* steps of a vertex that has just come back */
    double loosen;    /* strength of the barrier while a level is loosened */
    double rigid;     /* energy of a level up to which nothing locks, so that only the last level is loosened. Where
                         walks come first, all starts are loosened on their last level only: of 23 pairs, more changed no
                         energy */
    double pull;      /* of the spatial targets on the first level, */
    double pull_fall; /* and its factor from level to level */
  } level;

  /* Decimated copies, which are aligned in place of large shapes. */
  struct {
    int32_t size;  /* vertices of a copy: on fewer, limbs with few triangles lose their shape */
    int32_t large; /* vertices above which the later shapes are copied, and a first shape does not move. Below, the
                      whole shape costs less than a copy and its lift */
    int32_t rough; /* vertices above which the lift does not loosen its levels: that takes as long as all sweeps, and
                      brings less the finer a level is */
    double poor;   /* energy of a copy's map above which its lift is rough and does not iron: such shapes do not
                      correspond. Five pairs align in 0.5 to 0.7 of the time, and come to 4 % more energy */
    double hold;   /* pull that holds the vertices of a copy in its lift, as slide.pull. Without it they go back from
                      where a slide has taken them: with 8 landmarks, eight pairs of 26,000 vertices stay 23 % farther
                      from the truth than on a fourth of the vertices. They stay 15 % farther with 30, 6 % with 300, 5 %
                      with 1,000 and 4 % with 3,000, which raises the energy by 0.3 % */
  } copies;

  /* From targets that are given. */
  struct {
    int work;        /* least work of each step after the first, as work.all: a start that is given up takes some */
    double hopeless; /* energy of a start above which nothing else is tried */
    double alike;    /* energy up to which a map is good on spheres that keep areas: these shapes are alike, or agree in
                        the distances between their landmarks, so less than energy.good can be reached */
    double walked;   /* energy of the first start, drawn, above which walks are tried. Maps of two people in other poses
                        have up to 1.5, and walks led to 0.1 to 0.5 more */
    double folded;  /* the first start begins on a coarser level if clearing flips raises the energy of its first one by
                       more than this factor. With 1.25 to 1.32 three pairs of people came to 1.06 to 1.13 from it, two
                       of them to 1.10 and 1.25 from a coarser one; with 1.38 to 1.54 two pairs came to 1.22 to 1.88, and
                       to 1.14 to 1.23 from a coarser one */
    double uneven;  /* energy above 1 of a first map with landmarks, as a multiple of that by energy.bulk, above which
                       few triangles have much of it, and a start from smooth targets follows: of 76 maps of people and
                       animals, 14, of which four gained. Right maps without crumples have 1.5 to 2 */
    double crumple; /* and its energy beyond that by energy.bulk: less is hardly worth a start. These three were chosen
                       on people, animals and real pairs of both halves, with 8 and 24 landmarks */
    double smooth_flips; /* flips of that start, as a multiple of those of the first one, up to which it is made. The
                            starts that led to a better map had 0.04 to 1.23 */
    double crumpled;     /* energy of the first start up to which it is drawn at once */
    double drawn;        /* energy above which the map is not drawn: it stays caught */
    int passes;          /* 1: passes follow (targets.c) */
    double gain;        /* a map is drawn again if the first draw has brought the energy below this share. In 38 runs of
                           people, animals of both halves and others, the second draw gained at most 0.1 % after a smaller
                           gain (23 runs), and up to 4 % after a larger one. With `quality` it always is */
    double contested;   /* energy of a pose above which pins compete with it, as a rival or afterwards: energy.poor. Of
                           seven poses below it (1.26 to 1.37), pins took two fifths of the CPU time; they won in two,
                           by 0.1 and 2 % of the energy and none of the error */
    double asked_first; /* energy above which it is asked before the map is drawn, which is work in vain if the rival
                           wins. A draw takes up to a tenth off the energy, which may bring a map below `contested` */
  } targets;

  /* The quick way: a landmark walk optimised on a coarse level. */
  struct {
    int32_t size;    /* least vertices of that level */
    int sweeps;      /* most sweeps on the levels before it, */
    int last_sweeps; /* and on it */
    int loosen;      /* sweeps with flips allowed, and again without, of one loosening */
    int loosen_most; /* loosenings of the last level. They cost a tenth of those with all vertices, and leave little to
                        loosen there */
    double hold;     /* strength with which the spatial targets hold a guided walk, relative to the energy of a vertex's
                        area. Of 168 pairs of animals of other kinds (seeds 11 and 13), 147, 149 and 151 are right with
                        10, 30 and 100, and the medians of the energy are 1.29, 1.30 and 1.33 */
    double gain;     /* of the energy, relative: a loosening that gains less counts as idle */
    double
        barriers[2]; /* of a loosening, and of the one after an idle one: a weak barrier frees more, and folds more */
    double hopeless; /* energy of the first level above which the walk has twisted limbs that no finer level repairs */
    double twisted;  /* the same for the last level */
    double lost; /* energy of the best guided walk above which it is not loosened. Of 249 walks of real meshes 50 had
                    more. Five of these won their contests, in which all walks had more, and loosening had lowered
                    them by 1 to 7 % */
    int work;    /* least work of each guided walk, as work.all */
    int32_t guides[ORB_MAP_GUIDED];  /* samples of the spatial targets that guide one walk each, spread over the moving
                         shape, or over the fixed one where the number is negative. Few let a limb twist, many make the
                         walk get stuck, and which is best is close to chance. With three at most, 161 of 168 pairs of
                         animals of other kinds are right as with six (seeds 17 and 31), with 0.2 % more energy in
                         2 % less time */
    int32_t few[ORB_MAP_GUIDED_FEW]; /* the same if none of these led to a map: a blade has no room for more */
    double enough;                   /* energy of a coarse map up to which no further walk is tried */
    double refines; /* coarse energy, as a multiple of that of the best map, below which it is refined: of
                       10 pairs, a refined walk had 0.88 to 1.04 of its coarse energy */
    int beat_most;  /* most walks where run->beat is known */
    double agree;   /* difference of two such energies, relative to what exceeds 1, up to which no further one is tried:
                       both walks came to one basin */
  } walked;

  /* Sweeps over a level. */
  struct {
    double still;        /* of a mean edge: a vertex that moved less waits, if its neighbours did too. More is faster */
    int32_t still_share; /* sweeps end when at most one vertex in this many does not wait */
    double over;         /* over-relaxation where no flip is allowed; 1: none */
  } sweep;

  /* A step of one vertex. */
  struct {
    int tries;          /* lengths that a step tries before the vertex stays */
    double shrink;      /* least ratio of a sphere determinant after a step to before; less allows longer steps and
                           thinner triangles */
    double shorten;     /* a try's length relative to the one before it */
    double sufficient;  /* share of the predicted descent that a step must reach (Armijo) */
    double convexity;   /* least eigenvalue of the Hessian relative to the greatest; smaller ones are raised to it */
    double least_slope; /* relative to the energy: a step that promises less is not tried */
  } step;

  /* The energy of a star. */
  struct {
    double epsilon;    /* of the regularised area, relative to the smaller of the area and half the Dirichlet energy:
                          the larger, the more freely triangles turn right side out, and the less inversions cost */
    double flat;       /* share of the area that is added to the smaller of the two, so that ε is never 0 */
    double hinge;      /* the sphere's barrier begins at this share of the determinant that the areas would give */
    double soft_below; /* of the hinge: below it the soft barrier continues as a parabola, so that it stays finite */
    double soft_value; /* value of the barrier at soft_below, r − 1 − ln r */
    double upright;    /* shortest sum of a triangle's three normals: below it the triangle's own normal is used */
    double mollify;    /* least slack of a triangle's longest edge, relative to its mean edge, for its cotangents
                          (intrinsic mollification); more blunts the metric of thin triangles */
  } star;

  /* Clearing flips: rounds of sweeps against a growing barrier, then untangling. */
  struct {
    int32_t hopeless;      /* if more than one in this many triangles is flipped, the start is given up */
    int32_t unfold;        /* at most one flip in this many triangles is unfolded if no targets are given: these starts
                              compete with walks, which are better than what a large fold leaves */
    int rounds;            /* of a start */
    int sweeps;            /* of a round */
    double first_barrier;  /* strength in the first round. A weak one lets triangles pass each other */
    double again;          /* factor on it in a second attempt */
    double barrier_growth; /* from round to round */
    double flip_growth;    /* the rounds end if there are more flips than after the first round, by this factor: if a
                              harder barrier makes more flips, large parts are folded */
    double crumples;       /* rounds end with an unfolding that brings the energy to at most this many times what it was
                              with flips */
    int loosen_rounds;     /* after loosening, where few flips are expected */
  } clear;

  /* Untangling on the sphere: rounds of steps near the flips. */
  struct {
    int rounds;     /* most */
    int stale;      /* rounds without fewer flips that end it */
    int passes;     /* over the vertices of a round */
    int rings_most; /* rings around the flips that may move: one in the first round, and one more every fourth */
    int32_t few;    /* flips up to which each star has its own ε: the last few hide in stars that are far smaller
                       than a common ε */
    int tries;      /* lengths of a step */
    double shorten; /* a try's length relative to the one before it */
    double star_mean, star_worst; /* ε of a star: these shares of its mean absolute determinant and of its worst one,
                                     added */
    double all_mean2, all_worst2; /* ε² for all stars: these shares of the squares of 1 / triangles and of the worst
                                     determinant, added */
    double convexity;             /* least eigenvalue of the Hessian relative to the greatest, as in a step */
  } untangle;

  /* Setting crumpled parts of a map anew. */
  struct {
    struct {
      double crumpled; /* energy above which a triangle is set anew, */
      int rings;       /* with this many rings around it. Which are best differs from part to part */
    } round[ORB_MAP_IRON_ROUNDS];
    double enough; /* energy up to which a map is not ironed */
    double gain;   /* of the energy, relative: a round that gains less is the last */
    int sweeps;    /* of a round, */
    int loosen;    /* and of its loosening */
  } iron;

  /* Sliding the last map to where the shapes fit in space. Chosen on six pairs of posed people and six of animals of
     the half `choose` of tests/bench/correspond.py. */
  struct {
    double pull;    /* strength, relative to the energy of a vertex's area. Ten times as much follows closer, and costs
                       energy */
    int sweeps;     /* without flips, before and after */
    int loosen;     /* with flips allowed */
    double far;     /* from its target, in radii of a ball of the shape's area: beyond this a vertex is left behind. A
                       vertex that has arrived is within 0.03 */
    double left;    /* share of the vertices that may stay behind: where a leg had slid far, ten times as many did */
    double arrived; /* of those left, another draw leaves at most this share, or it is the last */
    int tries;      /* of a draw, as long as none is taken, */
    double weaker;  /* each with this share of the last one's pull. A first guess: a horse that runs, drawn to a cow,
                       came 1 % too high with all of it, and with 0.3 nearer to the truth by a quarter */
    double least;   /* energy of a map up to which it does not slide: it is an isometry but for how triangles lie, and a
                       slide would follow those. Not varied; one person in two poses has 1.02 and more */
    double most;    /* energy afterwards, relative to before. With 1.03, maps of animals of two kinds stayed: their
                       relief costs 3 to 9 %, and brings them nearer to the truth by a quarter */
  } slide;

  /* Drawing a map to where parts of the shapes fit in space. Chosen on three heads and busts, with 5 to 24 landmarks,
   * and on what other pairs of animals have. Lengths are of shapes of area 4π. */
  struct {
    double scale;  /* three of four distances between landmarks are larger by this factor on the same shape: it fits in
                      part. Heads and busts have 1.37 and more, other animals 1.27 at most */
    double spread; /* the upper quartile of these factors, over the lower one, is less: 1.03 to 1.31 for heads and
                      busts, 1.49 for a man and an armadillo, whose limbs differ in length */
    double off;    /* most distance of a vertex that fits, after registration; half of an edge of a copy. Not varied */
    double facing; /* least cosine between its normal and that of the fixed shape there. Not varied */
    double least;  /* share of the part's vertices that fit; less is no part. Real heads and busts have 0.7 and more, 54
                      generated ones 0.86. With 5 landmarks, distances misled in 5 of 84 pairs of other animals (seed
                      31): four of these have 0.33 to 0.64 */
    double most; /* energy after, relative to before, that is still taken. That of real heads and busts rises by a half
                    at most, that of generated ones by a seventh; of the five misled pairs to 1.1, 1.7, 1.9, 2.1 and
                    2.5 times */
  } part;

  /* Drawing a level without flips to its spatial targets. */
  struct {
    int rounds;    /* most */
    int sweeps;    /* with flips allowed, and again without */
    int clearings; /* rounds of clearing the flips that came */
    double pull;   /* strength in the first round, relative to the energy of a vertex's area */
    double fall;   /* its factor from round to round */
  } draw;

  /* A start that is nearly a map. */
  struct {
    int32_t few;      /* at most one flip in this many triangles: the start is nearly a map */
    int rings;        /* around the flips in which held vertices are released */
    int usable_rings; /* rings around the flips whose vertices do not serve as samples */
    int clearings;    /* rounds of clearing with the vertices released */
    int home_rounds;  /* most, of drawing released vertices back; the pull doubles from round to round */
    int home_sweeps;  /* of a round */
    double home_pull; /* in the first round */
  } near;

  /* The landmark walk. */
  struct {
    int32_t samples;        /* of the spatial targets that are walked to; more guide the walk, but make it get stuck */
    int32_t usable_samples; /* the same for the usable part of a start that was nearly a map */
    int32_t least_each;     /* vertices of the moving shape for each sample; a shape with fewer gets no samples */
    int32_t level;          /* least vertices of the coarse level, */
    int32_t level_each;     /* and for each pair */
    double off_surface;     /* a sample farther from the surface than this many mean distances is not used */
    double facing;          /* least cosine between the normals of a sample and of the surface there */
    double apart;           /* least distance of a sample from every pair; */
    double usable_apart;    /* less for usable samples, which are nearer to the truth */
  } walk;

  /* Mirror landmarks. Lengths are of the diagonal. */
  struct {
    int32_t few_samples;    /* in the first steps of a plane; cheap, to give up early */
    int first_steps, steps; /* of closest points: with few samples, and then with all */
    double symmetric;       /* mean distance of mirrored samples from the surface up to which a plane is a symmetry */
    double hopeless;        /* the same after the first steps: more gives the plane up */
    double settled;         /* a step that changes that distance by less is the last */
    double same;            /* cosine of two normals: more is the same plane */
    double alike;           /* least correlation of the landmarks' distances from two shapes' planes */
    double middle;          /* a landmark nearer to the plane is its own mirror image */
    double off_surface;     /* a mirror image farther from the surface is not used */
    double taken;           /* a landmark nearer than this to the image is already that landmark */
  } mirror;

  /* Samples by eigenfunctions. */
  struct {
    int32_t size;            /* vertices of the copies that vibrate */
    int32_t least_landmarks; /* with fewer, nothing tells whether a spectral map is right */
    double agrees; /* mean distance of landmarks from where the map takes them, up to which the map is used. True maps
                      of eight posed pairs had 0.01 to 0.11, other maps 0.08 and more; those of animals in the pairs of
                      docs/bench-truth.md had 0.11 and more */
  } spectral;

  /* Non-rigid registration in space. */
  struct {
    int32_t samples;                        /* of the best map that anchor a further registration */
    int rounds;                             /* of iterative closest points */
    int32_t first_controls, last_controls;  /* of the spline; interpolated geometrically. Solving is cubic in them */
    double first_stiffness, last_stiffness; /* likewise; less follows the surface more closely and folds more */
    double exact_stiffness;                 /* of landmarks, which hold: only keeps the system regular */
    double sample_stiffness;                /* of samples, which are only roughly right */
    int32_t least_anchors; /* that determine a similarity; with fewer, rigid registrations come first */
    int32_t rigid_samples; /* controls of a rigid registration */
    int rigid_steps;       /* of each of the 24 */
    int32_t rigid_search;  /* vertices of the fixed shape that it searches at most: it starts from axes and need only be
                              near */
    double rigid_cap;      /* of a squared distance, so that parts without a counterpart do not decide */
    int32_t fixed_search;  /* vertices of the fixed shape beyond which only every second, third, … is searched */
    double normal_weight;  /* of |n − n'|² against |x − x'|² */
    double facing;         /* least cosine of normals; a control with less is omitted from the round */
    double far;            /* mean distances beyond which a control is omitted */
    int32_t least_controls; /* that must be left, or the spline stays as it is */
    double slide;           /* most that a target slides from a vertex within its tangent plane */
  } registration;

  /* The place of each spatial target on the fixed shape. */
  struct {
    double facing;        /* least cosine between the normals at the nearest point. Below it, a start on spheres that
                             keep angles doubts the place; other starts let vertices compete by */
    double normal_weight; /* distance and this weight of |n − n'|² against |x − x'|² */
    int32_t search;       /* triangles beyond which only every second, third, … is searched for a vertex */
    double jitter;        /* of barycentric coordinates: vertices that share a point cannot be untangled */
    double given_jitter;  /* the same for targets that are given: few of them share a point */
  } place;

  /* Smoothing of places on the sphere. Chosen on the 20 pairs of posed people of the half `choose` of
     tests/bench/correspond.py. */
  struct {
    int rounds;             /* of weighing the targets */
    int sweeps;             /* of a round */
    double over;            /* over-relaxation of the sweeps */
    double reach;           /* a vertex follows its neighbours within this distance. Three times as much draws arms
                               towards their shoulders, which are larger on the sphere */
    double folded;          /* factor on the trust in the target of a vertex of a flipped triangle, in each round.
                               Smaller factors let whole limbs go, 1 leaves the pockets of faces folded */
    double apart;           /* a target farther than this from those of most neighbours is an outlier: a few edges */
    double outlier;         /* distance from its target at which a vertex counts a quarter */
    double least_cotangent; /* of an edge: obtuse triangles would push their neighbours away, */
    double most_cotangent;  /* and flat ones would hold them */
  } smooth;

  /* Twisted limbs: which parts are examined, and when one counts. */
  struct {
    double rotated;           /* radians against the rotation of the whole: vertices beyond are examined, and held ones
                                 among them are references of their own */
    double alike;             /* radians: two such references that differ by less count as one */
    double twisted;           /* radians between root and tip: limbs beyond are untwisted */
    double smallest, largest; /* limb, as a share of the surface */
    double largest_tube;      /* of a wound limb, with what lies beyond */
    int32_t band_vertices;    /* least of a ring, */
    int32_t bands;            /* and least rings of a limb: fewer do not show a twist */
    double step;              /* radians between two rings of a wound limb: more may be a rotation the other way */
    double unclear;           /* radians by which their sum may miss whole turns */
    double growth;            /* most rings that a part grows by, for 10,000 vertices; grows with their square root */
    double wider;             /* a ring this many times the narrowest is the root */
    int solve_steps;          /* most steps of conjugate gradients for the heights */
    double solve_settled;     /* residual, relative to the first, that ends them */
    double least_weight;      /* of an edge: cotangents are clamped to this and its inverse, so that heights have no
                                 extremum inside */
  } twist;

  /* Untwisting them. */
  struct {
    double early_energy; /* a rough map with more energy than this, */
    double early_kept;   /* and less than this share of the area halfway, is untwisted before it is drawn. Elsewhere
                            that did not help */
    int steps;           /* by which limbs are untwisted where one step folds them */
    int step_sweeps;     /* between these */
    int descents;        /* most, of sweeps and loosening */
    double gain;         /* of the energy, relative: a descent that gains less is the last */
    double kept_gain;    /* of the area halfway: less does not show in a morph */
  } untwist;

  /* Rims of filled holes that correspond (rims/). Chosen on the pairs of open shapes of tests/scenario/holes.test.mjs.
   */
  struct {
    double longer;       /* rims that correspond differ in length by this factor at most, relative to the diagonals; */
    double longer_alone; /* the same for shapes of one hole each */
    double apart;        /* how far such rims are apart at most, as a share of their length: the radius of a circle */
    double slowest;      /* least */
    double fastest;      /* and most that one rim advances where the other advances by 1, both of length 1 */
    double one;          /* vertices of both rims that are nearer than this share of all edges there are one point: a
                            shorter edge would be a needle */
    double stiffness[3]; /* of the springs: the next is tried where the last leaves rims too far apart to be pinned */
    double met_share;    /* springs have brought rims together where this share of the points */
    double met;          /* is this near to a rim, of the diagonal */
    double paid_times; /* most that is paid for rims that are pinned, as energy above 1: this multiple of what there */
    double paid_more;  /* was, and this much more. What fills the holes counts too, and hardly matters */
    double paid_less;  /* the same where only springs hold them */
    double worst;      /* energy of a map that is caught: whether rims meet under it says nothing */
    double rotation_cost; /* of a rotation by 180° in space, against the squared distance of two rims in their mean
                         radius: files usually have shapes upright, and circles fit under any rotation */
    double off_most;      /* rims farther apart than this, relative to the diagonal, get other starts: they show */
    double retry_times;   /* a map from another start, which brings rims together where the search has not, may have */
    double retry_more;    /* this multiple of the energy above 1, and this much more */
  } rims;
} orb_map_params;

/* The values for a preset. `fast` composes no map; if it composes a coarse copy, it uses the values of `default`. */
orb_map_params orb_map_params_of(orb_preset preset);
/* Vertices of the coarsest level of a map that `held` landmarks hold. */
int32_t orb_map_keep_until(const orb_map_params *params, int32_t held);
/* Vertices of a decimated copy of a large shape whose coarsest level has `keep_until`. */
int32_t orb_map_copy_size(const orb_map_params *params, int32_t keep_until);

#endif
