/* A match: a net with its places on every shape, and the proved distance between the net's surfaces and the shapes.
 *
 * The bound. Overlay the net with shape s on the sphere (in thought). Send each vertex of the overlay to a point of the
 * shape and to a point of the net's surface: a vertex of the shape to itself and to the nearest point of the net
 * triangle that holds it; a net vertex to its place and itself; a crossing of a net edge with an edge of the shape to
 * the two nearest points of these two segments. Each cell of the overlay lies in one triangle of the shape and in one
 * of the net, so its linear extension stays in both (they are convex); both maps are continuous and of degree 1, so
 * they cover both surfaces; and the distance of matched points is greatest at vertices. The greatest of the matched
 * distances therefore bounds the Hausdorff (even the Fréchet) distance, both ways. Only the combinatorics of the
 * overlay enter, and those are decided exactly. Nothing has to be stored but which vertices lie in which triangle. */
#ifndef ORB_REMESH_ADAPTIVE_MATCH_H
#define ORB_REMESH_ADAPTIVE_MATCH_H

#include <string.h>

#include "orbmorph/remesh.h"
#include "remesh/methods.h"
#include "sphere/trace.h"

typedef struct orb_match {
  const orb_remesh_job *job;
  orb_net net;
  int32_t shape_count, capacity; /* capacity in net vertices of the arrays below */
  orb_sphere_view *view;         /* a shape */
  double **position;             /* a shape: its vertices, divided by its diagonal */
  double **vertex_normal;        /* a shape: smooth unit normals of its vertices */
  double *at;                    /* net vertex major: 3 for each shape, its positions, likewise scaled */
  double *normal;                /* net vertex major: 3 for each shape, its smooth normals there, unit */
  orb_spot *spot;                /* net vertex major: one for each shape */
  unsigned char *fixed;          /* a net vertex: a landmark, not to be removed */
  uint64_t *stayed;              /* a net vertex: mark of the star in which no move was found, 0: none */
  uint64_t *alone;               /* a net vertex: mark of its surroundings in which it found none to merge with */
  uint64_t *stuck;               /* a net vertex: mark of its surroundings in which it could not be taken away */
  uint64_t *hopeless;            /* a triangle, two: marks of its surroundings in which it could not be mended */
  uint64_t *straight;            /* a triangle: mark of its corners where it was found not to be turned in space */
  uint64_t *within;              /* a half-edge: mark of the edge that was proved to stay within the limit */
  /* Items: the vertices of all shapes, shape after shape. Each is in the list of a net vertex or of a triangle. */
  int32_t *item_begin; /* shape_count + 1 */
  int32_t *item_next;
  int32_t *item_shape;
  int32_t *vertex_items, *triangle_items; /* heads, −1: none */
  int crept;                              /* refinement was given up: see orb_match_refine() */
} orb_match;

/* Starts from the shape with the most triangles and makes every other shape's vertices vertices too. */
ORB_MUST_CHECK orb_status orb_match_create(orb_context *ctx, const orb_remesh_job *job, orb_match *match);
/* Starts from a given certified triangulation. */
ORB_MUST_CHECK orb_status orb_match_create_on(orb_context *ctx, const orb_remesh_job *job, const orb_net *net,
                                              orb_match *match);
void orb_match_free(orb_context *ctx, orb_match *match);

/* About how many triangles the overlay of all shapes has, by a sample of their edges; parallel. */
ORB_MUST_CHECK orb_status orb_match_overlay_size(orb_context *ctx, const orb_remesh_job *job, int64_t *triangles);
/* Starts anew from the overlay, which is exact. If there is none the match (may be zeroed) stays as it is. */
ORB_MUST_CHECK orb_status orb_match_start_from_overlay(orb_context *ctx, const orb_remesh_job *job, orb_match *match);
/* The same from the overlay of the shapes reduced one by one within the limit (relative, squared): far smaller where
 * the shapes are wound about each other. Edges and items may stray a little. */
ORB_MUST_CHECK orb_status orb_match_start_from_reduced(orb_context *ctx, const orb_remesh_job *job, double limit2,
                                                       orb_match *match);

