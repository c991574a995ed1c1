/* The names of found landmarks follow from how a body stands.
 *
 * Up is y or z, as files have it. The surface within the lowest part of the height falls into connected pieces, the
 * feet: four under a body that stands on four limbs, two under one that stands upright. The axis with such feet is up;
 * where both have them, or none, there are no names.
 *
 * Four feet: the body is longer than it is wide. Two feet stand at each end, one on either side. The head is at the end
 * to which the upper half of the surface leans: neck and head have more of it than a tail. Two feet: the sides are
 * where they are, and the toes, which are in front of the shins, point forward. Left and right follow from up and
 * front. */
#include "merge/name.h"

#include <math.h>

#include "base/check.h"
#include "base/context.h"
#include "base/forest.h"
#include "base/memory.h"
#include "numeric/vec3.h"

/* Shares of the height: how high feet reach and landmarks on feet lie, and where the shins are. */
static const double FEET = 0.12, ON_FEET = 0.22, SHINS_FROM = 0.14, SHINS_TO = 0.24;
static const double SMALL_FOOT = 0.15; /* of the area of the largest foot: smaller pieces are not feet */
static const double LONGER = 1.3; /* times as long as wide (by standard deviations): the least of a body on four feet */
static const double APART = 0.06; /* least distance of two feet beside each other, of the height */
static const double LEANS = 0.04; /* how far the upper half leans at least, of the distance from hind to front feet */
static const double THIGHS_FROM = 0.3, THIGHS_TO = 0.4,
                    STRAIGHT = 0.03; /* thighs are above the shins, or it crouches */
static const double TOES = 0.01;     /* how far feet lie in front of the shins at least, of the height */
static const double TALLER = 1.5;    /* times as high along `up` as along another axis with two feet, at least */
static const double AROUND = 0.1;    /* of the diagonal: how large the surface around a landmark is, */
static const double THIN = 0.6;      /* which is a tail below this share of a disc */
static const double DEEP = 0.6;      /* how deep a body on two feet is at most from front to back, of the height */
static const double TOP = 0.93;      /* of the height: where its top begins */
static const double ALIKE = 0.7;     /* how far one side of the top reaches at least, of the other side */
static const double ARM = 0.2,
                    HEAD = 0.1; /* of the height, from the middle plane: hands are farther, a head is nearer */

static const double SYMMETRIC = 0.025; /* of the diagonal: the mean distance from the mirror image is below it */

enum { FEET_MAX = 4, SAMPLES = 500 };

typedef struct foot {
  double at[3], area;
} foot;

/* A body with one axis up. */
typedef struct stance {
  int up, feet; /* feet 0: it does not stand along this axis */
  double low, height;
  foot foot[FEET_MAX];
  double front[3], left[3], middle[3]; /* unit vectors; a point of the middle plane */
} stance;

typedef struct body {
  const orb_mesh *mesh;
  int32_t *piece; /* of each vertex: a forest */
  double *area;   /* of each root */
  double *sum;    /* of each root: area × centroid */
  orb_nearest *tree;
  orb_extent extent;
} body;

static double measure(const orb_mesh *mesh, int32_t t, double centroid[3]) {
  const double *p[3];
  for (int k = 0; k < 3; k++) {
    p[k] = mesh->positions + 3 * (size_t)mesh->triangles[3 * (size_t)t + (size_t)k];
  }
  for (int c = 0; c < 3; c++) {
    centroid[c] = (p[0][c] + p[1][c] + p[2][c]) / 3;
  }
  return orb_triangle_area(p[0], p[1], p[2]);
}

