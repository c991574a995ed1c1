#include "sphere/walk.h"

#include "base/check.h"
#include "numeric/predicates.h"
#include "numeric/vec3.h"

static const double *corner(const orb_sphere_view *mesh, int32_t h) {
  return mesh->points + 3 * (int64_t)mesh->triangles[h];
}

static int side_of(const orb_sphere_view *mesh, int32_t t, int k, const double p[3]) {
  return orb_orient(corner(mesh, 3 * t + k), corner(mesh, 3 * t + (k + 1) % 3), p);
}

/* The last resort, O(F): correct for every triangulation. */
static orb_hit search_all(const orb_sphere_view *mesh, const double p[3]) {
  for (int32_t t = 0; t < mesh->triangle_count; t++) {
    if (mesh->triangles[3 * t] < 0) {
      continue;
    }
    orb_hit hit = {t, {side_of(mesh, t, 0, p), 0, 0}};
    if (hit.side[0] >= 0 && (hit.side[1] = side_of(mesh, t, 1, p)) >= 0 &&
        (hit.side[2] = side_of(mesh, t, 2, p)) >= 0) {
      return hit;
    }
  }
  ORB_ASSERT(0 && "a certified triangulation covers every direction");
  return (orb_hit){-1, {0, 0, 0}};
}

orb_hit orb_walk(const orb_sphere_view *mesh, const double p[3], int32_t start) {
  int32_t t = start, from = -1;
  uint32_t random = 0x9E3779B9u;
  for (int64_t step = 0; step <= (int64_t)mesh->triangle_count + 64; step++) {
    orb_hit hit = {t, {1, 1, 1}};
    random = random * 1664525u + 1013904223u;
    int first = (int)((random >> 16) % 3), leave = -1;
    for (int i = 0; i < 3 && leave < 0; i++) {
      int k = (first + i) % 3;
      if (3 * t + k == from) {
        continue; /* just crossed: p is strictly on this side */
      }
      hit.side[k] = side_of(mesh, t, k, p);
      if (hit.side[k] < 0) {
        leave = k;
      }
    }
    if (leave < 0) {
      return hit;
    }
    from = mesh->twin[3 * t + leave];
    t = from / 3;
  }
  return search_all(mesh, p);
}

int orb_hit_corner(const orb_hit *hit) {
  for (int k = 0; k < 3; k++) {
    if (hit->side[k] == 0 && hit->side[(k + 2) % 3] == 0) {
      return k;
    }
  }
  return -1;
}

int32_t orb_hit_edge(const orb_hit *hit) {
  if (orb_hit_corner(hit) >= 0) {
    return -1;
  }
  for (int k = 0; k < 3; k++) {
    if (hit->side[k] == 0) {
      return 3 * hit->triangle + k;
    }
  }
  return -1;
}

void orb_project(const orb_sphere_view *mesh, const orb_hit *hit, const double p[3], double at[3]) {
  int k = orb_hit_corner(hit);
  if (k >= 0) {
    at[0] = at[1] = at[2] = 0;
    at[k] = 1;
    return;
  }
  double sum = 0;
  for (k = 0; k < 3; k++) {
    int32_t opposite = 3 * hit->triangle + (k + 1) % 3; /* the edge that faces corner k */
    double weight = 0;
    if (hit->side[(k + 1) % 3] != 0) {
      weight = orb_det(p, corner(mesh, opposite), corner(mesh, 3 * hit->triangle + (k + 2) % 3));
    }
    at[k] = weight > 0 ? weight : 0;
    sum += at[k];
  }
  if (!(sum > 0)) { /* rounding has lost every weight: take the nearest corner */
    int best = 0;
    for (k = 1; k < 3; k++) {
      if (orb_distance2(p, corner(mesh, 3 * hit->triangle + k)) <
          orb_distance2(p, corner(mesh, 3 * hit->triangle + best))) {
        best = k;
      }
    }
    at[best] = sum = 1;
  }
  int largest = 0;
  for (k = 0; k < 3; k++) {
    at[k] /= sum;
    largest = at[k] > at[largest] ? k : largest;
  }
  at[largest] = 1 - (at[(largest + 1) % 3] + at[(largest + 2) % 3]);
}