static inline const double *orb_match_at(const orb_match *match, int32_t v, int32_t s) {
  return match->at + 3 * ((int64_t)v * match->shape_count + s);
}

static inline const double *orb_match_normal(const orb_match *match, int32_t v, int32_t s) {
  return match->normal + 3 * ((int64_t)v * match->shape_count + s);
}

/* Position of an item on the sphere and, scaled, in space. */
const double *orb_match_item_point(const orb_match *match, int32_t item);
const double *orb_match_item_position(const orb_match *match, int32_t item);

/* Where an edge strays most from a shape. */
typedef struct orb_stray {
  double distance2; /* relative to the diagonal, squared */
  int32_t shape, h; /* the crossing: half-edge or vertex of the shape */
  int at_vertex;
} orb_stray;

/* The greatest matched distance along the net edge v w, over all shapes; stops early once beyond limit2. worst may be
 * NULL. */
double orb_match_edge2(const orb_match *match, int32_t v, int32_t w, double limit2, orb_stray *worst);
double orb_match_edge_of_shape2(const orb_match *match, int32_t s, int32_t v, int32_t w, double limit2,
                                orb_stray *worst);

/* The direction in which the net edge v w meets the crossing's edge (or vertex) of the shape. */
void orb_match_crossing_point(const orb_match *match, int32_t v, int32_t w, const orb_stray *stray, double out[3]);

/* Squared distance of an item to the net triangle a b c. */
double orb_match_item2(const orb_match *match, int32_t item, int32_t a, int32_t b, int32_t c);

/* The proved bound for each shape, in its units: over all edges and items; parallel. */
ORB_MUST_CHECK orb_status orb_match_bounds(orb_context *ctx, const orb_match *match, double *bound);

/* Makes room for more net vertices. */
ORB_MUST_CHECK orb_status orb_match_reserve(orb_context *ctx, orb_match *match, int64_t more);

/* Splits net edge h at p if all four triangles stay positive; the new vertex, or −1. Needs room for one. Items of the
 * two triangles are handed on. */
int32_t orb_match_split(orb_match *match, int32_t h, const double p[3]);

/* Makes p, which lies in triangle t, a vertex (or finds the one there): the vertex. Needs room for one. */
int32_t orb_match_insert(orb_match *match, int32_t t, const double p[3]);

/* Puts the items of a list into the triangles that hold them, by walks from triangle `start`. */
void orb_match_deal(orb_match *match, int32_t list, int32_t start);
/* The same among a few triangles that are known to hold them all. Touches these only: others may change meanwhile. */
void orb_match_deal_among(orb_match *match, int32_t list, const int32_t *triangles, int count);

/* Splits, or turns, every edge that strays farther than the tolerance (relative, squared), and takes items that do in
 * as vertices, until none does; *strays (may be NULL) counts the edges that had to be looked at. Where the map flattens
 * a large triangle of a shape to almost nothing on the sphere, splits can creep along it without end: after far more
 * splits than the overlay of all shapes would need, `crept` is set and the rest left straying. */
ORB_MUST_CHECK orb_status orb_match_refine(orb_context *ctx, orb_match *match, double limit2, int64_t *strays);

/* Turns an edge if that keeps the bound and helps the shape of the triangles; whether it did. */
int orb_match_try_turn(orb_match *match, int32_t h, double limit2);
/* All edges in turn, or those at triangles that are turned in space or slivers. */
ORB_MUST_CHECK orb_status orb_match_turn_all(orb_context *ctx, orb_match *match, double limit2, int only_bad);

