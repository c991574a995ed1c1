/* Nearest point of a triangle set.
 *
 * Triangles are put into an order whose runs are compact: halved again and again, by the median of their centres along
 * the longest axis. Eight neighbours in this order form a leaf, eight leaves a node, and so on; every node but the last
 * of a level has eight children. A node keeps their boxes as floats, which a query tests together.
 *
 * Boxes only decide which triangles are tested. They are rounded outwards, so that rounding never drops the nearest
 * triangle; distances to triangles are computed as doubles, from the caller's corners. Box coordinates are relative to
 * the surface's extent: 0 to 1.
 */
#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "mesh/nearest.h"
#include "numeric/clones.h"
#include "numeric/vec3.h"
#include "orbmorph/mesh.h"

enum {
  WIDE = 8,          /* children of a node: a vector of floats on AVX2 */
  LEVELS = 11,       /* 8¹¹ > 2³¹ triangles */
  STACK = 8 * LEVELS /* a level leaves at most seven nodes on the stack */
};
/* Bins of the histogram that finds a median: more need fewer rounds over many triangles, but more time for few. */
enum { BINS = 64 };
/* In units of the extent. A float near 1 is rounded by 3e-8; boxes are widened by four times that, and a query's
 * coordinates, which may be far from 1, are shifted by four times theirs. */
static const double BOX_MARGIN = 1.2e-7, QUERY_MARGIN = 2.4e-7;
/* Relative: more than the rounding of three squares, their sum, and the limit that they are compared with. */
static const double LIMIT_MARGIN = 2e-6;
/* Extents. Coordinates farther out are clamped, which only brings a query nearer to a box, and squares stay finite. */
static const double FAR = 1e15;
static const float NO_LIMIT = 1e32f;

typedef struct node {
  float low[3][WIDE], high[3][WIDE]; /* of the children */
  int32_t first, count;              /* children: entries for a leaf, else nodes */
} node;

struct orb_nearest {
  node *nodes;     /* level by level, leaves first, the root last */
  double *corners; /* 9 per entry */
  int32_t *triangle;
  int32_t node_count, leaf_count, triangle_count;
  double origin[3], scale; /* box coordinates: (x − origin) · scale */
};

/* A triangle to be put into order. */
typedef struct item {
  uint32_t centre[3]; /* 0 to 2³¹ over the extent */
  int32_t triangle;
} item;

static double clamped(double x) {
  return !(x > -FAR) ? -FAR : x < FAR ? x : FAR; /* NaN too becomes −FAR */
}

static void find_extent(orb_nearest *tree, const double *positions, const int32_t *triangles) {
  double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY}, extent = 0;
  for (int64_t i = 0; i < 3 * (int64_t)tree->triangle_count; i++) {
    const double *p = positions + 3 * (int64_t)triangles[i];
    for (int k = 0; k < 3; k++) {
      low[k] = p[k] < low[k] ? p[k] : low[k];
      high[k] = p[k] > high[k] ? p[k] : high[k];
    }
  }
  for (int k = 0; k < 3; k++) {
    extent = high[k] - low[k] > extent ? high[k] - low[k] : extent;
    tree->origin[k] = isfinite(low[k]) ? low[k] : 0;
  }
  tree->scale = extent > 0 && isfinite(1 / extent) ? 1 / extent : 0; /* 0: every box holds everything */
}

static item item_of(const orb_nearest *tree, const double *positions, const int32_t *triangles, int32_t t) {
  const int32_t *corner = triangles + 3 * (int64_t)t;
  const double UNITS = (1u << 31) / 3.0;
  item out = {.triangle = t};
  for (int k = 0; k < 3; k++) {
    double sum = 0;
    for (int i = 0; i < 3; i++) {
      sum += (positions[3 * (int64_t)corner[i] + k] - tree->origin[k]) * tree->scale;
    }
    out.centre[k] = sum > 0 && sum < 4 ? (uint32_t)(sum * UNITS) : 0; /* NaN becomes 0 */
  }
  return out;
}

