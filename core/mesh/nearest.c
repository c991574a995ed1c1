/* Nearest point of a triangle set.
 *
 * A binary tree of boxes in one array, in depth-first order: the left child of node i is i + 1, the right one is
 * stored. It is built top down by the median along the longest axis of the centres (quickselect); a leaf holds at most
 * LEAF triangles, whose corners are copied side by side. A query visits the nearer box first, with a fixed stack.
 */
#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "mesh/nearest.h"
#include "numeric/vec3.h"
#include "orbmorph/mesh.h"

enum {
  LEAF = 4,  /* triangles; more make boxes fewer and leaves slower */
  STACK = 64 /* nodes; halving 2³¹ triangles takes 31 levels, and each level leaves one node on the stack */
};

typedef struct node {
  double low[3], high[3];
  int32_t right; /* of an inner node; of a leaf: −1 − its first entry */
  int32_t count; /* triangles of a leaf, 0: inner */
} node;

struct orb_nearest {
  orb_context *ctx;
  node *nodes;
  double *corners; /* 9 an entry */
  int32_t *triangle;
  int32_t node_count, triangle_count;
};

static void box_of(const double *corners, const int32_t *order, int32_t count, node *out) {
  for (int k = 0; k < 3; k++) {
    out->low[k] = INFINITY;
    out->high[k] = -INFINITY;
  }
  for (int32_t i = 0; i < count; i++) {
    const double *c = corners + 9 * (size_t)order[i];
    for (int k = 0; k < 9; k++) {
      out->low[k % 3] = c[k] < out->low[k % 3] ? c[k] : out->low[k % 3];
      out->high[k % 3] = c[k] > out->high[k % 3] ? c[k] : out->high[k % 3];
    }
  }
}

/* Thrice the centre of a triangle along an axis, ties by number: a strict order. */
static int comes_before(const double *corners, int32_t a, int32_t b, int axis) {
  const double *p = corners + 9 * (size_t)a + axis, *q = corners + 9 * (size_t)b + axis;
  double x = p[0] + p[3] + p[6], y = q[0] + q[3] + q[6];
  return x < y || (x == y && a < b);
}

static void swap(int32_t *order, int32_t i, int32_t j) {
  int32_t x = order[i];
  order[i] = order[j];
  order[j] = x;
}

/* Hoare's selection with the median of three: the `middle` smallest come first. Gives up after 128 rounds, which only
 * an adversarial input needs: any split makes a valid tree. */
static void select_middle(const double *corners, int32_t *order, int32_t count, int32_t middle, int axis) {
  int32_t low = 0, high = count - 1;
  for (int rounds = 0; low < high && rounds < 128; rounds++) {
    int32_t mid = low + (high - low) / 2;
    if (comes_before(corners, order[mid], order[low], axis)) {
      swap(order, mid, low);
    }
    if (comes_before(corners, order[high], order[low], axis)) {
      swap(order, high, low);
    }
    if (comes_before(corners, order[high], order[mid], axis)) {
      swap(order, high, mid);
    }
    int32_t pivot = order[mid], i = low, j = high;
    while (i <= j) {
      while (comes_before(corners, order[i], pivot, axis)) {
        i++;
      }
      while (comes_before(corners, pivot, order[j], axis)) {
        j--;
      }
      if (i <= j) {
        swap(order, i++, j--);
      }
    }
    if (middle <= j) {
      high = j;
    } else if (middle >= i) {
      low = i;
    } else {
      return;
    }
  }
}

static int longest_axis(const double *corners, const int32_t *order, int32_t count) {
  double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
  for (int32_t i = 0; i < count; i++) {
    const double *c = corners + 9 * (size_t)order[i];
    for (int k = 0; k < 3; k++) {
      double x = c[k] + c[k + 3] + c[k + 6];
      low[k] = x < low[k] ? x : low[k];
      high[k] = x > high[k] ? x : high[k];
    }
  }
  int axis = 0;
  for (int k = 1; k < 3; k++) {
    axis = high[k] - low[k] > high[axis] - low[axis] ? k : axis;
  }
  return axis;
}

typedef struct task {
  int32_t first, count, parent; /* parent: the node whose right child this is, −1: none */
} task;

