/* Searches move a vertex by a little and ask where it lies then, so a short walk finds it. The walk computes the
 * weights of a triangle's corners by the formula of orb_project(), and leaves over the edge with the least one; their
 * signs are certain where they are above the rounding. Where one is not, or the walk is long, the exact walk takes
 * over. Both find the same triangle and the same weights. */
#include "remesh/placed/pack.h"

#include "numeric/vec3.h"

enum { STEPS_MOST = 32 }; /* steps after which the exact walk takes over: more than a small move needs */
/* Above the rounding of a determinant of unit vectors: 1e-15 times their 1-norms, see orb_orient(). */
static const double CERTAIN = 3e-14;

static int walk(const orb_sphere_view *view, const orb_pack *pack, const double p[3], int32_t *triangle, double w[3]) {
  int32_t t = *triangle;
  for (int step = 0; step < STEPS_MOST; step++) {
    const int32_t *c = view->triangles + 3 * (int64_t)t;
    const double *a = pack->vertex[c[0]].point, *b = pack->vertex[c[1]].point, *d = pack->vertex[c[2]].point;
    w[0] = orb_det(p, b, d);
    w[1] = orb_det(p, d, a);
    w[2] = orb_det(p, a, b);
    int least = w[1] < w[0] ? 1 : 0;
    least = w[2] < w[least] ? 2 : least;
    if (w[least] > CERTAIN) {
      *triangle = t;
      return 1;
    }
    if (!(w[least] < -CERTAIN)) {
      return 0;
    }
    t = view->twin[3 * t + (least + 1) % 3] / 3;
  }
  return 0;
}

/* Barycentric coordinates from positive weights, as orb_project() makes them. */
static void make_place(const double w[3], orb_place *place) {
  double sum = 0;
  int largest = 0;
  for (int k = 0; k < 3; k++) {
    sum += w[k];
  }
  for (int k = 0; k < 3; k++) {
    place->at[k] = w[k] / sum;
    largest = place->at[k] > place->at[largest] ? k : largest;
  }
  place->at[largest] = 1 - (place->at[(largest + 1) % 3] + place->at[(largest + 2) % 3]);
}

int orb_pack_locate(const orb_pack *pack, const orb_sphere_view *view, const double p[3], orb_place *place) {
  double w[3];
  if (!walk(view, pack, p, &place->triangle, w)) {
    return 0;
  }
  make_place(w, place);
  return 1;
}