/* The axis along which the centres spread farthest, and their range there. */
static int longest_axis(const item *items, int32_t count, uint32_t range[2]) {
  uint32_t low[3], high[3];
  memcpy(low, items[0].centre, sizeof low);
  memcpy(high, low, sizeof high);
  for (int32_t i = 1; i < count; i++) {
    for (int k = 0; k < 3; k++) {
      uint32_t x = items[i].centre[k];
      low[k] = x < low[k] ? x : low[k];
      high[k] = x > high[k] ? x : high[k];
    }
  }
  int axis = 0;
  for (int k = 1; k < 3; k++) {
    axis = high[k] - low[k] > high[axis] - low[axis] ? k : axis;
  }
  range[0] = low[axis];
  range[1] = high[axis];
  return axis;
}

/* Brings the items below `limit` to the front, in their order, without branches that the data decide: half of those
 * would be mispredicted. Returns their number. scratch: count items. */
static int32_t bring_forward(item *items, int32_t count, int axis, uint32_t limit, item *scratch) {
  int32_t below = 0, rest = 0;
  for (int32_t i = 0; i < count; i++) {
    item x = items[i];
    int comes_first = x.centre[axis] < limit;
    items[below] = x;
    scratch[rest] = x;
    below += comes_first;
    rest += !comes_first;
  }
  memcpy(items + below, scratch, (size_t)rest * sizeof *items);
  return below;
}

/* Selection: the `middle` smallest come first. A histogram of the range shows in which bin the last of them lies, and
 * only that bin is left to select from. A round leaves at most 1/32 of the range: six are enough for 31 bits. */
static void select_middle(item *items, int32_t count, int32_t middle, int axis, uint32_t range[2], item *scratch) {
  uint32_t low = range[0], high = range[1];
  while (low < high && middle > 0 && middle < count) {
    int32_t bins[BINS] = {0}, below = 0;
    uint32_t bin = 0;
    int shift = 0;
    while ((high - low) >> shift >= BINS) {
      shift++;
    }
    for (int32_t i = 0; i < count; i++) {
      bins[(items[i].centre[axis] - low) >> shift]++;
    }
    for (; below + bins[bin] < middle; bin++) {
      below += bins[bin];
    }
    low += bin << shift;
    high = low + (1u << shift) - 1;
    below = bring_forward(items, count, axis, low, scratch);
    items += below;
    middle -= below;
    count = bring_forward(items, count - below, axis, high + 1, scratch);
  }
}

/* Puts triangles into the order of the leaves. Runs are cut at multiples of a power of eight, so that nodes and leaves
 * but the last of a level are full. items: `total`, and as many more for scratch. */
static orb_status arrange(orb_context *ctx, item *items, int32_t total) {
  struct {
    int32_t first, count;
  } stack[3 * LEVELS]; /* a level of nodes takes three cuts, and each leaves one run on the stack */
  int depth = 0;
  stack[depth].first = 0;
  stack[depth++].count = total;
  while (depth > 0) {
    int32_t first = stack[--depth].first, count = stack[depth].count;
    if (count <= WIDE) {
      continue;
    }
    int64_t child = WIDE; /* triangles of a full child */
    while (child * WIDE < count) {
      child *= WIDE;
    }
    int64_t children = (count + child - 1) / child;
    int32_t left = (int32_t)(children / 2 * child);
    uint32_t range[2];
    int axis = longest_axis(items + first, count, range);
    select_middle(items + first, count, left, axis, range, items + total);
    if (count > 4096) {
      ORB_TRY(orb_context_check(ctx));
    }
    ORB_ASSERT(depth + 2 <= 3 * LEVELS);
    stack[depth].first = first;
    stack[depth++].count = left;
    stack[depth].first = first + left;
    stack[depth++].count = count - left;
  }
  return ORB_OK;
}