static orb_status build(orb_nearest *tree, const double *corners, int32_t *order) {
  task stack[STACK];
  int depth = 0;
  stack[depth++] = (task){0, tree->triangle_count, -1};
  while (depth > 0) {
    task todo = stack[--depth];
    int32_t at = tree->node_count++;
    node *n = &tree->nodes[at];
    box_of(corners, order + todo.first, todo.count, n);
    if (todo.parent >= 0) {
      tree->nodes[todo.parent].right = at;
    }
    if (todo.count <= LEAF) {
      n->count = todo.count;
      n->right = -1 - todo.first;
      continue;
    }
    int32_t half = todo.count / 2;
    int axis = longest_axis(corners, order + todo.first, todo.count);
    select_middle(corners, order + todo.first, todo.count, half, axis);
    n->count = 0;
    ORB_ASSERT(depth + 2 <= STACK);
    stack[depth++] = (task){todo.first + half, todo.count - half, at};
    stack[depth++] = (task){todo.first, half, -1};
    if (todo.count > 4096) {
      ORB_TRY(orb_context_check(tree->ctx));
    }
  }
  return ORB_OK;
}

orb_status orb_nearest_create(orb_context *ctx, const double *positions, const int32_t *triangles,
                              int32_t triangle_count, orb_nearest **out) {
  *out = NULL;
  orb_nearest *tree = ORB_NEW0(ctx, orb_nearest, 1);
  if (!tree) {
    return ORB_E_NO_MEMORY;
  }
  tree->ctx = ctx;
  tree->triangle_count = triangle_count;
  size_t count = (size_t)triangle_count;
  double *corners = ORB_NEW(ctx, double, 9 * count);
  tree->nodes = ORB_NEW(ctx, node, count + 1);
  tree->corners = ORB_NEW(ctx, double, 9 * count);
  tree->triangle = ORB_NEW(ctx, int32_t, count);
  orb_status status = ORB_E_NO_MEMORY;
  if (!corners || !tree->nodes || !tree->corners || !tree->triangle) {
    goto done;
  }
  for (size_t t = 0; t < count; t++) {
    tree->triangle[t] = (int32_t)t;
    for (size_t k = 0; k < 3; k++) {
      memcpy(corners + 9 * t + 3 * k, positions + 3 * (size_t)triangles[3 * t + k], 3 * sizeof(double));
    }
  }
  status = ORB_OK;
  if (count > 0) {
    ORB_GO(status, build(tree, corners, tree->triangle), done);
  }
  for (size_t i = 0; i < count; i++) {
    memcpy(tree->corners + 9 * i, corners + 9 * (size_t)tree->triangle[i], 9 * sizeof(double));
  }
done:
  orb_free(ctx, corners);
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

static double box_distance2(const node *n, const double p[3]) {
  double sum = 0;
  for (int k = 0; k < 3; k++) {
    double below = n->low[k] - p[k], above = p[k] - n->high[k];
    double d = fmax(fmax(below, above), 0);
    sum += d * d;
  }
  return sum;
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

/* Continues from *out: a place at the squared distance `best`, or none, with `best` as the bound. */
static double search(const orb_nearest *tree, const double p[3], double best, orb_place *out) {
  int32_t found = out->triangle;
  struct {
    int32_t node;
    double distance2;
  } stack[STACK];
  int depth = 0;
  int32_t at = tree->triangle_count > 0 ? 0 : -1;
  double distance2 = at < 0 ? INFINITY : box_distance2(&tree->nodes[0], p);
  while (at >= 0) {
    const node *n = &tree->nodes[at];
    int worth = distance2 < best || (found >= 0 && distance2 <= best);
    if (worth && n->count == 0) {
      int32_t near = at + 1, far = n->right;
      double a = box_distance2(&tree->nodes[near], p), b = box_distance2(&tree->nodes[far], p);
      if (b < a) {
        double x = a;
        a = b;
        b = x;
        near = n->right;
        far = at + 1;
      }
      stack[depth].node = far;
      stack[depth++].distance2 = b;
      at = near;
      distance2 = a;
      continue;
    }
    for (int32_t i = 0; worth && i < n->count; i++) {
      int32_t entry = -1 - n->right + i, t = tree->triangle[entry];
      double place[3], d2 = orb_triangle_nearest(tree->corners + 9 * (size_t)entry, p, place);
      if (d2 < best || (d2 == best && found >= 0 && t < found)) {
        best = d2;
        found = t;
        memcpy(out->at, place, sizeof place);
      }
    }
    at = depth > 0 ? stack[--depth].node : -1;
    distance2 = at >= 0 ? stack[depth].distance2 : 0;
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
