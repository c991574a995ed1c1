/* Thinning: the vertices that paths needed are removed again once the landmarks have met.
 *
 * A vertex made by a split lies inside a given triangle, whose plane the surface has there, or inside an edge between
 * two. Collapsing it onto a neighbour changes no shape if every triangle of its star stays in its parent and turns the
 * same way there: decided exactly, on barycentric coordinates in the parent. On the sphere the star must stay positive
 * too, and not become much thinner than it was or than a triangle may be. Sweeps between two rounds straighten what
 * bends about a vertex, so that the next round finds more.
 */
#include <math.h>
#include <string.h>

#include "align/sheet.h"
#include "base/check.h"
#include "numeric/predicates.h"
#include "numeric/vec3.h"

enum { VALENCE_MAX = 48, PASSES = 4 };
static const double THIN = 0.03, KEPT = 0.5;

typedef struct thinner {
  orb_sheet *sheet;
  unsigned char *held; /* vertices that stay: landmarks */
  unsigned char *dead; /* triangles */
  unsigned char *gone; /* vertices */
} thinner;

/* Coordinates of a vertex in a given triangle; 0: it lies elsewhere. */
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

/* det over the longest edge squared: 0.87 of a small equilateral triangle, 0 of a needle. */
static double fatness(const double a[3], const double b[3], const double c[3]) {
  double ab = orb_distance2(a, b), bc = orb_distance2(b, c), ca = orb_distance2(c, a);
  double longest = ab > bc ? ab : bc;
  longest = longest > ca ? longest : ca;
  return orb_det(a, b, c) / (longest + 1e-300);
}

static const double *point_of(const orb_sheet *s, int32_t v) {
  return s->shape.points + 3 * (size_t)v;
}

/* The star of v: half-edges that leave it; 0 where there are too many. */
static int read_star(const orb_sheet *s, int32_t v, int32_t star[VALENCE_MAX]) {
  int count = 0;
  int32_t h = s->corner[v];
  do {
    if (count == VALENCE_MAX) {
      return 0;
    }
    star[count++] = h;
    h = orb_sheet_swing(s, h);
  } while (h != s->corner[v]);
  return count;
}

/* Only the two vertices beside edge v–u are neighbours of both. */
static int link_is_clean(const orb_sheet *s, const int32_t *star, int count, int32_t u) {
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
  return common == 2 && valence + count - 4 <= VALENCE_MAX;
}

/* The least fatness on the sphere of the star with its centre at u; 0: it may not go there. */
static double fatness_at(const orb_sheet *s, const int32_t *star, int count, int32_t u) {
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
    double fat = fatness(point_of(s, u), point_of(s, a), point_of(s, b));
    least = fat < least ? fat : least;
  }
  return least;
}