static void reset_boxes(node *n) {
  for (int k = 0; k < 3; k++) {
    for (int i = 0; i < WIDE; i++) {
      n->low[k][i] = (float)FAR;
      n->high[k][i] = (float)-FAR;
    }
  }
}

static void box_of_entry(const orb_nearest *tree, int32_t entry, node *n, int child) {
  for (int i = 0; i < 9; i++) {
    int k = i % 3;
    double x = (tree->corners[9 * (size_t)entry + (size_t)i] - tree->origin[k]) * tree->scale;
    double below = !(x > -FAR) ? -FAR : x - BOX_MARGIN, above = !(x < FAR) ? FAR : x + BOX_MARGIN;
    n->low[k][child] = (float)below < n->low[k][child] ? (float)below : n->low[k][child];
    n->high[k][child] = (float)above > n->high[k][child] ? (float)above : n->high[k][child];
  }
}

static void box_of_node(const node *from, node *n, int child) {
  for (int k = 0; k < 3; k++) {
    for (int i = 0; i < from->count; i++) {
      n->low[k][child] = from->low[k][i] < n->low[k][child] ? from->low[k][i] : n->low[k][child];
      n->high[k][child] = from->high[k][i] > n->high[k][child] ? from->high[k][i] : n->high[k][child];
    }
  }
}

/* Adds the nodes over `count` children, the first of which is `first`. */
static orb_status add_level(orb_context *ctx, orb_nearest *tree, int32_t first, int32_t count) {
  int leaves = tree->node_count == 0;
  for (int32_t done = 0; done < count; done += WIDE) {
    node *n = &tree->nodes[tree->node_count++];
    reset_boxes(n);
    n->first = first + done;
    n->count = count - done < WIDE ? count - done : WIDE;
    for (int32_t i = 0; i < n->count; i++) {
      if (leaves) {
        box_of_entry(tree, n->first + i, n, i);
      } else {
        box_of_node(&tree->nodes[n->first + i], n, i);
      }
    }
    if (tree->node_count % 4096 == 0) {
      ORB_TRY(orb_context_check(ctx));
    }
  }
  return ORB_OK;
}

static orb_status build(orb_context *ctx, orb_nearest *tree) {
  ORB_TRY(add_level(ctx, tree, 0, tree->triangle_count));
  tree->leaf_count = tree->node_count;
  for (int32_t first = 0; tree->node_count - first > 1;) {
    int32_t count = tree->node_count - first;
    ORB_TRY(add_level(ctx, tree, first, count));
    first += count;
  }
  return ORB_OK;
}

static orb_status fill(orb_context *ctx, orb_nearest *tree, const double *positions, const int32_t *triangles,
                       item *items) {
  int32_t count = tree->triangle_count;
  find_extent(tree, positions, triangles);
  for (int32_t t = 0; t < count; t++) {
    items[t] = item_of(tree, positions, triangles, t);
  }
  ORB_TRY(arrange(ctx, items, count));
  for (int32_t i = 0; i < count; i++) {
    tree->triangle[i] = items[i].triangle;
    for (int64_t k = 0; k < 3; k++) {
      int32_t v = triangles[3 * (int64_t)items[i].triangle + k];
      memcpy(tree->corners + 9 * (int64_t)i + 3 * k, positions + 3 * (int64_t)v, 3 * sizeof(double));
    }
  }
  return build(ctx, tree);
}