/* The connected pieces of the surface below a height: their roots get area and sum. */
static void gather_pieces(body *b, int up, double below) {
  const orb_mesh *mesh = b->mesh;
  for (int32_t v = 0; v < mesh->vertex_count; v++) {
    b->piece[v] = v;
    b->area[v] = b->sum[3 * (size_t)v] = b->sum[3 * (size_t)v + 1] = b->sum[3 * (size_t)v + 2] = 0;
  }
  for (int pass = 0; pass < 2; pass++) {
    for (int32_t t = 0; t < mesh->triangle_count; t++) {
      const int32_t *v = mesh->triangles + 3 * (size_t)t;
      double centroid[3], area = measure(mesh, t, centroid);
      if (centroid[up] > below) {
        continue;
      }
      for (int k = 1; pass == 0 && k < 3; k++) {
        orb_forest_join(b->piece, v[0], v[k]);
      }
      size_t at = (size_t)orb_forest_root(b->piece, v[0]);
      for (int c = 0; pass == 1 && c < 3; c++) {
        b->sum[3 * at + (size_t)c] += area * centroid[c];
      }
      b->area[at] += pass == 1 ? area : 0;
    }
  }
}

/* Fills the feet of a stance; none where there are more than four. */
static void find_feet(body *b, stance *s) {
  double largest = 0;
  gather_pieces(b, s->up, s->low + FEET * s->height);
  for (int32_t v = 0; v < b->mesh->vertex_count; v++) {
    largest = fmax(largest, b->area[v]);
  }
  for (int32_t v = 0; v < b->mesh->vertex_count; v++) {
    if (!(b->area[v] > SMALL_FOOT * largest)) {
      continue;
    }
    if (s->feet == FEET_MAX) {
      s->feet = 0;
      return;
    }
    foot *f = &s->foot[s->feet++];
    f->area = b->area[v];
    for (int c = 0; c < 3; c++) {
      f->at[c] = b->sum[3 * (size_t)v + (size_t)c] / b->area[v];
    }
  }
}

/* The mean of the surface between two heights. Returns its area. */
static double mean_between(const body *b, int up, double from, double to, double out[3]) {
  double sum = 0, at[3] = {0, 0, 0};
  for (int32_t t = 0; t < b->mesh->triangle_count; t++) {
    double centroid[3], area = measure(b->mesh, t, centroid);
    if (centroid[up] < from || centroid[up] > to) {
      continue;
    }
    sum += area;
    for (int c = 0; c < 3; c++) {
      at[c] += area * centroid[c];
    }
  }
  for (int c = 0; c < 3; c++) {
    out[c] = sum > 0 ? at[c] / sum : 0;
  }
  return sum;
}

/* The direction, horizontal, in which the surface is longest. Returns how many times as long as it is wide. */
static double find_length(const body *b, int up, double out[3]) {
  int u = (up + 1) % 3, v = (up + 2) % 3;
  double mean[3], uu = 0, uv = 0, vv = 0;
  (void)mean_between(b, up, -INFINITY, INFINITY, mean);
  for (int32_t t = 0; t < b->mesh->triangle_count; t++) {
    double c[3], area = measure(b->mesh, t, c);
    uu += area * (c[u] - mean[u]) * (c[u] - mean[u]);
    uv += area * (c[u] - mean[u]) * (c[v] - mean[v]);
    vv += area * (c[v] - mean[v]) * (c[v] - mean[v]);
  }
  double angle = 0.5 * atan2(2 * uv, uu - vv), gap = sqrt((uu - vv) * (uu - vv) + 4 * uv * uv);
  out[up] = 0;
  out[u] = cos(angle);
  out[v] = sin(angle);
  return sqrt((uu + vv + gap) / fmax(uu + vv - gap, ORB_TINY));
}

static double along(const double direction[3], const double from[3], const double to[3]) {
  double d[3];
  orb_sub(to, from, d);
  return orb_dot(direction, d);
}

/* left = up × front. */
static void turn_left(stance *s) {
  double up[3] = {0, 0, 0};
  up[s->up] = 1;
  orb_cross(up, s->front, s->left);
}

