/* Samples: rays from the bones, and the points where they leave a body at rest. */
#include <math.h>
#include <string.h>

#include "posed.h"

/* A ray from a place of a limb. around: its direction in the plane across the limb, to the right and backward or, on a
 * limb that points forward, down; along: how much of it follows the limb. */
typedef struct ray {
  posed_limb limb;
  double at;
  double around[2], along;
} ray;

enum { FACE_RAYS = 90, RAYS_MOST = 1400 };

/* Tips and places between them, in the order in which landmarks are given. */
static const ray first_rays[] = {
    {SNOUT, 1, {0, 0}, 1},   {FRF, 1, {0, 0}, 1},      {FLF, 1, {0, 0}, 1},      {HRF, 1, {0, 0}, 1},
    {HLF, 1, {0, 0}, 1},     {TAIL, 1, {0, 0}, 1},     {EAR_R, 1, {0, 0}, 1},    {EAR_L, 1, {0, 0}, 1},
    {FACE, 0, {0, -1}, 0},   {FACE, 0, {0, 0}, 1},     {TORSO, 0.5, {0, -1}, 0}, {TORSO, 0.5, {0, 1}, 0},
    {TORSO, 0.4, {1, 0}, 0}, {TORSO, 0.4, {-1, 0}, 0}, {HEAD, 0.5, {0, -1}, 0},  {NECK, 0.5, {0, -1}, 0},
    {FRL, 0.4, {0, -1}, 0},  {FLL, 0.4, {0, -1}, 0},   {HRL, 0.6, {0, 1}, 0},    {HLL, 0.6, {0, 1}, 0},
    {TAIL, 0.4, {0, 1}, 0},  {FRU, 0.7, {1, 0}, 0},    {FLU, 0.7, {-1, 0}, 0},   {HRU, 0.7, {1, 0}, 0},
    {HLU, 0.7, {-1, 0}, 0},  {NECK, 0.5, {1, 0}, 0},   {NECK, 0.5, {-1, 0}, 0},  {SNOUT, 0.5, {0, -1}, 0},
};

/* Tips of appendages of other plans, after those. */
static const ray plan_rays[] = {
    {LIMB_A, 1, {0, 0}, 1}, {LIMB_B, 1, {0, 0}, 1}, {LIMB_C, 1, {0, 0}, 1}, {LIMB_D, 1, {0, 0}, 1},
    {LIMB_E, 1, {0, 0}, 1}, {LIMB_F, 1, {0, 0}, 1}, {LIMB_G, 1, {0, 0}, 1}, {LIMB_H, 1, {0, 0}, 1},
};

static ray rays[RAYS_MOST];
static int ray_count;

static void add_limb(posed_limb limb) {
  static const double directions[8][2] = {{1, 0},  {0.7071, 0.7071},   {0, 1},  {-0.7071, 0.7071},
                                          {-1, 0}, {-0.7071, -0.7071}, {0, -1}, {0.7071, -0.7071}};
  const int is_ear = limb == EAR_R || limb == EAR_L, is_foot = limb == FRF || limb == FLF || limb == HRF || limb == HLF;
  const int steps = limb == TORSO ? 9 : is_ear || is_foot ? 1 : 5;
  for (int s = 0; s < steps; s++)
    for (int d = 0; d < 8; d += is_ear ? 2 : 1)
      rays[ray_count++] = (ray){limb, (s + 0.5) / steps, {directions[d][0], directions[d][1]}, 0};
}

/* Directions spread over the sphere: a spiral of equal steps in height, each rotated by about the golden angle. */
static void add_face(void) {
  double c = 1, s = 0;
  for (int i = 0; i < FACE_RAYS; i++) {
    const double height = 1 - (2.0 * i + 1) / FACE_RAYS, wide = sqrt(1 - height * height);
    rays[ray_count++] = (ray){FACE, 0, {wide * c, -height}, wide * s};
    const double next = c * -0.7373688 - s * 0.6754903;
    s = c * 0.6754903 + s * -0.7373688;
    c = next;
  }
}

/* Shuffles the rays from `first` on: any part of the list then spreads over the body. */
static void shuffle_rays(int first) {
  unsigned seed = 7;
  for (int i = ray_count - 1; i > first; i--) {
    const int j = first + (int)posed_random(&seed, (unsigned)(i - first + 1));
    const ray kept = rays[i];
    rays[i] = rays[j];
    rays[j] = kept;
  }
}

