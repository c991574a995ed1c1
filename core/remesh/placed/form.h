/* The form of net triangles in space: how well they are shaped, and whether they are inverted on some shape. */
#ifndef ORB_REMESH_PLACED_FORM_H
#define ORB_REMESH_PLACED_FORM_H

#include "remesh/placed/placed_net.h"

/* The worst over all shapes of one triangle or several. */
typedef struct orb_form {
  double quality; /* the least: 0 degenerate to 1 equilateral */
  double facing;  /* the least cosine-like measure against the shape's smooth normals at the corners; < 0 inverted */
  int32_t slivers, inverted; /* how many triangles fall below the thresholds of quality and facing, see form.c */
} orb_form;
static const orb_form ORB_FORM_BEST = {1, 1, 0, 0};
orb_form orb_placed_form(const orb_placed_net *placed, int32_t a, int32_t b, int32_t c);

/* The same shape by shape: the least square of the quality and of the facing (with its sign) so far; start with 1. */
typedef struct orb_form_squares {
  double quality, facing;
} orb_form_squares;
void orb_placed_form_on(const orb_placed_net *placed, int32_t s, int32_t a, int32_t b, int32_t c,
                        orb_form_squares *least);
orb_form orb_form_of(orb_form_squares least);

/* Two sets of triangles together. */
static inline orb_form orb_form_join(orb_form f, orb_form g) {
  return (orb_form){f.quality < g.quality ? f.quality : g.quality, f.facing < g.facing ? f.facing : g.facing,
                    f.slivers + g.slivers, f.inverted + g.inverted};
}
/* Whether triangles of form `after` may replace triangles of form `before`: no more of them are inverted, and either
 * fewer are slivers or the worst quality does not fall, unless it stays acceptable. */
int orb_form_allows(orb_form before, orb_form after);
/* Whether triangles of this form may replace any others: none is inverted and every quality is acceptable. */
int orb_form_is_fine(orb_form after);
/* The cost of a triangle's form. The weights rank the three: a sliver costs as much as the quality of eight degenerate
 * triangles, an inverted triangle as much as eight slivers. */
static inline double orb_form_cost(orb_form f) {
  return (1 - f.quality) * (1 - f.quality) + 8 * f.slivers + 64 * f.inverted;
}

/* Whether the triangle is inverted, or nearly so, on some shape: against the normals at its corners, or against the
 * shape's smooth or flat normal at its centre on the sphere. The centre is located only where the corners leave doubt,
 * because location is expensive. */
int orb_placed_is_inverted(const orb_placed_net *placed, int32_t a, int32_t b, int32_t c);
/* The sum of its squared edge lengths over the shapes on which it is inverted; 0: on none. */
double orb_placed_inverted_extent(const orb_placed_net *placed, int32_t a, int32_t b, int32_t c);
/* The same judged by the corners only: a lower bound, and cheap. */
double orb_placed_inverted_by_corners(const orb_placed_net *placed, int32_t a, int32_t b, int32_t c);

/* The inverted triangles of a set: how many, and the sum of their extents. */
typedef struct orb_tally {
  int inverted;
  double extent;
} orb_tally;
static inline void orb_tally_add(orb_tally *sum, double extent) {
  sum->inverted += extent > 0;
  sum->extent += extent;
}
/* Whether `now` is worse than `before`: more inverted triangles, or larger ones. The factor keeps equal sums that were
 * added up in another order from counting as worse. */
static inline int orb_tally_is_worse(orb_tally now, orb_tally before) {
  return now.inverted > before.inverted || (now.inverted > 0 && now.extent > before.extent * (1 + 1e-9));
}
/* Over the triangles of v and two successive vertices of the ring; `closed`: also of the last and the first one. */
orb_tally orb_placed_tally_fan(const orb_placed_net *placed, int32_t v, const int32_t *ring, int n, int closed);

/* How many triangles are inverted. Parallel. Remembers those that are not. */
int64_t orb_placed_count_inverted(orb_context *ctx, orb_placed_net *placed);
/* Sets inverted[t] to 1 or 0 for every triangle, 0 for dead ones. Also parallel, and remembers. */
void orb_placed_mark_inverted(orb_context *ctx, orb_placed_net *placed, unsigned char *inverted);

#endif