orb_status orb_nearest_create(orb_context *ctx, const double *positions, const int32_t *triangles,
                              int32_t triangle_count, orb_nearest **out) {
  *out = NULL;
  orb_nearest *tree = ORB_NEW0(ctx, orb_nearest, 1);
  if (!tree) {
    return ORB_E_NO_MEMORY;
  }
  tree->triangle_count = triangle_count;
  int64_t count = triangle_count;
  item *items = ORB_NEW(ctx, item, 2 * count);
  tree->nodes = ORB_NEW(ctx, node, (count + 6) / 7 + LEVELS); /* Σ ⌈count / 8ⁱ⌉ */
  tree->corners = ORB_NEW(ctx, double, 9 * count);
  tree->triangle = ORB_NEW(ctx, int32_t, count);
  orb_status status = items && tree->nodes && tree->corners && tree->triangle ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK && count > 0) {
    status = fill(ctx, tree, positions, triangles, items);
  }
  orb_free(ctx, items);
  if (status != ORB_OK) {
    orb_nearest_destroy(ctx, tree);
  } else {
    *out = tree;
  }
  return status;
}

void orb_nearest_destroy(orb_context *ctx, orb_nearest *tree) {
  if (tree) {
    orb_free(ctx, tree->nodes);
    orb_free(ctx, tree->corners);
    orb_free(ctx, tree->triangle);
    orb_free(ctx, tree);
  }
}

/* The parameter, 0 to 1, of the point of segment a b that is nearest to p. */
static double on_segment(const double a[3], const double b[3], const double p[3]) {
  double d[3], e[3];
  orb_sub(b, a, d);
  orb_sub(p, a, e);
  double length2 = orb_dot(d, d), t = orb_dot(e, d);
  return !(t > 0) || !(length2 > 0) ? 0 : t < length2 ? t / length2 : 1;
}

/* After Ericson, Real-Time Collision Detection, 5.1.5; a triangle without area by its edges. */
double orb_triangle_nearest(const double *c, const double p[3], double at[3]) {
  double ab[3], ac[3], ap[3], bp[3], cp[3];
  orb_sub(c + 3, c, ab);
  orb_sub(c + 6, c, ac);
  orb_sub(p, c, ap);
  orb_sub(p, c + 3, bp);
  orb_sub(p, c + 6, cp);
  double d1 = orb_dot(ab, ap), d2 = orb_dot(ac, ap), d3 = orb_dot(ab, bp), d4 = orb_dot(ac, bp);
  double d5 = orb_dot(ab, cp), d6 = orb_dot(ac, cp);
  double vc = d1 * d4 - d3 * d2, vb = d5 * d2 - d1 * d6, va = d3 * d6 - d5 * d4;
  if (vc > 0 && vb > 0 && va > 0) {
    double sum = va + vb + vc;
    at[1] = vb / sum;
    at[2] = vc / sum;
    at[0] = 1 - at[1] - at[2];
    at[0] = at[0] > 0 ? at[0] : 0;
    double q[3];
    for (int k = 0; k < 3; k++) {
      q[k] = ap[k] - at[1] * ab[k] - at[2] * ac[k];
    }
    return orb_dot(q, q);
  }
  double best = INFINITY;
  for (int i = 0; i < 3; i++) {
    int j = (i + 1) % 3;
    double t = on_segment(c + 3 * i, c + 3 * j, p), q[3];
    for (int k = 0; k < 3; k++) {
      q[k] = c[3 * i + k] + t * (c[3 * j + k] - c[3 * i + k]) - p[k];
    }
    double distance2 = orb_dot(q, q);
    if (distance2 < best) {
      best = distance2;
      at[i] = 1 - t;
      at[j] = t;
      at[3 - i - j] = 0;
    }
  }
  return best;
}

typedef struct query {
  float below[3], above[3]; /* the point, shifted down and up by more than its rounding */
  float limit;              /* squared distance to a box beyond which nothing in it matters */
} query;

typedef struct visit {
  int32_t at; /* node, or entry in a leaf */
  float distance2;
} visit;

static float limit_of(const orb_nearest *tree, double best) {
  double limit = best * tree->scale * tree->scale * (1 + LIMIT_MARGIN);
  return limit < (double)NO_LIMIT ? (float)limit : NO_LIMIT; /* NaN too becomes NO_LIMIT */
}

/* How far x lies outside low … high. */
static inline float outside(float low, float high, float x_below, float x_above) {
  float under = low - x_above, over = x_below - high, most = under > over ? under : over;
  return most > 0 ? most : 0;
}

