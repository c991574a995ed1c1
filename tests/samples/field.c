/* Implicit surfaces: round cones and ellipsoids under a polynomial smooth union. */
#include <math.h>

#include "sample.h"

static double dot(const double a[3], const double b[3]) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* The exact distance to the hull of two balls, after Quilez. */
static double cone(const orb_primitive *o, const double p[3]) {
  double ba[3], pa[3];
  for (int k = 0; k < 3; k++) {
    ba[k] = o->b[k] - o->a[k];
    pa[k] = p[k] - o->a[k];
  }
  double l2 = dot(ba, ba), rr = o->ra - o->rb, a2 = l2 - rr * rr, il2 = 1 / l2, y = dot(pa, ba), z = y - l2;
  double x[3];
  for (int k = 0; k < 3; k++)
    x[k] = pa[k] * l2 - ba[k] * y;
  double x2 = dot(x, x), y2 = y * y * l2, z2 = z * z * l2, k = (rr < 0 ? -1 : 1) * rr * rr * x2;
  if ((z < 0 ? -1 : 1) * a2 * z2 > k)
    return sqrt(x2 + z2) * il2 - o->rb;
  if ((y < 0 ? -1 : 1) * a2 * y2 < k)
    return sqrt(x2 + y2) * il2 - o->ra;
  return (sqrt(x2 * a2 * il2) + y * rr) * il2 - o->ra;
}

/* A first-order distance to an ellipsoid. */
static double ellipsoid(const orb_primitive *o, const double p[3]) {
  double d[3], normal[3] = {0, 0, 0}, k0 = 0;
  for (int k = 0; k < 3; k++)
    d[k] = p[k] - o->a[k];
  for (int i = 0; i < 3; i++) {
    double u = dot(d, o->axis[i]) / dot(o->axis[i], o->axis[i]);
    k0 += u * u;
    for (int k = 0; k < 3; k++)
      normal[k] += u * o->axis[i][k] / dot(o->axis[i], o->axis[i]);
  }
  k0 = sqrt(k0);
  double k1 = sqrt(dot(normal, normal));
  if (k1 < 1e-9)
    return -sqrt(dot(o->axis[2], o->axis[2]));
  return k0 * (k0 - 1) / k1;
}

static double smooth_union(double a, double b, double blend) {
  double low = a < b ? a : b, gap = fabs(a - b);
  if (gap >= blend)
    return low;
  double h = (blend - gap) / blend;
  return low - h * h * blend / 4;
}

double sample_distance(const orb_primitive *primitive, const double p[3]) {
  return primitive->kind == SAMPLE_CONE ? cone(primitive, p) : ellipsoid(primitive, p);
}

/* The end of the part that begins at a primitive. */
static size_t part_end(const orb_animal *animal, size_t from) {
  size_t end = from + 1;
  while (end < animal->primitive_count && !animal->primitives[end].begins_part)
    end++;
  return end;
}

static double part_field(const orb_animal *animal, size_t from, size_t end, const double p[3]) {
  double part = sample_distance(&animal->primitives[from], p);
  for (size_t i = from + 1; i < end; i++)
    part = smooth_union(part, sample_distance(&animal->primitives[i], p), animal->primitives[i].blend);
  return part;
}

/* Which parts the field near a place depends on. Distances change by no more than places do, and a union of parts
 * blends only what is nearly as near. So a part that is far from a place where another one is near adds nothing around
 * it. Its files have the same bytes as if no part were left out; `samples.same` compares those of the repository.
 * Distances to ellipsoids are of first order, so their parts always count. */
enum { PARTS_MOST = 64 };

typedef struct vicinity {
  double middle[3];
  unsigned char skips[PARTS_MOST];
} vicinity;

static const double VICINITY = 0.025; /* its radius, in units of the sample */
/* By how much farther than the nearest part a part that is left out is: twice the widest blend of a part, and four
 * radii where two would do. */
