#include "remesh/placed/flip.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "base/parallel.h"
#include "numeric/predicates.h"
#include "remesh/placed/bound.h"
#include "remesh/placed/form.h"

/* Passes end after PASSES, or once a pass makes fewer than one flip per FEWEST triangles: more passes cost time and
 * gain little. */
enum { PASSES = 6, FEWEST = 200 };
enum { CHECK_EVERY = 4096 };           /* half-edges between two checks for cancellation */
static const double LEAST_GAIN = 1.05; /* factor of the quality: smaller ones flip more edges for less */

/* The greatest squared distance of the listed items to the triangle (c,d,b) or (d,c,a) that holds them. */
static double list_after_flip2(const orb_placed_net *placed, int32_t list, int32_t c, int32_t d, int32_t b, int32_t a) {
  double greatest = 0;
  for (int32_t i = list; i >= 0; i = placed->item_next[i]) {
    int left = orb_orient(orb_net_point(&placed->net, c), orb_net_point(&placed->net, d),
                          orb_placed_item_point(placed, i)) >= 0;
    double distance2 = left ? orb_placed_item2(placed, i, c, d, b) : orb_placed_item2(placed, i, d, c, a);
    greatest = distance2 > greatest ? distance2 : greatest;
  }
  return greatest;
}

double orb_placed_flip_items2(const orb_placed_net *placed, int32_t h) {
  const orb_net *net = &placed->net;
  int32_t g = net->twin[h], a = net->triangles[h], b = net->triangles[g];
  int32_t c = net->triangles[orb_prev(h)], d = net->triangles[orb_prev(g)];
  double one = list_after_flip2(placed, placed->triangle_items[h / 3], c, d, b, a);
  double other = list_after_flip2(placed, placed->triangle_items[g / 3], c, d, b, a);
  return other > one ? other : one;
}

void orb_placed_flip(orb_placed_net *placed, int32_t h) {
  int32_t t = h / 3, g = placed->net.twin[h] / 3;
  int32_t lists[2] = {placed->triangle_items[t], placed->triangle_items[g]};
  placed->triangle_items[t] = placed->triangle_items[g] = -1;
  orb_net_flip(&placed->net, h);
  orb_placed_assign(placed, lists[0], t);
  orb_placed_assign(placed, lists[1], t);
}

/* Whether replacing edge a b by c d makes more or larger triangles inverted. */
static int flip_inverts(const orb_placed_net *placed, int32_t a, int32_t b, int32_t c, int32_t d) {
  orb_tally before = {0, 0}, after = {0, 0};
  orb_tally_add(&after, orb_placed_inverted_extent(placed, c, d, b));
  orb_tally_add(&after, orb_placed_inverted_extent(placed, d, c, a));
  if (after.inverted == 0) {
    return 0;
  }
  orb_tally_add(&before, orb_placed_inverted_extent(placed, a, b, c));
  orb_tally_add(&before, orb_placed_inverted_extent(placed, b, a, d));
  return orb_tally_is_worse(after, before);
}

/* Whether flipping edge h would improve the form of its two triangles, which is `before`; nothing else is tested. */
static int flip_is_better(const orb_placed_net *placed, int32_t h, orb_form before) {
  const orb_net *net = &placed->net;
  int32_t g = net->twin[h], a = net->triangles[h], b = net->triangles[g];
  int32_t c = net->triangles[orb_prev(h)], d = net->triangles[orb_prev(g)];
  orb_form after = orb_placed_form(placed, c, d, b);
  double wanted = before.quality * LEAST_GAIN + 1e-9; /* the summand rules out flips between degenerate triangles */
  if (after.quality <= wanted && (before.facing > 0 || after.facing <= 0)) {
    return 0;
  }
  after = orb_form_join(after, orb_placed_form(placed, d, c, a));
  return (after.quality > wanted || (before.facing <= 0 && after.facing > 0)) && orb_form_allows(before, after);
}

static orb_form form_of(const orb_placed_net *placed, int32_t t) {
  const int32_t *c = placed->net.triangles + 3 * (int64_t)t;
  return c[0] >= 0 ? orb_placed_form(placed, c[0], c[1], c[2]) : ORB_FORM_BEST;
}

/* Whether the net, the inverted triangles and the limit allow the flip. */
static int can_flip(const orb_placed_net *placed, int32_t h, double limit2) {
  const orb_net *net = &placed->net;
  int32_t g = net->twin[h];
  int32_t a = net->triangles[h], b = net->triangles[g];
  int32_t c = net->triangles[orb_prev(h)], d = net->triangles[orb_prev(g)];
  int is_free = limit2 == INFINITY;
  return orb_net_can_flip(net, h) && (is_free || orb_placed_edge_is_within(placed, c, d, limit2)) &&
         !flip_inverts(placed, a, b, c, d) && (is_free || orb_placed_flip_items2(placed, h) <= limit2);
}