/* The squared distance to each child's box, never more than the true one by a relative 1e-6. Returns the bits of those
 * within the limit. */
ORB_CLONES static uint32_t box_distances(const node *restrict n, const query *restrict q, float *restrict out) {
  uint32_t near = 0;
  for (int i = 0; i < WIDE; i++) {
    float x = outside(n->low[0][i], n->high[0][i], q->below[0], q->above[0]);
    float y = outside(n->low[1][i], n->high[1][i], q->below[1], q->above[1]);
    float z = outside(n->low[2][i], n->high[2][i], q->below[2], q->above[2]);
    out[i] = x * x + y * y + z * z;
  }
  for (int i = 0; i < WIDE; i++) {
    near |= (uint32_t)(out[i] <= q->limit) << i;
  }
  return near;
}

/* Lists the children within the limit, farthest first. Returns how many. */
static int children_near(const node *n, const query *q, visit out[WIDE]) {
  float distance2[WIDE];
  int found = 0;
  uint32_t near = box_distances(n, q, distance2) & ((1u << n->count) - 1);
  for (; near; near &= near - 1) {
    int i = __builtin_ctz(near), at = found++;
    for (; at > 0 && out[at - 1].distance2 < distance2[i]; at--) {
      out[at] = out[at - 1];
    }
    out[at] = (visit){n->first + i, distance2[i]};
  }
  return found;
}

/* Continues from *out: a place at the squared distance `best`, or none, with `best` as the bound. */
static double search(const orb_nearest *tree, const double p[3], double best, orb_place *out) {
  int32_t found = out->triangle;
  query q = {.limit = limit_of(tree, best)};
  for (int k = 0; k < 3; k++) {
    double x = clamped((p[k] - tree->origin[k]) * tree->scale);
    q.below[k] = (float)(x - QUERY_MARGIN * fabs(x));
    q.above[k] = (float)(x + QUERY_MARGIN * fabs(x));
  }
  visit stack[STACK];
  int depth = 0;
  if (tree->node_count > 0) {
    stack[depth++] = (visit){tree->node_count - 1, 0};
  }
  while (depth > 0) {
    visit next = stack[--depth];
    if (!(next.distance2 <= q.limit)) {
      continue;
    }
    if (next.at >= tree->leaf_count) {
      ORB_ASSERT(depth + WIDE <= STACK);
      depth += children_near(&tree->nodes[next.at], &q, stack + depth);
      continue;
    }
    visit entries[WIDE];
    for (int i = children_near(&tree->nodes[next.at], &q, entries) - 1; i >= 0 && entries[i].distance2 <= q.limit;
         i--) {
      int32_t entry = entries[i].at, t = tree->triangle[entry];
      double place[3], d2 = orb_triangle_nearest(tree->corners + 9 * (size_t)entry, p, place);
      if (d2 < best || (d2 == best && found >= 0 && t < found)) {
        best = d2;
        found = t;
        q.limit = limit_of(tree, best);
        memcpy(out->at, place, sizeof place);
      }
    }
  }
  out->triangle = found;
  return found >= 0 ? best : INFINITY;
}

double orb_nearest_query(const orb_nearest *tree, const double p[3], double max_distance2, orb_place *out) {
  *out = (orb_place){.triangle = -1};
  double distance2 = search(tree, p, max_distance2, out);
  if (out->triangle < 0 && max_distance2 == INFINITY) { /* every distance is NaN or overflows: any place is as near */
    *out = (orb_place){.triangle = 0, .at = {1, 0, 0}};
    return INFINITY;
  }
  return distance2;
}

double orb_nearest_query_from(const orb_nearest *tree, const double p[3], const orb_place *known,
                              double known_distance2, orb_place *out) {
  *out = *known;
  return search(tree, p, known->triangle >= 0 ? known_distance2 : INFINITY, out);
}