static const double FARTHER = 0.4;

static double field_in(const orb_animal *animal, const vicinity *near, const double p[3]) {
  double whole = 1e9;
  int part = 0;
  for (size_t from = 0, end; from < animal->primitive_count; from = end, part++) {
    end = part_end(animal, from);
    if (part >= PARTS_MOST || !near->skips[part])
      whole = smooth_union(whole, part_field(animal, from, end, p), animal->primitives[from].blend);
  }
  return whole;
}

double sample_field(const orb_animal *animal, const double p[3]) {
  const vicinity all = {.skips = {0}};
  return field_in(animal, &all, p);
}

static int has_ellipsoid(const orb_animal *animal, size_t from, size_t end) {
  for (size_t i = from; i < end; i++)
    if (animal->primitives[i].kind == SAMPLE_ELLIPSOID)
      return 1;
  return 0;
}

static void find_vicinity(const orb_animal *animal, const double p[3], vicinity *out) {
  double value[PARTS_MOST], least = 1e9;
  int part = 0;
  for (int k = 0; k < 3; k++)
    out->middle[k] = p[k];
  for (size_t from = 0, end; from < animal->primitive_count && part < PARTS_MOST; from = end, part++) {
    end = part_end(animal, from);
    value[part] = -1e9;
    if (!has_ellipsoid(animal, from, end)) {
      value[part] = part_field(animal, from, end, p);
      least = value[part] < least ? value[part] : least;
    }
  }
  for (int i = 0; i < part; i++)
    out->skips[i] = value[i] > least + FARTHER;
}

static int is_outside(const vicinity *near, const double p[3]) {
  double d[3];
  for (int k = 0; k < 3; k++)
    d[k] = p[k] - near->middle[k];
  return dot(d, d) > VICINITY * VICINITY;
}

static void gradient_in(const orb_animal *animal, const vicinity *near, const double p[3], double out[3]) {
  const double step = 1e-4;
  for (int k = 0; k < 3; k++) {
    double q[3] = {p[0], p[1], p[2]};
    q[k] = p[k] + step;
    double above = field_in(animal, near, q);
    q[k] = p[k] - step;
    out[k] = (above - field_in(animal, near, q)) / (2 * step);
  }
}

void sample_gradient(const orb_animal *animal, const double p[3], double out[3]) {
  vicinity near;
  find_vicinity(animal, p, &near);
  gradient_in(animal, &near, p, out);
}

void sample_project(const orb_animal *animal, double p[3]) {
  vicinity near;
  find_vicinity(animal, p, &near);
  for (int round = 0; round < 6; round++) {
    if (is_outside(&near, p))
      find_vicinity(animal, p, &near);
    double gradient[3], f = field_in(animal, &near, p);
    gradient_in(animal, &near, p, gradient);
    double g2 = dot(gradient, gradient);
    if (g2 < 1e-4)
      return;
    for (int k = 0; k < 3; k++)
      p[k] -= f * gradient[k] / g2;
  }
}

int sample_feature_vertex(const orb_animal *animal, const orb_sample *mesh, const orb_feature *feature) {
  double length = sqrt(dot(feature->direction, feature->direction)), leaves[3] = {0, 0, 0};
  for (int i = 0, inside = 1; inside; i++) {
    double p[3];
    for (int k = 0; k < 3; k++)
      p[k] = feature->from[k] + feature->direction[k] / length * 5e-4 * i;
    inside = sample_field(animal, p) < 0;
    for (int k = 0; k < 3; k++)
      leaves[k] = p[k];
  }
  int best = 0;
  double least = 1e18;
  for (int v = 0; v < mesh->vertex_count; v++) {
    double d[3];
    for (int k = 0; k < 3; k++)
      d[k] = mesh->positions[3 * v + k] - leaves[k];
    if (dot(d, d) < least) {
      least = dot(d, d);
      best = v;
    }
  }
  return best;
}