int orb_placed_try_flip(orb_placed_net *placed, int32_t h, double limit2) {
  orb_form before = orb_form_join(form_of(placed, h / 3), form_of(placed, placed->net.twin[h] / 3));
  int can = flip_is_better(placed, h, before) && can_flip(placed, h, limit2);
  if (can) {
    orb_placed_flip(placed, h);
  }
  return can;
}

typedef struct flip_loop {
  const orb_placed_net *placed;
  double limit2;
  int only_bad;
  orb_form *form;     /* per triangle */
  unsigned char *may; /* per half-edge: it should be flipped, as last examined; 0 for the second half-edge of an edge */
  unsigned char *stale;   /* per triangle: what is known of its edges is out of date */
  unsigned char *changed; /* per triangle: in this pass */
} flip_loop;

static void form_range(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  flip_loop *loop = arg;
  for (int64_t t = begin; t < end; t++) {
    if (loop->stale[t]) {
      loop->form[t] = form_of(loop->placed, (int32_t)t);
    }
  }
}

/* Whether a flip of edge h would improve its triangles and is allowed. */
static int should_flip(const flip_loop *loop, int32_t h) {
  orb_form before = orb_form_join(loop->form[h / 3], loop->form[loop->placed->net.twin[h] / 3]);
  return (!loop->only_bad || before.inverted || before.slivers) && flip_is_better(loop->placed, h, before) &&
         can_flip(loop->placed, h, loop->limit2);
}

static void may_flip_range(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  flip_loop *loop = arg;
  const orb_net *net = &loop->placed->net;
  for (int64_t h = begin; h < end; h++) {
    if (net->triangles[h - h % 3] < 0 || h > net->twin[h]) {
      loop->may[h] = 0;
    } else if (loop->stale[h / 3] || loop->stale[net->twin[h] / 3]) {
      loop->may[h] = (unsigned char)should_flip(loop, (int32_t)h);
    }
  }
}

/* Whether edge h may be flipped now. If one of its triangles has changed in this pass, the edge waits for the next one.
 * An earlier flip may have made the new edge elsewhere, so that is tested again. */
static int may_flip_now(const flip_loop *loop, int32_t h) {
  const orb_net *net = &loop->placed->net;
  return loop->may[h] && !loop->changed[h / 3] && !loop->changed[net->twin[h] / 3] &&
         !orb_net_adjacent(net, net->triangles[orb_prev(h)], net->triangles[orb_prev(net->twin[h])]);
}

/* Examines all edges in parallel, then flips one after another. */
static orb_status flip_pass(orb_context *ctx, orb_placed_net *placed, flip_loop *loop, int64_t *flipped) {
  const orb_net *net = &placed->net;
  int32_t half_edges = 3 * net->triangle_count;
  *flipped = 0;
  memset(loop->changed, 0, (size_t)net->triangle_count);
  orb_parallel_for(ctx, net->triangle_count, 512, form_range, loop);
  orb_parallel_for(ctx, half_edges, 1024, may_flip_range, loop);
  ORB_TRY(orb_context_check(ctx));
  for (int32_t h = 0; h < half_edges; h++) {
    if (may_flip_now(loop, h)) {
      orb_placed_flip(placed, h);
      loop->changed[h / 3] = loop->changed[net->twin[h] / 3] = 1;
      ++*flipped;
    }
    if (h % CHECK_EVERY == 0) {
      ORB_TRY(orb_context_check(ctx));
    }
  }
  unsigned char *stale = loop->stale;
  loop->stale = loop->changed;
  loop->changed = stale;
  return ORB_OK;
}

orb_status orb_placed_flip_all(orb_context *ctx, orb_placed_net *placed, double limit2, int only_bad) {
  int64_t triangles = placed->net.triangle_count, flipped = triangles;
  flip_loop loop = {.placed = placed, .limit2 = limit2, .only_bad = only_bad};
  loop.form = ORB_NEW(ctx, orb_form, triangles);
  loop.may = ORB_NEW(ctx, unsigned char, 3 * triangles);
  loop.stale = ORB_NEW(ctx, unsigned char, triangles);
  loop.changed = ORB_NEW(ctx, unsigned char, triangles);
  orb_status status = loop.form && loop.may && loop.stale && loop.changed ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    memset(loop.stale, 1, (size_t)triangles);
  }
  for (int pass = 0; pass < PASSES && flipped * FEWEST >= triangles && status == ORB_OK; pass++) {
    status = flip_pass(ctx, placed, &loop, &flipped);
  }
  orb_free(ctx, loop.form);
  orb_free(ctx, loop.may);
  orb_free(ctx, loop.stale);
  orb_free(ctx, loop.changed);
  return status;
}
