/* Straightens paths as soon as they are laid.
 *
 * A path crosses every edge in its way, including those that earlier splits left within a given triangle, and each
 * crossing adds a vertex and two triangles. Of paths that run side by side, each would cross half as many edges again
 * as the one before it. So a vertex of the path within a given triangle is collapsed along the path if that changes no
 * shape. Mostly the crossings of edges of the given mesh remain, and the sheet grows by the same number from path to
 * path.
 */
#include <math.h>
#include <string.h>

#include "align/pin/straighten.h"
#include "align/sheet/collapse.h"

/* Chosen by trial. */
enum { PASSES = 2 };              /* over the new vertices */
static const double LEAST = 1e-3; /* fatness on the sphere, see orb_fatness(): a collapse must leave more */

static void move_triangle(orb_sheet *s, orb_paths *paths, int32_t from, int32_t to) {
  orb_mesh *mesh = &s->shape.mesh;
  for (int k = 0; k < 3; k++) {
    int32_t h = 3 * from + k, g = 3 * to + k, v = mesh->triangles[h];
    mesh->triangles[g] = v;
    s->twin[g] = s->twin[h];
    s->twin[s->twin[h]] = g;
    s->corner[v] = s->corner[v] == h ? g : s->corner[v];
    paths->path[g] = paths->path[h];
    orb_corner_copy(mesh, h, g);
  }
  s->shape.parent[to] = s->shape.parent[from];
  if (mesh->material) {
    mesh->material[to] = mesh->material[from];
  }
  if (mesh->source_triangle) {
    mesh->source_triangle[to] = mesh->source_triangle[from];
  }
}

/* The last triangle takes its place; the half-edges behind the end get no path. */
static void remove_triangle(orb_sheet *s, orb_paths *paths, int32_t t) {
  int32_t last = --s->shape.mesh.triangle_count;
  if (t != last) {
    move_triangle(s, paths, last, t);
  }
  for (int k = 0; k < 3; k++) {
    paths->path[3 * last + k] = -1;
  }
}

static void remove_vertex(orb_sheet *s, orb_paths *paths, int32_t v) {
  orb_mesh *mesh = &s->shape.mesh;
  int32_t last = --mesh->vertex_count;
  if (v != last) {
    int32_t start = s->corner[last], h = start;
    do {
      mesh->triangles[h] = v;
      h = orb_sheet_swing(s, h);
    } while (h != start);
    s->corner[v] = start;
    memcpy(mesh->positions + 3 * (size_t)v, mesh->positions + 3 * (size_t)last, 3 * sizeof(double));
    memcpy(s->shape.points + 3 * (size_t)v, s->shape.points + 3 * (size_t)last, 3 * sizeof(double));
    s->origin[v - s->given_vertices] = s->origin[last - s->given_vertices];
    paths->on[v] = paths->on[last];
    if (mesh->source) {
      mesh->source[v] = mesh->source[last];
    }
  }
  paths->on[last] = 0;
}

/* May half-edge h, on a path, collapse onto its end? Two edges that merge take the name of the one on a path, so they
 * must not both lie on paths. */
static int names_agree(const orb_sheet *s, const orb_paths *paths, int32_t h) {
  int32_t side[2] = {h, s->twin[h]};
  for (int k = 0; k < 2; k++) {
    if (paths->path[orb_next(side[k])] >= 0 && paths->path[orb_prev(side[k])] >= 0) {
      return 0;
    }
  }
  return 1;
}

static void collapse(orb_sheet *s, orb_paths *paths, int32_t h, const int32_t *star, int count) {
  int32_t g = s->twin[h], v = s->shape.mesh.triangles[h], side[2] = {h, g};
  for (int k = 0; k < 2; k++) {
    int32_t a = orb_next(side[k]), b = orb_prev(side[k]), name = paths->path[a] >= 0 ? paths->path[a] : paths->path[b];
    paths->path[s->twin[a]] = paths->path[s->twin[b]] = name;
  }
  orb_star_collapse(s, h, star, count);
  int32_t low = h / 3 < g / 3 ? h / 3 : g / 3, high = h / 3 + g / 3 - low;
  remove_triangle(s, paths, high);
  remove_triangle(s, paths, low);
  remove_vertex(s, paths, v);
}

static int straighten_at(orb_sheet *s, orb_paths *paths, int32_t v) {
  int32_t star[ORB_STAR_MAX], best = -1;
  int count = orb_star_read(s, v, star), ways = 0;
  double top = LEAST;
  for (int i = 0; i < count; i++) {
    if (paths->path[star[i]] < 0) {
      continue;
    }
    int32_t u = s->shape.mesh.triangles[orb_next(star[i])];
    double fat = orb_star_fatness_at(s, star, count, u);
    ways++;
    if (fat > top && names_agree(s, paths, star[i]) && orb_star_link_is_clean(s, star, count, u)) {
      top = fat;
      best = star[i];
    }
  }
  if (best >= 0 && ways == 2) {
    collapse(s, paths, best, star, count);
    return 1;
  }
  return 0;
}

void orb_paths_straighten(orb_sheet *sheet, orb_paths *paths, int32_t first) {
  for (int pass = 0, removed = 1; pass < PASSES && removed; pass++) {
    removed = 0;
    for (int32_t v = sheet->shape.mesh.vertex_count - 1; v >= first; v--) {
      removed |= straighten_at(sheet, paths, v);
    }
  }
}
