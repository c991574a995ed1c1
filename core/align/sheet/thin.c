/* Thinning: removes the vertices that paths needed once the landmarks have met.
 *
 * A vertex made by a split lies within a given triangle or on an edge between two. Collapsing it onto a neighbour
 * changes no shape if every triangle of its star stays in its parent with the same orientation, which is decided
 * exactly on barycentric coordinates in the parent. On the sphere the star must stay positive too, and become neither
 * much thinner than it was nor too thin. Sweeps between two calls straighten the edges around a vertex, so that the
 * next call removes more.
 */
#include <math.h>
#include <string.h>

#include "align/sheet/collapse.h"
#include "align/sheet/thin.h"
#include "base/check.h"
#include "base/memory.h"

/* Chosen by trial. */
enum { PASSES = 4 }; /* over all vertices */
/* A collapse must leave this fatness of the star (see orb_fatness()), or this share of its current fatness if that is
 * less. */
static const double THIN = 0.03, KEPT = 0.5;

typedef struct thinner {
  orb_sheet *sheet;
  unsigned char *held; /* vertices that stay: landmarks */
  unsigned char *dead; /* triangles */
  unsigned char *gone; /* vertices */
} thinner;

static int try_vertex(thinner *t, int32_t v) {
  orb_sheet *s = t->sheet;
  int32_t star[ORB_STAR_MAX], best = -1;
  int count = orb_star_read(s, v, star);
  double now = INFINITY, top = 0;
  for (int i = 0; i < count; i++) {
    const int32_t *tri = s->shape.mesh.triangles;
    const double *p = s->shape.points;
    double fat =
        orb_fatness(p + 3 * (size_t)v, p + 3 * (size_t)tri[orb_next(star[i])], p + 3 * (size_t)tri[orb_prev(star[i])]);
    now = fat < now ? fat : now;
  }
  double least = KEPT * now < THIN ? KEPT * now : THIN;
  for (int i = 0; i < count; i++) {
    int32_t u = s->shape.mesh.triangles[orb_next(star[i])];
    double fat = orb_star_fatness_at(s, star, count, u);
    if (fat > top && fat >= least && orb_star_link_is_clean(s, star, count, u)) {
      top = fat;
      best = star[i];
    }
  }
  if (best >= 0) {
    int32_t g = s->twin[best];
    orb_star_collapse(s, best, star, count);
    t->dead[best / 3] = t->dead[g / 3] = 1;
    t->gone[v] = 1;
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
      orb_corner_copy(mesh, h, 3 * to + k);
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
