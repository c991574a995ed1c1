/* What landmarks say of a match before it is made: whether the two shapes are one body in two poses, and whether a
 * rough map takes the landmarks to their partners. */
#ifndef ORB_ALIGN_FIND_HINT_H
#define ORB_ALIGN_FIND_HINT_H

#include "align/sheet/copy.h"
#include "elastic/pose.h"

/* Vertices of the two given meshes that correspond. */
typedef struct orb_match_hint {
  int32_t count, few; /* the first `few` of them exclude maps; all of them draw the best map to their partners */
  int32_t trusted;    /* the first of them that may make a map: no soft ones, if there are enough others */
  const int32_t *first, *second;
  double stretch; /* orb_hint_stretch() above which no match is looked for */
  double sure;    /* orb_hint_stretch() up to which a match is taken; between the two, its bend decides */
  int seeks_part; /* whether one of two shapes is a part of the other one is looked for too */
  int asks_limbs; /* whether landmarks that exclude one body leave limbs open is asked */
} orb_match_hint;

/* The hint on scaled coarse copies of the shapes. */
typedef struct orb_hint_places {
  int32_t count, few, trusted;
  int tells; /* 1: their distances tell whether the shapes are one body. Otherwise they only exclude and draw maps. The
                caller's to set */
  int32_t *vertex[2]; /* the nearest vertex of the copy */
  double *at[2];      /* the landmark, in the copy's space */
} orb_hint_places;

/* Finds the places. at[2]: where the landmarks lie in the copies' spaces, 3 each; `out` takes ownership of both, also
 * on failure. few, trusted: as in orb_match_hint. Free `out` in any case. O(count · n). */
ORB_MUST_CHECK orb_status orb_hint_places_create(orb_context *ctx, int32_t count, int32_t few, int32_t trusted,
                                                 double *at[2], const orb_coarse_copy copy[2], orb_hint_places *out);
void orb_hint_places_free(orb_context *ctx, orb_hint_places *places);

/* The landmarks as anchors of a copy of shape s, of any size, on the other one. The caller frees them. O(count · n). */
ORB_MUST_CHECK orb_status orb_hint_anchors_create(orb_context *ctx, const orb_hint_places *places, const orb_mesh *copy,
                                                  int s, orb_elastic_anchor **out);

/* Distances along copy s from each of the first `sources` landmarks to all vertices: sources × vertices of `mesh`,
 * which is that of the copy. O(sources · n log n). */
ORB_MUST_CHECK orb_status orb_hint_distances(orb_context *ctx, const orb_hint_places *places, const orb_mesh *mesh,
                                             int s, int32_t sources, double *out);

/* The mean of |ln(d/d')| over pairs of landmarks that are far apart, where d and d' are their distances along the two
 * surfaces, of equal areas: 0 for one body in two poses. INFINITY if no two are far apart. O(n log n). */
ORB_MUST_CHECK orb_status orb_hint_stretch(orb_context *ctx, const orb_hint_places *places,
                                           const orb_coarse_copy copy[2], double *stretch);

/* The mean distance at which the landmarks of copy s end from their partners, if `pose` has the copy's vertices in the
 * space of the other one (3 each). */
double orb_hint_off(const orb_hint_places *places, const orb_coarse_copy *copy, int s, const double *pose);

#endif