static void add_rays(const ray *list, size_t size) {
  memcpy(rays + ray_count, list, size);
  ray_count += (int)(size / sizeof *list);
}

/* Rays of other plans come after the first rays and after all others: then the places that are measured on animals do
 * not depend on them. */
static void list_rays(void) {
  if (ray_count)
    return;
  add_rays(first_rays, sizeof first_rays);
  add_rays(plan_rays, sizeof plan_rays);
  int first = ray_count;
  for (int limb = TORSO; limb < FACE; limb++)
    add_limb((posed_limb)limb);
  add_face();
  shuffle_rays(first);
  first = ray_count;
  for (int limb = LIMB_A; limb < LIMB_COUNT; limb++)
    add_limb((posed_limb)limb);
  shuffle_rays(first);
}

int posed_sample_count(void) {
  list_rays();
  return ray_count;
}

const char *posed_sample_part(int sample) {
  static const char *const names[LIMB_COUNT] = {
      "none",  "torso",  "neck",   "head",   "snout",  "tail",   "ear.R",  "ear.L",  "arm.R", "arm.R", "arm.R",
      "arm.L", "arm.L",  "arm.L",  "leg.R",  "leg.R",  "leg.R",  "leg.R",  "leg.L",  "leg.L", "leg.L", "leg.L",
      "face",  "limb.A", "limb.B", "limb.C", "limb.D", "limb.E", "limb.F", "limb.G", "limb.H"};
  list_rays();
  return names[rays[sample].limb];
}

