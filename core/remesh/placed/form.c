#include "remesh/placed/form.h"

#include <math.h>
#include <stdatomic.h>

#include "base/parallel.h"
#include "numeric/vec3.h"
#include "remesh/placed/marks.h"

/* Below this quality (1: equilateral, 0: degenerate) a triangle counts as a sliver. Higher counts more triangles that
 * the shape itself requires, lower lets thinner ones pass. */
static const double FINE_QUALITY = 0.12;
/* Below this facing (the cosine of the angle to the mean normal, times that normal's length) a triangle counts as
 * inverted: a little above 0, so that nearly inverted ones are repaired too. */
static const double FINE_FACING = 0.05;
/* Slivers of at least this quality are acceptable in place of any others: higher blocks collapses, lower leaves thinner
 * triangles in the result. */
static const double LEAST_QUALITY = 0.02;
/* From this facing on, the centre is not located: lower saves time but misses triangles inverted only at the centre. */
static const double SURE_FACING = 0.9;

/* A triangle on one shape: its normal, as long as twice its area, against the sum of the shape's smooth normals at its
 * corners. */
typedef struct pose {
  double edges; /* sum of the squared edge lengths */
  double area2; /* squared length of the normal */
  double along; /* dot product of the normal and the sum */
} pose;

static inline pose pose_of(const orb_placed_net *placed, int32_t s, int32_t a, int32_t b, int32_t c) {
  double u[3], v[3], n[3], ground[3];
  const double *p = orb_placed_position(placed, a, s), *q = orb_placed_position(placed, b, s),
               *r = orb_placed_position(placed, c, s);
  orb_sub(q, p, u);
  orb_sub(r, p, v);
  orb_cross(u, v, n);
  for (int k = 0; k < 3; k++) {
    ground[k] =
        orb_placed_normal(placed, a, s)[k] + orb_placed_normal(placed, b, s)[k] + orb_placed_normal(placed, c, s)[k];
  }
  return (pose){orb_dot(u, u) + orb_dot(v, v) + orb_distance2(q, r), orb_dot(n, n), orb_dot(n, ground)};
}

/* Whether the facing, along / (3 |normal|), is below a positive number, without a square root. */
static inline int faces_less(pose at, double facing) {
  return at.along <= 0 || at.along * at.along < 9 * facing * facing * at.area2;
}

void orb_placed_form_on(const orb_placed_net *placed, int32_t s, int32_t a, int32_t b, int32_t c,
                        orb_form_squares *least) {
  pose at = pose_of(placed, s, a, b, c);
  double q = at.edges > 0 ? 12 * at.area2 / (at.edges * at.edges) : 0;
  double f = at.area2 > 0 ? at.along * fabs(at.along) / (9 * at.area2) : 0;
  least->quality = q < least->quality ? q : least->quality;
  least->facing = f < least->facing ? f : least->facing;
}

orb_form orb_form_of(orb_form_squares least) {
  orb_form worst = {sqrt(least.quality), least.facing < 0 ? -sqrt(-least.facing) : sqrt(least.facing), 0, 0};
  worst.slivers = worst.quality < FINE_QUALITY;
  worst.inverted = worst.facing < FINE_FACING;
  return worst;
}

orb_form orb_placed_form(const orb_placed_net *placed, int32_t a, int32_t b, int32_t c) {
  orb_form_squares least = {1, 1};
  for (int32_t s = 0; s < placed->shape_count; s++) {
    orb_placed_form_on(placed, s, a, b, c, &least);
  }
  return orb_form_of(least);
}

/* Against the shape's flat and smooth normals at the place of the triangle's centre on the sphere. */
static int is_inverted_at_centre(const orb_placed_net *placed, int32_t s, int32_t a, int32_t b, int32_t c) {
  const int32_t corner[3] = {a, b, c};
  double centre[3] = {0, 0, 0}, u[3], v[3], n[3], flat[3], smooth[3] = {0, 0, 0};
  for (int i = 0; i < 9; i++) {
    centre[i % 3] += orb_net_point(&placed->net, corner[i / 3])[i % 3];
  }
  (void)orb_normalize(centre);
  orb_place place;
  orb_locate(placed->job->locator[s], centre, placed->spot[(int64_t)a * placed->shape_count + s].h / 3, &place);
  const int32_t *on = placed->view[s].triangles + 3 * (int64_t)place.triangle;
  for (int i = 0; i < 9; i++) {
    smooth[i % 3] += place.at[i / 3] * placed->vertex_normal[s][3 * (int64_t)on[i / 3] + i % 3];
  }
  const double *p = orb_placed_position(placed, a, s), *q = placed->position[s] + 3 * (int64_t)on[0];
  orb_sub(placed->position[s] + 3 * (int64_t)on[1], q, u);
  orb_sub(placed->position[s] + 3 * (int64_t)on[2], q, v);
  orb_cross(u, v, flat);
  orb_sub(orb_placed_position(placed, b, s), p, u);
  orb_sub(orb_placed_position(placed, c, s), p, v);
  orb_cross(u, v, n);
  return orb_dot(n, smooth) <= 0 || orb_dot(n, flat) < 0;
}