/* Four feet: orders them left front, right front, left hind, right hind. Returns 0 where that is not clear. */
static int stand_on_four(const body *b, stance *s) {
  double upper[3], ends[2], feet[3] = {0, 0, 0};
  if (find_length(b, s->up, s->front) < LONGER) {
    return 0;
  }
  for (int i = 0; i < 4; i++) {
    for (int c = 0; c < 3; c++) {
      feet[c] += s->foot[i].at[c] / 4;
    }
  }
  for (int i = 1; i < 4; i++) { /* by insertion: the foremost first */
    for (int j = i; j > 0 && along(s->front, s->foot[j - 1].at, s->foot[j].at) > 0; j--) {
      foot other = s->foot[j];
      s->foot[j] = s->foot[j - 1];
      s->foot[j - 1] = other;
    }
  }
  for (int e = 0; e < 2; e++) {
    ends[e] = 0.5 * (along(s->front, feet, s->foot[2 * e].at) + along(s->front, feet, s->foot[2 * e + 1].at));
  }
  (void)mean_between(b, s->up, s->low + 0.5 * s->height, INFINITY, upper);
  double lean = along(s->front, feet, upper) / (ends[0] - ends[1]);
  if (!(fabs(lean) > LEANS)) {
    return 0;
  }
  if (lean < 0) {
    for (int c = 0; c < 3; c++) {
      s->front[c] = -s->front[c];
    }
    for (int i = 0; i < 2; i++) {
      foot other = s->foot[i];
      s->foot[i] = s->foot[2 + i];
      s->foot[2 + i] = other;
    }
  }
  turn_left(s);
  for (int i = 0; i < 4; i += 2) {
    double width = along(s->left, s->foot[i + 1].at, s->foot[i].at);
    if (width < 0) {
      foot other = s->foot[i];
      s->foot[i] = s->foot[i + 1];
      s->foot[i + 1] = other;
    }
    if (fabs(width) < APART * s->height) {
      return 0;
    }
  }
  for (int c = 0; c < 3; c++) {
    s->middle[c] = feet[c];
  }
  return 1;
}

/* How far the surface reaches from a point along a direction. */
static double reach(const body *b, const double from[3], const double direction[3]) {
  double most = -INFINITY;
  for (int32_t v = 0; v < b->mesh->vertex_count; v++) {
    most = fmax(most, along(direction, from, b->mesh->positions + 3 * (size_t)v));
  }
  return most;
}

/* Whether a body on two feet is upright: flat from front to back, with its top in the middle between both sides. */
static int is_upright(const body *b, const stance *s) {
  double back[3] = {-s->front[0], -s->front[1], -s->front[2]}, right[3] = {-s->left[0], -s->left[1], -s->left[2]};
  double deep = reach(b, s->middle, s->front) + reach(b, s->middle, back), top[3], all[3];
  double sides[2] = {reach(b, s->middle, s->left), reach(b, s->middle, right)};
  (void)mean_between(b, s->up, s->low + TOP * s->height, INFINITY, top);
  (void)mean_between(b, s->up, -INFINITY, INFINITY, all);
  return deep < DEEP * s->height && fabs(along(s->left, s->middle, top)) < HEAD * s->height &&
         fabs(along(s->left, s->middle, all)) < HEAD / 2 * s->height &&
         fmin(sides[0], sides[1]) > ALIKE * fmax(sides[0], sides[1]);
}

/* Two feet: orders them left, right. Returns 0 where that is not clear. */
static int stand_on_two(const body *b, stance *s) {
  double up[3] = {0, 0, 0}, across[3], toes[3], shins[3], thighs[3];
  up[s->up] = 1;
  orb_sub(s->foot[1].at, s->foot[0].at, across);
  across[s->up] = 0;
  if (orb_normalize(across) < APART * s->height) {
    return 0;
  }
  orb_cross(across, up, s->front);
  (void)mean_between(b, s->up, s->low, s->low + FEET / 2 * s->height, toes);
  (void)mean_between(b, s->up, s->low + SHINS_FROM * s->height, s->low + SHINS_TO * s->height, shins);
  double ahead = along(s->front, shins, toes);
  (void)mean_between(b, s->up, s->low + THIGHS_FROM * s->height, s->low + THIGHS_TO * s->height, thighs);
  if (!(fabs(ahead) > TOES * s->height) || fabs(along(s->front, shins, thighs)) > STRAIGHT * s->height) {
    return 0;
  }
  for (int c = 0; c < 3; c++) {
    s->front[c] = ahead < 0 ? -s->front[c] : s->front[c];
    s->middle[c] = 0.5 * (s->foot[0].at[c] + s->foot[1].at[c]);
  }
  turn_left(s);
  if (along(s->left, s->foot[1].at, s->foot[0].at) < 0) {
    foot other = s->foot[0];
    s->foot[0] = s->foot[1];
    s->foot[1] = other;
  }
  return is_upright(b, s);
}

