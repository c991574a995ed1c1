/* The collapse of a vertex onto a neighbour, with its star. */
#include "align/sheet/collapse.h"

#include <math.h>
#include <string.h>

#include "numeric/predicates.h"
#include "numeric/vec3.h"

/* The coordinates of a vertex in a given triangle; 0: it lies elsewhere. */
static int place_in(const orb_sheet *s, int32_t v, int32_t parent, double out[3]) {
  const int32_t *corner = s->given + 3 * (size_t)parent;
  out[0] = out[1] = out[2] = 0;
  if (v < s->given_vertices) {
    for (int k = 0; k < 3; k++) {
      if (corner[k] == v) {
        out[k] = 1;
        return 1;
      }
    }
    return 0;
  }
  const orb_origin *o = &s->origin[v - s->given_vertices];
  for (int i = 0; i < 3 && o->vertex[i] >= 0; i++) {
    int k = 0;
    while (k < 3 && corner[k] != o->vertex[i]) {
      k++;
    }
    if (k == 3) {
      return 0;
    }
    out[k] += o->weight[i];
  }
  return 1;
}

double orb_fatness(const double a[3], const double b[3], const double c[3]) {
  double ab = orb_distance2(a, b), bc = orb_distance2(b, c), ca = orb_distance2(c, a);
  double longest = ab > bc ? ab : bc;
  longest = longest > ca ? longest : ca;
  return orb_det(a, b, c) / (longest + ORB_TINY);
}

static const double *point_of(const orb_sheet *s, int32_t v) {
  return s->shape.points + 3 * (size_t)v;
}

int orb_star_read(const orb_sheet *s, int32_t v, int32_t star[ORB_STAR_MAX]) {
  int count = 0;
  int32_t h = s->corner[v];
  do {
    if (count == ORB_STAR_MAX) {
      return 0;
    }
    star[count++] = h;
    h = orb_sheet_swing(s, h);
  } while (h != s->corner[v]);
  return count;
}

int orb_star_link_is_clean(const orb_sheet *s, const int32_t *star, int count, int32_t u) {
  const int32_t *tri = s->shape.mesh.triangles;
  int common = 0, valence = 0;
  int32_t start = s->corner[u], h = start;
  do {
    int32_t w = tri[orb_next(h)];
    for (int i = 0; i < count; i++) {
      common += tri[orb_next(star[i])] == w;
    }
    h = orb_sheet_swing(s, h);
    valence++;
  } while (h != start);
  return common == 2 && valence + count - 4 <= ORB_STAR_MAX;
}

double orb_star_fatness_at(const orb_sheet *s, const int32_t *star, int count, int32_t u) {
  const int32_t *tri = s->shape.mesh.triangles;
  double least = INFINITY;
  for (int i = 0; i < count; i++) {
    int32_t a = tri[orb_next(star[i])], b = tri[orb_prev(star[i])], parent = s->shape.parent[star[i] / 3];
    double in_parent[3][3];
    if (a == u || b == u) {
      continue;
    }
    if (orb_orient(point_of(s, u), point_of(s, a), point_of(s, b)) <= 0) {
      return 0;
    }
    if (!place_in(s, u, parent, in_parent[0]) || !place_in(s, a, parent, in_parent[1]) ||
        !place_in(s, b, parent, in_parent[2]) || orb_orient(in_parent[0], in_parent[1], in_parent[2]) <= 0) {
      return 0;
    }
    double fat = orb_fatness(point_of(s, u), point_of(s, a), point_of(s, b));
    least = fat < least ? fat : least;
  }
  return least;
}

void orb_corner_copy(orb_mesh *mesh, int32_t from, int32_t to) {
  if (mesh->normals) {
    memcpy(mesh->normals + 3 * (size_t)to, mesh->normals + 3 * (size_t)from, 3 * sizeof(float));
  }
  if (mesh->texcoords) {
    memcpy(mesh->texcoords + 2 * (size_t)to, mesh->texcoords + 2 * (size_t)from, 2 * sizeof(float));
  }
  if (mesh->colors) {
    memcpy(mesh->colors + 4 * (size_t)to, mesh->colors + 4 * (size_t)from, 4 * sizeof(float));
  }
}

static void link(orb_sheet *s, int32_t g, int32_t h) {
  s->twin[g] = h;
  s->twin[h] = g;
}

void orb_star_collapse(orb_sheet *s, int32_t h, const int32_t *star, int count) {
  orb_mesh *mesh = &s->shape.mesh;
  int32_t g = s->twin[h], u = mesh->triangles[g];
  int32_t far[2] = {mesh->triangles[orb_prev(h)], mesh->triangles[orb_prev(g)]};
  int32_t into[2] = {s->twin[orb_next(h)], s->twin[orb_next(g)]},
          from[2] = {s->twin[orb_prev(h)], s->twin[orb_prev(g)]};
  for (int i = 0; i < count; i++) {
    if (star[i] / 3 != h / 3 && star[i] / 3 != g / 3) {
      int left = s->shape.parent[star[i] / 3] == s->shape.parent[h / 3];
      orb_corner_copy(mesh, left ? orb_next(h) : g, star[i]);
      mesh->triangles[star[i]] = u;
    }
  }
  link(s, into[0], from[0]);
  link(s, into[1], from[1]);
  s->corner[far[0]] = into[0]; /* from the far vertex to u */
  s->corner[far[1]] = into[1];
  s->corner[u] = from[0];
}