static double inverted_extent(const orb_placed_net *placed, int32_t a, int32_t b, int32_t c, int by_centre) {
  double extent = 0;
  for (int32_t s = 0; s < placed->shape_count; s++) {
    pose at = pose_of(placed, s, a, b, c);
    if (faces_less(at, FINE_FACING) ||
        (by_centre && faces_less(at, SURE_FACING) && is_inverted_at_centre(placed, s, a, b, c))) {
      extent += at.edges + 1e-200; /* above 0 even for a triangle without size */
    }
  }
  return extent;
}

double orb_placed_inverted_extent(const orb_placed_net *placed, int32_t a, int32_t b, int32_t c) {
  return inverted_extent(placed, a, b, c, 1);
}

int orb_placed_is_inverted(const orb_placed_net *placed, int32_t a, int32_t b, int32_t c) {
  return inverted_extent(placed, a, b, c, 1) > 0;
}

double orb_placed_inverted_by_corners(const orb_placed_net *placed, int32_t a, int32_t b, int32_t c) {
  return inverted_extent(placed, a, b, c, 0);
}

orb_tally orb_placed_tally_fan(const orb_placed_net *placed, int32_t v, const int32_t *ring, int n, int closed) {
  orb_tally sum = {0, 0};
  for (int i = 0; i + 1 < n + closed; i++) {
    orb_tally_add(&sum, orb_placed_inverted_extent(placed, v, ring[i], ring[(i + 1) % n]));
  }
  return sum;
}

int orb_form_is_fine(orb_form after) {
  return after.inverted == 0 && after.quality >= LEAST_QUALITY;
}

int orb_form_allows(orb_form before, orb_form after) {
  return after.inverted <= before.inverted &&
         (after.slivers < before.slivers || after.quality >= fmin(before.quality, LEAST_QUALITY));
}

typedef struct inverted_loop {
  orb_placed_net *placed;
  unsigned char *inverted; /* may be NULL */
  atomic_llong count;
} inverted_loop;

/* A mark of all that the answer depends on: the points of the corners. */
static uint64_t mark_of(const orb_net *net, const int32_t *corner) {
  uint64_t mark = orb_mark_of_point(orb_net_point(net, corner[0])) +
                  3 * orb_mark_of_point(orb_net_point(net, corner[1])) +
                  5 * orb_mark_of_point(orb_net_point(net, corner[2]));
  return mark ? mark : 1;
}

static void inverted_range(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  inverted_loop *loop = arg;
  orb_placed_net *placed = loop->placed;
  int64_t count = 0;
  for (int64_t t = begin; t < end; t++) {
    const int32_t *c = placed->net.triangles + 3 * t;
    uint64_t mark = c[0] >= 0 ? mark_of(&placed->net, c) : 0;
    int inverted = mark != placed->not_inverted[t] && c[0] >= 0 && orb_placed_is_inverted(placed, c[0], c[1], c[2]);
    placed->not_inverted[t] = inverted ? 0 : mark;
    count += inverted;
    if (loop->inverted) {
      loop->inverted[t] = (unsigned char)inverted;
    }
  }
  atomic_fetch_add(&loop->count, count);
}

void orb_placed_mark_inverted(orb_context *ctx, orb_placed_net *placed, unsigned char *inverted) {
  inverted_loop loop = {.placed = placed, .inverted = inverted};
  orb_parallel_for(ctx, placed->net.triangle_count, 256, inverted_range, &loop);
}

int64_t orb_placed_count_inverted(orb_context *ctx, orb_placed_net *placed) {
  inverted_loop loop = {.placed = placed};
  orb_parallel_for(ctx, placed->net.triangle_count, 256, inverted_range, &loop);
  return atomic_load(&loop.count);
}