/* Whether the surface is nearly its own mirror image, in the plane between left and right: the mean distance of
 * mirrored vertices from it. */
static int is_symmetric(const body *b, const stance *s) {
  const orb_mesh *mesh = b->mesh;
  int32_t step = mesh->vertex_count / SAMPLES + 1, count = 0;
  double centre[3], sum = 0;
  (void)mean_between(b, s->up, -INFINITY, INFINITY, centre);
  for (int32_t v = 0; v < mesh->vertex_count; v += step, count++) {
    double image[3], d = 2 * along(s->left, centre, mesh->positions + 3 * (size_t)v);
    orb_place place;
    for (int c = 0; c < 3; c++) {
      image[c] = mesh->positions[3 * (size_t)v + (size_t)c] - d * s->left[c];
    }
    sum += sqrt(orb_nearest_query(b->tree, image, INFINITY, &place));
  }
  return sum < SYMMETRIC * b->extent.diagonal * count;
}

static void stand(body *b, int up, stance *s) {
  *s = (stance){.up = up, .low = b->extent.min[up], .height = b->extent.max[up] - b->extent.min[up]};
  find_feet(b, s);
  int stands = (s->feet == 4 && stand_on_four(b, s)) || (s->feet == 2 && stand_on_two(b, s));
  if (!stands || !is_symmetric(b, s)) {
    s->feet = 0;
  }
}

/* The stance that is clear; NULL: none. */
static const stance *choose(const stance s[2]) {
  if (s[0].feet != s[1].feet) {
    return s[0].feet > s[1].feet ? &s[0] : &s[1];
  }
  if (s[0].feet == 2 && s[0].height > TALLER * s[1].height) {
    return &s[0];
  }
  return s[0].feet == 2 && s[1].height > TALLER * s[0].height ? &s[1] : NULL;
}

/* How much surface is within a ball, as a share of a disc of its radius. */
static double fullness(const body *b, const double at[3], double radius) {
  double sum = 0;
  for (int32_t t = 0; t < b->mesh->triangle_count; t++) {
    double centroid[3], area = measure(b->mesh, t, centroid);
    sum += orb_distance2(centroid, at) < radius * radius ? area : 0;
  }
  return sum / (M_PI * radius * radius);
}

typedef struct naming {
  const stance *s;
  const double *at;
  int32_t count;
  const char **names;
} naming;

static double height_of(const naming *n, int32_t i) {
  return (n->at[3 * (size_t)i + (size_t)n->s->up] - n->s->low) / n->s->height;
}

/* Each foot gets the landmark on it that is nearest to its middle. */
static void name_feet(const naming *n, const char *const words[]) {
  for (int f = 0; f < n->s->feet; f++) {
    int32_t best = -1;
    double least = INFINITY;
    for (int32_t i = 0; i < n->count; i++) {
      const double *at = n->at + 3 * (size_t)i;
      double here = orb_distance2(at, n->s->foot[f].at), most = ON_FEET * n->s->height;
      int nearest = here < most * most;
      for (int other = 0; other < n->s->feet; other++) {
        nearest &= here <= orb_distance2(at, n->s->foot[other].at);
      }
      if (nearest && height_of(n, i) < ON_FEET && here < least) {
        best = i;
        least = here;
      }
    }
    if (best >= 0) {
      n->names[best] = words[f];
    }
  }
}