static double length(const double v[3]) {
  return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

static double axis_length(const orb_primitive *o) {
  const double v[3] = {o->b[0] - o->a[0], o->b[1] - o->a[1], o->b[2] - o->a[2]};
  return length(v);
}

/* The bone of a limb at a share of the limb's length, and the share of that bone; −1: there is no such limb. */
static int bone_at(const posed_rest *rest, posed_limb limb, double at, double *share) {
  const int count = (int)rest->animal.primitive_count;
  double whole = 0, done = 0;
  int last = -1;
  for (int i = 0; i < count; i++)
    if (rest->kind->bones[i].limb == limb)
      whole += axis_length(&rest->primitives[i]);
  for (int i = 0; i < count; i++)
    if (rest->kind->bones[i].limb == limb) {
      const double own = axis_length(&rest->primitives[i]);
      last = i;
      *share = own > 0 ? fmin(1, (at * whole - done) / own) : 0;
      if (at * whole <= done + own + 1e-12)
        return i;
      done += own;
    }
  return last;
}

/* Three axes of a bone: right, back or down, along. The first axis of an ear, or of an appendage of another
 * plan, is forward, since these point to the side. */
static void frame_of(const orb_primitive *o, posed_limb limb, double frame[3][3]) {
  static const double face[3][3] = {{0, 0, 1}, {0, -1, 0}, {1, 0, 0}};
  if (limb == FACE) {
    memcpy(frame, face, sizeof face);
    return;
  }
  const int is_ear = limb == EAR_R || limb == EAR_L || limb >= LIMB_A;
  double *right = frame[0], *back = frame[1], *along = frame[2], size = 0, part;
  for (int k = 0; k < 3; k++) {
    along[k] = o->kind == SAMPLE_CONE ? o->b[k] - o->a[k] : o->axis[0][k] + 1.3 * o->axis[1][k];
    right[k] = is_ear ? k == 0 : k == 2;
  }
  size = length(along);
  for (int k = 0; k < 3; k++)
    along[k] /= size;
  part = along[is_ear ? 0 : 2];
  for (int k = 0; k < 3; k++)
    right[k] -= part * along[k];
  size = length(right);
  for (int k = 0; k < 3; k++)
    right[k] /= size;
  for (int k = 0; k < 3; k++)
    back[k] = along[(k + 1) % 3] * right[(k + 2) % 3] - along[(k + 2) % 3] * right[(k + 1) % 3];
}

/* Where a ray leaves the body; 0 if the body lacks the limb, or another limb is there. */
static int leave(const posed_rest *rest, const ray *r, double out[3]) {
  double share = 0, frame[3][3], d[3], p[3], step = 0.005, inside = 0, outside;
  const int bone = bone_at(rest, r->limb, r->at, &share), is_tip = r->along > 0 && r->limb != FACE;
  if (bone < 0)
    return 0;
  const orb_primitive *o = &rest->primitives[bone];
  frame_of(o, r->limb, frame);
  for (int k = 0; k < 3; k++) {
    d[k] = r->around[0] * frame[0][k] + r->around[1] * frame[1][k] + r->along * frame[2][k];
    p[k] = o->kind == SAMPLE_CONE ? o->a[k] + share * (o->b[k] - o->a[k]) : o->a[k];
  }
  const double size = length(d), far = o->kind == SAMPLE_CONE ? 2 * fmax(o->ra, o->rb) + 0.05 : 2;
  for (outside = 0; outside < far; outside += step) {
    for (int k = 0; k < 3; k++)
      out[k] = p[k] + outside * d[k] / size;
    if (sample_field(&rest->animal, out) > 0)
      break;
    inside = outside;
  }
  if (outside >= far)
    return 0;
  for (int i = 0; i < 40; i++) {
    const double middle = 0.5 * (inside + outside);
    for (int k = 0; k < 3; k++)
      out[k] = p[k] + middle * d[k] / size;
    if (sample_field(&rest->animal, out) > 0)
      outside = middle;
    else
      inside = middle;
  }
  int nearest = 0;
  for (int i = 0; i < (int)rest->animal.primitive_count; i++)
    if (sample_distance(&rest->primitives[i], out) < sample_distance(&rest->primitives[nearest], out))
      nearest = i;
  return is_tip || rest->kind->bones[nearest].limb == r->limb;
}

static double dot(const double a[3], const double b[3]) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* The square of the distance from p to a triangle, and the weights of its nearest point: of the plane's point if that
 * is inside, else of the nearest point of an edge. */
static double nearest_on(const double *a, const double *b, const double *c, const double p[3], double at[3]) {
  const double *corner[3] = {a, b, c};
  double u[3], w[3], q[3], best = 1e30;
  for (int k = 0; k < 3; k++) {
    u[k] = b[k] - a[k];
    w[k] = c[k] - a[k];
    q[k] = p[k] - a[k];
  }
  const double uu = dot(u, u), uw = dot(u, w), ww = dot(w, w), qu = dot(q, u), qw = dot(q, w), det = uu * ww - uw * uw;
  const double s = (qu * ww - qw * uw) / det, t = (qw * uu - qu * uw) / det;
  if (det > 0 && s >= 0 && t >= 0 && s + t <= 1) {
    at[0] = 1 - s - t;
    at[1] = s;
    at[2] = t;
    for (int k = 0; k < 3; k++)
      q[k] -= s * u[k] + t * w[k];
    return dot(q, q);
  }
  for (int i = 0; i < 3; i++) {
    const double *from = corner[i], *to = corner[(i + 1) % 3];
    double along = 0, whole = 0, gap = 0;
    for (int k = 0; k < 3; k++) {
      along += (to[k] - from[k]) * (p[k] - from[k]);
      whole += (to[k] - from[k]) * (to[k] - from[k]);
    }
    const double x = whole > 0 ? fmax(0, fmin(1, along / whole)) : 0;
    for (int k = 0; k < 3; k++) {
      const double away = from[k] + x * (to[k] - from[k]) - p[k];
      gap += away * away;
    }
    if (gap < best) {
      best = gap;
      at[i] = 1 - x;
      at[(i + 1) % 3] = x;
      at[(i + 2) % 3] = 0;
    }
  }
  return best;
}

void posed_find_places(const posed_rest *rest, const orb_sample *mesh, posed_place *out) {
  list_rays();
  for (int i = 0; i < ray_count; i++) {
    double p[3], at[3], best = 1e30;
    out[i].triangle = -1;
    if (!leave(rest, &rays[i], p))
      continue;
    for (int t = 0; t < mesh->triangle_count; t++) {
      const int *v = &mesh->triangles[3 * t];
      const double gap =
          nearest_on(&mesh->positions[3 * v[0]], &mesh->positions[3 * v[1]], &mesh->positions[3 * v[2]], p, at);
      if (gap < best) {
        best = gap;
        out[i].triangle = t;
        memcpy(out[i].at, at, sizeof at);
      }
    }
    if (best > 0.02 * 0.02)
      out[i].triangle = -1;
  }
}