static void copy_corner(orb_mesh *mesh, int32_t from, int32_t to) {
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

/* Collapses half-edge h onto its end. The star's corners take the end's values on their side. */
static void collapse(thinner *t, int32_t h, const int32_t *star, int count) {
  orb_sheet *s = t->sheet;
  orb_mesh *mesh = &s->shape.mesh;
  int32_t g = s->twin[h], v = mesh->triangles[h], u = mesh->triangles[g];
  int32_t far[2] = {mesh->triangles[orb_prev(h)], mesh->triangles[orb_prev(g)]};
  int32_t into[2] = {s->twin[orb_next(h)], s->twin[orb_next(g)]},
          from[2] = {s->twin[orb_prev(h)], s->twin[orb_prev(g)]};
  for (int i = 0; i < count; i++) {
    if (star[i] / 3 != h / 3 && star[i] / 3 != g / 3) {
      int left = s->shape.parent[star[i] / 3] == s->shape.parent[h / 3];
      copy_corner(mesh, left ? orb_next(h) : g, star[i]);
      mesh->triangles[star[i]] = u;
    }
  }
  link(s, into[0], from[0]);
  link(s, into[1], from[1]);
  s->corner[far[0]] = into[0]; /* from the far vertex to u */
  s->corner[far[1]] = into[1];
  s->corner[u] = from[0];
  t->dead[h / 3] = t->dead[g / 3] = 1;
  t->gone[v] = 1;
}

static int try_vertex(thinner *t, int32_t v) {
  orb_sheet *s = t->sheet;
  int32_t star[VALENCE_MAX], best = -1;
  int count = read_star(s, v, star);
  double now = INFINITY, top = 0;
  for (int i = 0; i < count; i++) {
    const int32_t *tri = s->shape.mesh.triangles;
    double fat = fatness(point_of(s, v), point_of(s, tri[orb_next(star[i])]), point_of(s, tri[orb_prev(star[i])]));
    now = fat < now ? fat : now;
  }
  double least = KEPT * now < THIN ? KEPT * now : THIN;
  for (int i = 0; i < count; i++) {
    int32_t u = s->shape.mesh.triangles[orb_next(star[i])];
    double fat = fatness_at(s, star, count, u);
    if (fat > top && fat >= least && link_is_clean(s, star, count, u)) {
      top = fat;
      best = star[i];
    }
  }
  if (best >= 0) {
    collapse(t, best, star, count);
  }
  return best >= 0;
}

/* Closes the gaps in the arrays. number: room for the new numbers of vertices and triangles. */
static void compact(thinner *t, int32_t *number_v, int32_t *number_t) {
  orb_sheet *s = t->sheet;
  orb_mesh *mesh = &s->shape.mesh;
  int32_t vertices = 0, triangles = 0;
  for (int32_t v = 0; v < mesh->vertex_count; v++) {
    number_v[v] = vertices;
    if (!t->gone[v]) {
      memmove(mesh->positions + 3 * (size_t)vertices, mesh->positions + 3 * (size_t)v, 3 * sizeof(double));
      memmove(s->shape.points + 3 * (size_t)vertices, s->shape.points + 3 * (size_t)v, 3 * sizeof(double));
      s->corner[vertices] = s->corner[v];
      if (mesh->source) {
        mesh->source[vertices] = mesh->source[v];
      }
      if (v >= s->given_vertices) {
        s->origin[vertices - s->given_vertices] = s->origin[v - s->given_vertices];
      }
      vertices++;
    }
  }
  for (int32_t f = 0; f < mesh->triangle_count; f++) {
    number_t[f] = triangles;
    triangles += !t->dead[f];
  }
  for (int32_t f = 0; f < mesh->triangle_count; f++) {
    int32_t to = number_t[f];
    if (t->dead[f]) {
      continue;
    }
    for (int k = 0; k < 3; k++) {
      int32_t h = 3 * f + k, g = s->twin[h];
      mesh->triangles[3 * to + k] = number_v[mesh->triangles[h]];
      s->twin[3 * to + k] = 3 * number_t[g / 3] + g % 3;
      copy_corner(mesh, h, 3 * to + k);
    }
    s->shape.parent[to] = s->shape.parent[f];
    if (mesh->material) {
      mesh->material[to] = mesh->material[f];
    }
    if (mesh->source_triangle) {
      mesh->source_triangle[to] = mesh->source_triangle[f];
    }
  }
  for (int32_t v = 0; v < vertices; v++) {
    s->corner[v] = 3 * number_t[s->corner[v] / 3] + s->corner[v] % 3;
  }
  for (int32_t k = 0; k < s->landmark_count; k++) {
    s->shape.landmark_vertices[k] = number_v[s->shape.landmark_vertices[k]];
  }
  mesh->vertex_count = vertices;
  mesh->triangle_count = triangles;
}

orb_status orb_sheet_thin(orb_context *ctx, orb_sheet *sheet, int32_t *removed) {
  orb_status status = ORB_OK;
  int32_t vertices = sheet->shape.mesh.vertex_count, triangles = sheet->shape.mesh.triangle_count;
  thinner t = {.sheet = sheet};
  t.held = ORB_NEW0(ctx, unsigned char, vertices);
  t.gone = ORB_NEW0(ctx, unsigned char, vertices);
  t.dead = ORB_NEW0(ctx, unsigned char, triangles);
  int32_t *number = ORB_NEW(ctx, int32_t, (size_t)vertices + (size_t)triangles);
  *removed = 0;
  if (!t.held || !t.gone || !t.dead || !number) {
    status = ORB_E_NO_MEMORY;
    goto end;
  }
  for (int32_t k = 0; k < sheet->landmark_count; k++) {
    t.held[sheet->shape.landmark_vertices[k]] = 1;
  }
  for (int pass = 0, last = 1; pass < PASSES && last > 0; pass++) {
    last = 0;
    for (int32_t v = vertices - 1; v >= sheet->given_vertices; v--) {
      if (!t.held[v] && !t.gone[v]) {
        last += try_vertex(&t, v);
      }
      if (v % 1024 == 0) {
        ORB_GO(status, orb_context_check(ctx), end);
      }
    }
    *removed += last;
  }
  compact(&t, number, number + vertices);
end:
  orb_free(ctx, t.held);
  orb_free(ctx, t.gone);
  orb_free(ctx, t.dead);
  orb_free(ctx, number);
  return status;
}
