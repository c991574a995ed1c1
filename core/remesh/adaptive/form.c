/* How the net's triangles lie in space. */
#include <math.h>
#include <stdatomic.h>

#include "numeric/vec3.h"
#include "remesh/adaptive/match.h"

static const double FINE_QUALITY = 0.12, FINE_FACING = 0.05, LEAST_QUALITY = 0.02;
static const double SURE_FACING = 0.9; /* the centre need not be asked */

/* A triangle on one shape: its normal, twice as long as its area, and how it lies to the sum of the shape's smooth
 * normals at its corners. */
typedef struct pose {
  double edges; /* sum of the squared lengths */
  double area2; /* of the normal: the squared length */
  double along; /* normal by sum */
} pose;

static inline pose pose_of(const orb_match *match, int32_t s, int32_t a, int32_t b, int32_t c) {
  double u[3], v[3], n[3], ground[3];
  const double *p = orb_match_at(match, a, s), *q = orb_match_at(match, b, s), *r = orb_match_at(match, c, s);
  orb_sub(q, p, u);
  orb_sub(r, p, v);
  orb_cross(u, v, n);
  for (int k = 0; k < 3; k++) {
    ground[k] = orb_match_normal(match, a, s)[k] + orb_match_normal(match, b, s)[k] + orb_match_normal(match, c, s)[k];
  }
  return (pose){orb_dot(u, u) + orb_dot(v, v) + orb_distance2(q, r), orb_dot(n, n), orb_dot(n, ground)};
}

/* Whether along / (3 |normal|), the facing, is below something positive. No root is taken. */
static inline int faces_less(pose at, double facing) {
  return at.along <= 0 || at.along * at.along < 9 * facing * facing * at.area2;
}

void orb_match_form_on(const orb_match *match, int32_t s, int32_t a, int32_t b, int32_t c, orb_form_squares *least) {
  pose at = pose_of(match, s, a, b, c);
  double q = at.edges > 0 ? 12 * at.area2 / (at.edges * at.edges) : 0;
  double f = at.area2 > 0 ? at.along * fabs(at.along) / (9 * at.area2) : 0;
  least->quality = q < least->quality ? q : least->quality;
  least->facing = f < least->facing ? f : least->facing;
}

orb_form orb_form_of(orb_form_squares least) {
  orb_form worst = {sqrt(least.quality), least.facing < 0 ? -sqrt(-least.facing) : sqrt(least.facing), 0, 0};
  worst.slivers = worst.quality < FINE_QUALITY;
  worst.turned = worst.facing < FINE_FACING;
  return worst;
}

orb_form orb_match_form(const orb_match *match, int32_t a, int32_t b, int32_t c) {
  orb_form_squares least = {1, 1};
  for (int32_t s = 0; s < match->shape_count; s++) {
    orb_match_form_on(match, s, a, b, c, &least);
  }
  return orb_form_of(least);
}

/* Against the shape's flat and smooth normals where the centre of the triangle on the sphere lies on it. */
static int is_turned_at_centre(const orb_match *match, int32_t s, int32_t a, int32_t b, int32_t c) {
  const int32_t corner[3] = {a, b, c};
  double centre[3] = {0, 0, 0}, u[3], v[3], n[3], flat[3], smooth[3] = {0, 0, 0};
  for (int i = 0; i < 9; i++) {
    centre[i % 3] += orb_net_point(&match->net, corner[i / 3])[i % 3];
  }
  (void)orb_normalize(centre);
  orb_place place;
  orb_locate(match->job->locator[s], centre, match->spot[(int64_t)a * match->shape_count + s].h / 3, &place);
  const int32_t *on = match->view[s].triangles + 3 * (int64_t)place.triangle;
  for (int i = 0; i < 9; i++) {
    smooth[i % 3] += place.at[i / 3] * match->vertex_normal[s][3 * (int64_t)on[i / 3] + i % 3];
  }
  const double *p = orb_match_at(match, a, s), *q = match->position[s] + 3 * (int64_t)on[0];
  orb_sub(match->position[s] + 3 * (int64_t)on[1], q, u);
  orb_sub(match->position[s] + 3 * (int64_t)on[2], q, v);
  orb_cross(u, v, flat);
  orb_sub(orb_match_at(match, b, s), p, u);
  orb_sub(orb_match_at(match, c, s), p, v);
  orb_cross(u, v, n);
  return orb_dot(n, smooth) <= 0 || orb_dot(n, flat) < 0;
}