/* How triangles lie in space, the worst over all shapes. */
typedef struct orb_form {
  double quality; /* the least: 0 degenerate to 1 equilateral */
  double facing;  /* the least, cosine-like, against the shape's smooth normals at the corners; below 0 inverted */
  int32_t slivers, turned; /* how many triangles are not fine in one or the other */
} orb_form;
static const orb_form ORB_FORM_BEST = {1, 1, 0, 0};
orb_form orb_match_form(const orb_match *match, int32_t a, int32_t b, int32_t c);
/* The same shape by shape: the squares of the least quality and (with its sign) facing so far, 1 to begin with. */
typedef struct orb_form_squares {
  double quality, facing;
} orb_form_squares;
void orb_match_form_on(const orb_match *match, int32_t s, int32_t a, int32_t b, int32_t c, orb_form_squares *least);
orb_form orb_form_of(orb_form_squares least);
/* Of two sets of triangles together. */
static inline orb_form orb_form_join(orb_form f, orb_form g) {
  return (orb_form){f.quality < g.quality ? f.quality : g.quality, f.facing < g.facing ? f.facing : g.facing,
                    f.slivers + g.slivers, f.turned + g.turned};
}
/* Whether triangles such as `after` may replace some such as `before`: fewer are turned, or none worse than before and
 * the same holds of slivers; measures that are fine count as equal. */
int orb_form_allows(orb_form before, orb_form after);
/* Whether triangles of this form may replace any: none is turned, none is worse than the least that is let be. */
int orb_form_is_fine(orb_form after);
/* A triangle's form as a cost: turned counts most, then slivers, then shape. */
static inline double orb_form_cost(orb_form f) {
  return (1 - f.quality) * (1 - f.quality) + 8 * f.slivers + 64 * f.turned;
}

/* Whether the triangle is turned in space, or nearly so, on any shape: against the normals at its corners, or against
 * those at its centre on the sphere, smooth or flat. The second is dear; the first is asked first. */
int orb_match_is_turned(const orb_match *match, int32_t a, int32_t b, int32_t c);
/* The summed squares of its edges over the shapes on which it is; 0: none. */
double orb_match_turned_extent(const orb_match *match, int32_t a, int32_t b, int32_t c);
/* The same by the corners only: a lower bound, and cheap. */
double orb_match_turned_by_corners(const orb_match *match, int32_t a, int32_t b, int32_t c);
/* The turned triangles of a set: how many, and their extents together. */
typedef struct orb_tally {
  int turned;
  double extent;
} orb_tally;
static inline void orb_tally_add(orb_tally *sum, double extent) {
  sum->turned += extent > 0;
  sum->extent += extent;
}
/* Whether triangles that tally so are worse than some that tallied as `before`. */
static inline int orb_tally_is_worse(orb_tally now, orb_tally before) {
  return now.turned > before.turned || (now.turned > 0 && now.extent > before.extent * (1 + 1e-9));
}
/* Of v and two successive ones of the n others; `closed`: of the last and the first, too. */
orb_tally orb_match_tally_fan(const orb_match *match, int32_t v, const int32_t *ring, int n, int closed);

/* Folds words into a mark of them all. */
static inline uint64_t orb_mixed(uint64_t mark, const void *part, size_t size) {
  uint64_t word;
  for (const unsigned char *p = part, *end = p + size; p < end; p += sizeof word) {
    memcpy(&word, p, sizeof word);
    mark = (mark ^ word) * UINT64_C(0x9E3779B97F4A7C15);
    mark ^= mark >> 29;
  }
  return mark;
}

/* A mark of a vertex's neighbours and theirs, where they are, as a sum with no order. */
uint64_t orb_match_surroundings(const orb_match *match, int32_t v);

/* A mark of a point. */
static inline uint64_t orb_point_mark(const double p[3]) {
  uint64_t word[3];
  memcpy(word, p, sizeof word);
  uint64_t mark = word[0] * UINT64_C(0x9E3779B97F4A7C15) + word[1] * UINT64_C(0xC2B2AE3D27D4EB4F) +
                  word[2] * UINT64_C(0x165667B19E3779F9);
  mark = (mark ^ mark >> 32) * UINT64_C(0xD6E8FEB86659FD93);
  return mark ^ mark >> 29;
}

/* Moves v on the sphere if that makes the triangles around it better, or its edges stray less, within the limit;
 * whether it did. Then all vertices in turn, or those that `which` (may be NULL) says. */
