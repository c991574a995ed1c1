/* Places on an aligned shape as places on the mesh before, and in its file. */
#include <string.h>

#include "numeric/vec3.h"
#include "orbmorph/transfer.h"

/* A squared height below this share of the length is rounding: the triangle has no area. */
static const double NO_HEIGHT = 1e-30;

/* Barycentric coordinates of a point that lies in the triangle up to rounding. A degenerate triangle is treated as its
 * longest edge, one without extent as a single corner. */
static void barycentric(const double *const corner[3], const double p[3], double out[3]) {
  double e[3][3], d[3], length[3];
  for (int k = 0; k < 3; k++) { /* e[k] is opposite to corner k */
    for (int i = 0; i < 3; i++) {
      e[k][i] = corner[(k + 2) % 3][i] - corner[(k + 1) % 3][i];
    }
    length[k] = orb_dot(e[k], e[k]);
  }
  int longest = length[1] > length[0] ? 1 : 0;
  longest = length[2] > length[longest] ? 2 : longest;
  int a = longest, b = (longest + 1) % 3, c = (longest + 2) % 3; /* a: the corner opposite to the longest edge b–c */
  double up[3];
  for (int i = 0; i < 3; i++) {
    d[i] = p[i] - corner[b][i];
    up[i] = corner[a][i] - corner[b][i];
  }
  memset(out, 0, 3 * sizeof *out);
  if (!(length[a] > 0)) {
    out[b] = 1;
    return;
  }
  double foot = orb_dot(up, e[a]) / length[a], along = orb_dot(d, e[a]) / length[a], height = 0, over = 0;
  for (int i = 0; i < 3; i++) {
    double h = up[i] - foot * e[a][i];
    height += h * h;
    over += h * (d[i] - along * e[a][i]);
  }
  out[a] = height > NO_HEIGHT * length[a] ? over / height : 0;
  out[c] = along - out[a] * foot;
  out[b] = 1 - out[a] - out[c];
}

static void make_proper(double at[3]) {
  double sum = 0;
  for (int k = 0; k < 3; k++) {
    at[k] = at[k] > 0 ? at[k] : 0;
    sum += at[k];
  }
  if (sum > 0 && sum != 1) {
    for (int k = 0; k < 3; k++) {
      at[k] /= sum;
    }
  }
}

/* Converts a place on the aligned shape to a place on the mesh before alignment. Weights of corners that both triangles
 * share carry over exactly; other corners were added by the alignment and are located by their position. */
void orb_place_before(const orb_mesh *mesh, const orb_aligned_shape *shape, const orb_place *from, orb_place *out) {
  const double *corner[3];
  size_t parent = (size_t)shape->parent[from->triangle];
  const int32_t *old = mesh->triangles + 3 * parent;
  const int32_t *fresh = shape->mesh.triangles + 3 * (size_t)from->triangle;
  for (int k = 0; k < 3; k++) {
    corner[k] = mesh->positions + 3 * (size_t)old[k];
  }
  *out = (orb_place){.triangle = (int32_t)parent};
  for (int k = 0; k < 3; k++) {
    const double *p = shape->mesh.positions + 3 * (size_t)fresh[k];
    double at[3];
    int same = 0;
    while (same < 3 &&
           (mesh->source[old[same]] != shape->mesh.source[fresh[k]] || memcmp(corner[same], p, 3 * sizeof *p) != 0)) {
      same++;
    }
    if (same < 3) {
      out->at[same] += from->at[k];
      continue;
    }
    barycentric(corner, p, at);
    for (int i = 0; i < 3; i++) {
      out->at[i] += from->at[k] * at[i];
    }
  }
  make_proper(out->at);
}

/* A repair may have reordered a triangle's corners, so they are matched by vertex. */
void orb_place_in_file(const orb_mesh *mesh, const int32_t *corners, const orb_place *from, orb_place *out) {
  int used[3] = {0, 0, 0};
  int32_t number = mesh->source_triangle[from->triangle];
  *out = (orb_place){.triangle = -1};
  if (number < 0) {
    return;
  }
  orb_place found = {.triangle = number};
  for (int k = 0; k < 3; k++) {
    int32_t vertex = mesh->vertex_of_source[corners[3 * (size_t)number + (size_t)k]];
    int corner = 0;
    while (corner < 3 &&
           (used[corner] || vertex < 0 ||
            mesh->source[mesh->triangles[3 * (size_t)from->triangle + (size_t)corner]] != mesh->source[vertex])) {
      corner++;
    }
    if (corner == 3) {
      return;
    }
    used[corner] = 1;
    found.at[k] = from->at[corner];
  }
  *out = found;
}