/* The landmark without a name that lies farthest in a direction, from the middle of the feet, of those above them. */
static int32_t farthest(const naming *n, const double direction[3], double height, double *out) {
  int32_t best = -1;
  *out = -INFINITY;
  for (int32_t i = 0; i < n->count; i++) {
    double d = along(direction, n->s->middle, n->at + 3 * (size_t)i);
    if (!n->names[i] && height_of(n, i) > height && d > *out) {
      best = i;
      *out = d;
    }
  }
  return best;
}

static void name_on_four(const body *b, const naming *n) {
  static const char *const words[] = {"left front limb", "right front limb", "left hind limb", "right hind limb"};
  const stance *s = n->s;
  double back[3] = {-s->front[0], -s->front[1], -s->front[2]}, d;
  name_feet(n, words);
  int32_t head = farthest(n, s->front, 0.35, &d);
  if (head >= 0 && d > along(s->front, s->middle, s->foot[0].at) && d > along(s->front, s->middle, s->foot[1].at)) {
    n->names[head] = "head";
  }
  int32_t tail = farthest(n, back, ON_FEET, &d);
  if (tail >= 0 && d > along(back, s->middle, s->foot[2].at) && d > along(back, s->middle, s->foot[3].at) &&
      fullness(b, n->at + 3 * (size_t)tail, AROUND * b->extent.diagonal) < THIN) {
    n->names[tail] = "tail";
  }
}

static void name_on_two(const naming *n) {
  static const char *const words[] = {"left lower limb", "right lower limb"};
  const stance *s = n->s;
  double up[3] = {0, 0, 0}, right[3] = {-s->left[0], -s->left[1], -s->left[2]}, d;
  up[s->up] = 1;
  name_feet(n, words);
  int32_t hand = farthest(n, s->left, 0.3, &d);
  if (hand >= 0 && d > ARM * s->height) {
    n->names[hand] = "left upper limb";
  }
  hand = farthest(n, right, 0.3, &d);
  if (hand >= 0 && d > ARM * s->height) {
    n->names[hand] = "right upper limb";
  }
  int32_t head = farthest(n, up, 0.7, &d);
  if (head >= 0 && fabs(along(s->left, s->middle, n->at + 3 * (size_t)head)) < HEAD * s->height) {
    n->names[head] = "head";
  }
}

orb_status orb_name_points(orb_context *ctx, const orb_mesh *mesh, const double *at, int32_t count,
                           const char **names) {
  body b = {.mesh = mesh};
  stance stances[2];
  orb_status status = ORB_E_NO_MEMORY;
  for (int32_t i = 0; i < count; i++) {
    names[i] = NULL;
  }
  orb_mesh_extent(mesh, &b.extent);
  b.piece = ORB_NEW(ctx, int32_t, mesh->vertex_count);
  b.area = ORB_NEW(ctx, double, mesh->vertex_count);
  b.sum = ORB_NEW(ctx, double, 3 * (size_t)mesh->vertex_count);
  if (!b.piece || !b.area || !b.sum) {
    goto done;
  }
  ORB_GO(status, orb_nearest_create(ctx, mesh->positions, mesh->triangles, mesh->triangle_count, &b.tree), done);
  for (int i = 0; i < 2; i++) {
    stand(&b, 1 + i, &stances[i]);
    ORB_GO(status, orb_context_check(ctx), done);
  }
  const stance *s = choose(stances);
  if (s) {
    const naming n = {.s = s, .at = at, .count = count, .names = names};
    if (s->feet == 4) {
      name_on_four(&b, &n);
    } else {
      name_on_two(&n);
    }
  }
done:
  orb_nearest_destroy(ctx, b.tree);
  orb_free(ctx, b.piece);
  orb_free(ctx, b.area);
  orb_free(ctx, b.sum);
  return status;
}