int orb_match_try_move(orb_match *match, int32_t v, double limit2);
ORB_MUST_CHECK orb_status orb_match_move_all(orb_context *ctx, orb_match *match, double limit2,
                                             const unsigned char *which);
/* Mends triangles that are turned in space, within the limit, as far as it can: see orb_match_turned(). */
ORB_MUST_CHECK orb_status orb_match_mend(orb_context *ctx, orb_match *match, double limit2);
/* How many triangles are turned in space; parallel. Remembers those that are not. */
int64_t orb_match_turned(orb_context *ctx, orb_match *match);
/* Which ones: 1 or 0 for each, live or not; likewise. */
void orb_match_mark_turned(orb_context *ctx, orb_match *match, unsigned char *turned);
/* Refines them and those around them as far as the overlay of the shapes; edges outside may stray. */
ORB_MUST_CHECK orb_status orb_match_resolve(orb_context *ctx, orb_match *match, double limit2);
/* Puts vertex v at p: point, spots, positions and normals; triangles and items are the caller's care. */
void orb_match_place(orb_match *match, int32_t v, const double p[3]);
/* The same for one shape of a vertex whose point is set. */
void orb_match_place_on(orb_match *match, int32_t v, int32_t s);

/* Copies what is known of a vertex, its point and places, over that of another (or of the one after the last). */
void orb_match_copy_vertex(orb_match *match, int32_t to, int32_t from);

/* What a star is to do about triangles that are turned in space: leave no more of them, leave fewer, or leave no more
 * and much smaller ones. */
typedef enum orb_star_goal { ORB_STAR_NOT_WORSE, ORB_STAR_FEWER, ORB_STAR_SMALLER } orb_star_goal;
typedef struct orb_star_wish {
  double limit2;               /* relative, squared */
  int least_inner, most_inner; /* vertices inside the disc: the count of triangles changes by two less twice that */
  orb_star_goal goal;
} orb_star_wish;
/* Replaces the given triangles, a disc that holds the points, and those beyond its edges as far as it takes, by
 * triangles from the first of the points for which that stays within the limit and meets the goal. Whether there is
 * one. Needs room for one vertex. */
int orb_match_star(orb_match *match, const int32_t *triangles, int count, const double (*points)[3], int point_count,
                   const orb_star_wish *wish);
/* Whether it would. Any thread; needs room for as many vertices as there are threads. */
int orb_match_can_star(orb_match *match, const int32_t *triangles, int count, const double (*points)[3],
                       int point_count, const orb_star_wish *wish, int thread);

/* Merges neighbours to one vertex wherever the limit lets it, while more than `target` triangles live. */
ORB_MUST_CHECK orb_status orb_match_merge_all(orb_context *ctx, orb_match *match, double limit2, int64_t target);

/* Plans to take u away and to triangulate its hole anew, within the limit (relative, squared): ring are its n
 * neighbours counter-clockwise, triangles n − 2 triples of numbers in the ring. strict as below. 0: there is no way. */
int orb_match_plan_fill(const orb_match *match, int32_t u, const int32_t *ring, int n, double limit2, int strict,
                        int (*triangles)[3]);
/* Does it, and touches nothing beyond the ring. */
void orb_match_fill(orb_match *match, int32_t u, const int32_t *ring, int n, int (*triangles)[3]);

/* Collapses edges while every matched distance stays within the limit (relative, squared) and more than
 * `target` triangles live. strict: also keep triangles from turning over and from becoming slivers in space.
 * thorough: where no edge can be collapsed, try all ways to fill the hole that the vertex leaves. */
ORB_MUST_CHECK orb_status orb_match_collapse(orb_context *ctx, orb_match *match, double limit2, int64_t target,
                                             int strict, int thorough);
int64_t orb_match_live(const orb_match *match);
/* Closes the gaps that dead vertices and triangles have left: the live ones get new numbers, in the same order. */
ORB_MUST_CHECK orb_status orb_match_compact(orb_context *ctx, orb_match *match);

/* Places, points, triangles and bounds of the live net. */
ORB_MUST_CHECK orb_status orb_match_export(orb_context *ctx, const orb_match *match, orb_supermesh *out);

#endif
