/* What an alignment takes and gives: landmarks, options, aligned shapes. align.h has the call. */
#ifndef ORBMORPH_ALIGNMENT_H
#define ORBMORPH_ALIGNMENT_H

#include "orbmorph/embed.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum orb_align_method { ORB_ALIGN_PIN = 0, ORB_ALIGN_RBF, ORB_ALIGN_ROTATE, ORB_ALIGN_AUTO } orb_align_method;

/* One landmark: a place on each shape, in their order. */
typedef struct orb_landmark {
  char name[ORB_NAME_MAX];
  const orb_place *at; /* shape_count places, on the meshes given to orb_align() */
  int32_t pass;        /* rbf: landmarks of pass 0, the major ones, meet first, then those of pass 1, … */
  double radius;       /* rbf: radius of its influence, as a chord of the unit sphere; 0: rbf_radius */
  double confidence;   /* of a found landmark, 0 to 1; 1 for a given one */
  double weight;       /* 0 or 1: its places meet exactly. Between: it is soft, and a spring of stiffness
                          weight / (1 − weight) pulls its places together. At 0.5 the places stay a distance d apart only
                          if that lowers the energy by d²; d is in radii of a ball with the shape's area. For pin and
                          auto */
} orb_landmark;

typedef struct orb_align_options {
  orb_align_method method; /* default: ORB_ALIGN_PIN */
  orb_preset preset;       /* fast: no composed map; default: ORB_PRESET_DEFAULT */
  int32_t rbf_steps;       /* steps of each pass; default: 10 */
  int32_t one_way;         /* rbf: move only the later shapes (Peng & Timalsena 2016, Fig. 9); default: 0 */
  double rbf_radius;       /* radius of landmarks that have none; 0: 1.0 */
  double max_growth; /* pin: how many triangles splits may add to a mesh, as a multiple of its own number (of 2000 if it
                        has fewer), and at most 800000. Landmarks that need more are refused. 0: 64 */
} orb_align_options;

typedef struct orb_align_shape {
  const orb_mesh *mesh;
  const double *points; /* its certified embedding, 3 per vertex */
} orb_align_shape;

/* A shape after alignment. Its mesh is the same surface, perhaps with more vertices (landmarks within triangles or on
 * edges, and split edges). Triangle t lies in triangle parent[t] of the given mesh. New vertices have mesh.source −1;
 * attributes of corners are interpolated. */
typedef struct orb_aligned_shape {
  orb_mesh mesh;
  int32_t *parent;
  double *points; /* certified on the aligned sphere */
  orb_certificate certificate;
  int32_t *landmark_vertices; /* landmark_count: the vertex of each landmark; −1 for a soft one */
} orb_aligned_shape;

enum { ORB_FOUND_MAX = 12, ORB_ALTERNATIVES_MAX = 4, ORB_ALTERNATIVE_PAIRS = 12 };

/* Another correspondence that the search without landmarks considered. It matches one later shape differently, and all
 * others as the best one does. To request it, give its places as landmarks. The search found these places, so they mark
 * the same features only roughly. Where one shape is matched as a part of the other one, the first alternative matches
 * the shapes as wholes. */
typedef struct orb_alternative {
  double cost;   /* what its rough map costs (docs/method.md), as a multiple of the best one: at least 1 */
  int32_t shape; /* the later shape that is matched differently */
  int32_t count; /* at most ORB_ALTERNATIVE_PAIRS */
  orb_place *at; /* count × shape_count places, on the given meshes */
} orb_alternative;

/* A match below this confidence is unsure. */
#define ORB_MATCH_LIKELY 0.5

/* What the search without landmarks knows of its best rough map; with several later shapes, each member holds the worst
 * value. If a rotation of the spheres already gives a good map, the alignment uses that rotation and not the rough
 * map. */
typedef struct orb_match_facts {
  int32_t is_measured; /* 0: landmarks were given, the preset is fast, or no rough map was found */
  int32_t is_part; /* 1: one of two shapes is a part of the other one, as a head is of a bust, and is laid onto it. What
                      follows, but for the confidence, is of the wholes */
  double bend;     /* of the best rough map: 0 for a rigid motion */
  double clear;    /* 0 to 1: how far the next best rough map that differs is behind; 0.5 if none differs */
  double lead; /* the geometric mean of two ratios of the nearest other rough map to the best one: of their bends, and
                  of their costs. About 1: the shapes do not decide which is right, for example because one looks alike
                  from several sides. At most 100 */
  double confidence; /* 0 to 1, with the mean energy, of copies if whole shapes follow them; calibrated on two shapes
                        (docs/bench-confidence.md) */
} orb_match_facts;

/* A given landmark that may be misplaced. When the optimiser releases it, it moves far from its given place. */
typedef struct orb_suspect {
  int32_t landmark, shape; /* shape: the later one of the pair with the first shape */
  double share;            /* of the pair's distortion: the part nearer to this landmark than to the others */
  orb_place at;            /* where it would lie, on the given mesh of `shape`, if its place on the first is right */
  double distance;         /* from its given place, relative to the shape's diagonal */
} orb_suspect;

enum { ORB_SUSPECTS_MAX = 4 };

/* Filled holes of the first shape and of a later one that correspond: their rims lie on each other. Holes have numbers
 * from 0, in the order of the lowest triangles that fill them. Index 0 is the first shape. */
typedef struct orb_rim_match {
  int32_t shape; /* the later one */
  int32_t hole[2];
  int32_t edges[2];          /* of the rims, in the files */
  double length_relative[2]; /* of the rims, to the diagonals */
  double off_relative; /* the most that a vertex of the first rim is away from the second one on the later shape, to its
                          diagonal; 0 up to rounding where all points of the rims meet */
} orb_rim_match;

typedef struct orb_alignment {
  int32_t shape_count, landmark_count;
  orb_aligned_shape *shapes;
  /* auto without landmarks: at most ORB_FOUND_MAX found landmarks, which show the correspondence; they are far from
   * each other on the first shape. A client can correct them and send them as landmarks. They are not vertices. */
  int32_t found_count;
  orb_place *found;     /* found_count × shape_count places, on the given meshes */
  double *found_points; /* found_count × 3: their common points on the aligned sphere */
  double *confidence; /* found_count, 0 to 1. 1: the map nearby is rigid, up to one scale for the whole shape; it falls
                         with the distortion of the map nearby, and falls for all found landmarks if another candidate
                         is nearly as good. It does not say whether the right parts were matched */
  double energy;      /* symmetric Dirichlet energy of the composed maps, capped for each triangle and weighted by area;
                         lower is better; NaN if not measured */
  orb_match_facts match;
  int32_t has_followed;      /* 1: of orb_align_again(), and follows its start */
  int32_t alternative_count; /* at most ORB_ALTERNATIVES_MAX, by rising cost */
  orb_alternative *alternatives;
  int32_t suspect_count; /* at most ORB_SUSPECTS_MAX, by falling distance */
  orb_suspect *suspects;
  /* landmark_count: the share of the distortion that lies around each given landmark, as of a suspect; with several
   * later shapes, the largest. NULL where no suspects are looked for: the map is good or was not
   * composed, one shape is a part of the other, or landmarks are fewer than 4 */
  double *landmark_shares;
  int32_t rim_count;
  orb_rim_match *rims; /* by rising number of the shape */
} orb_alignment;

/* Frees the arrays and zeroes the struct. */
ORB_API void orb_alignment_free(orb_context *ctx, orb_alignment *alignment);

#ifdef __cplusplus
}
#endif
#endif