static double turned_extent(const orb_match *match, int32_t a, int32_t b, int32_t c, int by_centre) {
  double extent = 0;
  for (int32_t s = 0; s < match->shape_count; s++) {
    pose at = pose_of(match, s, a, b, c);
    if (faces_less(at, FINE_FACING) ||
        (by_centre && faces_less(at, SURE_FACING) && is_turned_at_centre(match, s, a, b, c))) {
      extent += at.edges + 1e-200;
    }
  }
  return extent;
}

double orb_match_turned_extent(const orb_match *match, int32_t a, int32_t b, int32_t c) {
  return turned_extent(match, a, b, c, 1);
}

int orb_match_is_turned(const orb_match *match, int32_t a, int32_t b, int32_t c) {
  return turned_extent(match, a, b, c, 1) > 0;
}

double orb_match_turned_by_corners(const orb_match *match, int32_t a, int32_t b, int32_t c) {
  return turned_extent(match, a, b, c, 0);
}

orb_tally orb_match_tally_fan(const orb_match *match, int32_t v, const int32_t *ring, int n, int closed) {
  orb_tally sum = {0, 0};
  for (int i = 0; i + 1 < n + closed; i++) {
    orb_tally_add(&sum, orb_match_turned_extent(match, v, ring[i], ring[(i + 1) % n]));
  }
  return sum;
}

int orb_form_is_fine(orb_form after) {
  return after.turned == 0 && after.quality >= LEAST_QUALITY;
}

int orb_form_allows(orb_form before, orb_form after) {
  return after.turned <= before.turned &&
         (after.slivers < before.slivers || after.quality >= fmin(before.quality, LEAST_QUALITY));
}

typedef struct turned_loop {
  orb_match *match;
  unsigned char *turned; /* may be NULL */
  atomic_llong count;
} turned_loop;

/* A mark of all that the question depends on. */
static uint64_t mark_of(const orb_net *net, const int32_t *corner) {
  uint64_t mark = orb_point_mark(orb_net_point(net, corner[0])) + 3 * orb_point_mark(orb_net_point(net, corner[1])) +
                  5 * orb_point_mark(orb_net_point(net, corner[2]));
  return mark ? mark : 1;
}

static void turned_range(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  turned_loop *loop = arg;
  orb_match *match = loop->match;
  int64_t count = 0;
  for (int64_t t = begin; t < end; t++) {
    const int32_t *c = match->net.triangles + 3 * t;
    uint64_t mark = c[0] >= 0 ? mark_of(&match->net, c) : 0;
    int turned = mark != match->straight[t] && c[0] >= 0 && orb_match_is_turned(match, c[0], c[1], c[2]);
    match->straight[t] = turned ? 0 : mark;
    count += turned;
    if (loop->turned) {
      loop->turned[t] = (unsigned char)turned;
    }
  }
  atomic_fetch_add(&loop->count, count);
}

void orb_match_mark_turned(orb_context *ctx, orb_match *match, unsigned char *turned) {
  turned_loop loop = {.match = match, .turned = turned};
  orb_parallel_for(ctx, match->net.triangle_count, 256, turned_range, &loop);
}

int64_t orb_match_turned(orb_context *ctx, orb_match *match) {
  turned_loop loop = {.match = match};
  orb_parallel_for(ctx, match->net.triangle_count, 256, turned_range, &loop);
  return atomic_load(&loop.count);
}
