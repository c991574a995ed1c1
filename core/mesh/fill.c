/* Filling holes.
 *
 * A loop of up to SMALL edges gets the triangulation of least area (dynamic programming, Barequet & Sharir 1995); a
 * larger one is cut like a polygon. Either may use a diagonal that is already an edge of the mesh. Where that happens,
 * all such loops are closed by fans around a new vertex each instead, which cannot clash. With ORB_FILL_FAIR the
 * polygon of a larger loop is refined and made fair (patch.h, fair.h), which cannot clash either: large flat triangles
 * would stand for most of the sphere. A new vertex stands for no vertex of the file: its source is the lowest one of
 * its loop. New faces have source_triangle ORB_MADE_FILL and take their attributes from the faces across the loop.
 */
#include "mesh/fill.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/error.h"
#include "base/memory.h"
#include "mesh/edit.h"
#include "mesh/fair.h"
#include "mesh/patch.h"
#include "mesh/polygon.h"
#include "numeric/vec3.h"

enum { SMALL = 48 }; /* edges; least area takes O(edges³) time and the tables below O(SMALL²) memory */

/* Most triangles of fair surfaces: for each edge of their rim (a disc needs about 11 at the patch's growth, a rim with
 * short edges more); in all as many as the mesh has, so that the fill costs no more than a multiple of its faces, but
 * FAIR_SOME (0.15 s) for a small mesh and FAIR_MOST (1.2 s) for a large one. Where the rims want more than that, each
 * edge gets fewer; with less than FAIR_LEAST the loops are flat. */
enum { FAIR_AN_EDGE = 24, FAIR_LEAST = 4, FAIR_SOME = 16384, FAIR_MOST = 131072 };
/* How often a patch is refined and made fair: the fair surface is larger than the flat one, and its shape depends a
 * little on the triangles that it starts from. */
enum { FAIR_ROUNDS = 3 };

typedef struct fill {
  orb_surface *s;
  int32_t *loop;   /* open half-edges of the current loop, in the order of the new faces */
  int32_t *vertex; /* their origins */
  int32_t *cut;    /* its triangulation: 3 indices into loop for each triangle */
  int64_t later;   /* room that the loops after this one need: triangles if flat, at least as many as vertices */
  double an_edge;  /* triangles that a fair surface may have for each edge of its rim */
  orb_polygon polygon;
  double best[SMALL][SMALL];
  int split[SMALL][SMALL];
} fill;

/* Twice the area of the triangle over three entries of the loop. */
static double area_of(const fill *f, int32_t a, int32_t b, int32_t c) {
  const double *p = f->s->mesh->positions;
  double u[3], w[3], n[3];
  orb_sub(p + 3 * (size_t)f->vertex[b], p + 3 * (size_t)f->vertex[a], u);
  orb_sub(p + 3 * (size_t)f->vertex[c], p + 3 * (size_t)f->vertex[a], w);
  orb_cross(u, w, n);
  return orb_length(n);
}

static void cut_small(fill *f, int32_t count) {
  for (int32_t span = 1; span < count; span++) {
    for (int32_t i = 0; i + span < count; i++) {
      int32_t k = i + span;
      f->best[i][k] = span == 1 ? 0 : INFINITY;
      f->split[i][k] = i + 1;
      for (int32_t j = i + 1; j < k; j++) {
        double cost = f->best[i][j] + f->best[j][k] + area_of(f, i, j, k);
        if (cost < f->best[i][k]) {
          f->best[i][k] = cost;
          f->split[i][k] = j;
        }
      }
    }
  }
  int32_t stack[2 * SMALL][2], depth = 0;
  int32_t *out = f->cut;
  stack[depth][0] = 0;
  stack[depth++][1] = count - 1;
  while (depth > 0) {
    depth--;
    int32_t i = stack[depth][0], k = stack[depth][1];
    if (k - i < 2) {
      continue;
    }
    int32_t j = f->split[i][k];
    *out++ = i;
    *out++ = j;
    *out++ = k;
    stack[depth][0] = i;
    stack[depth++][1] = j;
    stack[depth][0] = j;
    stack[depth++][1] = k;
  }
}

/* Copies the attributes of corner `like` of an old face to a new corner. */
static void copy_corner(orb_mesh *mesh, int32_t corner, int32_t like) {
  size_t c = (size_t)corner, l = (size_t)like;
  if (mesh->normals) {
    memcpy(mesh->normals + 3 * c, mesh->normals + 3 * l, 3 * sizeof(float));
  }
  if (mesh->texcoords) {
    memcpy(mesh->texcoords + 2 * c, mesh->texcoords + 2 * l, 2 * sizeof(float));
  }
  if (mesh->colors) {
    memcpy(mesh->colors + 4 * c, mesh->colors + 4 * l, 4 * sizeof(float));
  }
}

static void add_face(fill *f, const int32_t vertex[3], const int32_t like[3]) {
  orb_mesh *mesh = f->s->mesh;
  int32_t t = mesh->triangle_count++;
  for (int k = 0; k < 3; k++) {
    mesh->triangles[3 * t + k] = vertex[k];
    copy_corner(mesh, 3 * t + k, like[k]);
  }
  mesh->source_triangle[t] = ORB_MADE_FILL;
  if (mesh->material) {
    mesh->material[t] = mesh->material[like[0] / 3];
  }
}

static void cut_loop(fill *f, int32_t count) {
  if (count <= SMALL) {
    cut_small(f, count);
  } else {
    orb_polygon_cut(&f->polygon, f->s->mesh->positions, f->vertex, count, f->cut);
  }
}

static void close_with_diagonals(fill *f, int32_t count) {
  cut_loop(f, count);
  for (int32_t i = 0; i < count - 2; i++) {
    const int32_t *c = f->cut + 3 * i;
    add_face(f, (int32_t[3]){f->vertex[c[0]], f->vertex[c[1]], f->vertex[c[2]]},
             (int32_t[3]){f->loop[c[0]], f->loop[c[1]], f->loop[c[2]]});
  }
}

static void close_with_fan(fill *f, int32_t count) {
  orb_mesh *mesh = f->s->mesh;
  int32_t made = mesh->vertex_count++, lowest = f->vertex[0];
  double *centre = mesh->positions + 3 * (size_t)made, total = 0, sum[3] = {0, 0, 0};
  for (int32_t i = 0; i < count; i++) { /* the centroid of the loop's edges, weighted by length */
    const double *p = mesh->positions + 3 * (size_t)f->vertex[i];
    const double *q = mesh->positions + 3 * (size_t)f->vertex[i + 1 < count ? i + 1 : 0];
    double length = sqrt(orb_distance2(p, q));
    total += length;
    for (int k = 0; k < 3; k++) {
      sum[k] += length * (0.5 * p[k] + 0.5 * q[k]);
    }
    lowest = mesh->source[f->vertex[i]] < mesh->source[lowest] ? f->vertex[i] : lowest;
  }
  for (int k = 0; k < 3; k++) {
    centre[k] = total > 0 ? sum[k] / total : mesh->positions[3 * (size_t)lowest + (size_t)k];
  }
  mesh->source[made] = mesh->source[lowest];
  for (int32_t i = 0; i < count; i++) {
    int32_t j = i + 1 < count ? i + 1 : 0;
    add_face(f, (int32_t[3]){f->vertex[i], f->vertex[j], made}, (int32_t[3]){f->loop[i], f->loop[j], f->loop[i]});
  }
}

/* Adds the patch to the mesh. */
static orb_status add_patch(fill *f, const orb_patch *patch) {
  orb_mesh *mesh = f->s->mesh;
  const int32_t first = mesh->vertex_count - patch->rim; /* mesh number of patch vertex 0, if its rim were new */
  if (patch->triangle_count + f->later > INT32_MAX - mesh->triangle_count) {
    return orb_fail(f->s->ctx, ORB_E_TOO_LARGE,
                    "The mesh would be too large with its holes filled; decimate it first.");
  }
  ORB_TRY(orb_mesh_reserve(f->s->ctx, mesh, patch->vertex_count + (int32_t)f->later,
                           patch->triangle_count + (int32_t)f->later));
  int32_t lowest = f->vertex[0];
  for (int32_t i = 1; i < patch->rim; i++) {
    lowest = mesh->source[f->vertex[i]] < mesh->source[lowest] ? f->vertex[i] : lowest;
  }
  for (int32_t v = patch->rim; v < patch->vertex_count; v++) {
    for (int k = 0; k < 3; k++) {
      mesh->positions[3 * (size_t)mesh->vertex_count + (size_t)k] =
          patch->centre[k] + patch->scale * patch->positions[3 * (size_t)v + (size_t)k];
    }
    mesh->source[mesh->vertex_count++] = mesh->source[lowest];
  }
  for (int32_t t = 0; t < patch->triangle_count; t++) {
    int32_t vertex[3], like[3];
    for (int k = 0; k < 3; k++) {
      const int32_t v = patch->triangles[3 * t + k];
      vertex[k] = v < patch->rim ? f->vertex[v] : first + v;
      like[k] = f->loop[patch->like[v]];
    }
    add_face(f, vertex, like);
  }
  return ORB_OK;
}

static orb_status close_fairly(fill *f, int32_t count) {
  orb_patch patch = {0};
  cut_loop(f, count);
  orb_status status = orb_patch_open(f->s->ctx, f->s->mesh->positions, f->vertex, count, f->cut,
                                     (int32_t)(f->an_edge * count), FAIR_AN_EDGE / f->an_edge, &patch);
  for (int round = 0; round < FAIR_ROUNDS && status == ORB_OK; round++) {
    status = orb_patch_refine(f->s->ctx, &patch);
    if (status == ORB_OK) {
      status = orb_patch_fair(f->s, f->loop, &patch);
    }
  }
  if (status == ORB_OK) {
    status = add_patch(f, &patch);
  }
  orb_patch_close(f->s->ctx, &patch);
  return status;
}

/* Collects the loop of h in reverse: new faces run against the old ones. */
static int32_t collect_loop(fill *f, int32_t h, unsigned char *seen) {
  int32_t count = 0;
  for (int32_t g = h; !seen[g]; g = orb_surface_next_open(f->s, g)) {
    seen[g] = 1;
    f->loop[count++] = g;
  }
  for (int32_t i = 0, j = count - 1; i < j; i++, j--) {
    int32_t x = f->loop[i];
    f->loop[i] = f->loop[j];
    f->loop[j] = x;
  }
  for (int32_t i = 0; i < count; i++) {
    f->vertex[i] = f->s->mesh->triangles[f->loop[i]];
  }
  return count;
}

/* Shares the triangles of fair surfaces out to the edges of all long loops. */
static void share_out(fill *f, unsigned char *seen, int32_t half_edges) {
  const int32_t faces = f->s->mesh->triangle_count;
  const int32_t all = faces < FAIR_SOME ? FAIR_SOME : faces < FAIR_MOST ? faces : FAIR_MOST;
  int64_t edges = 0;
  for (int32_t h = 0; h < half_edges; h++) {
    if (f->s->twin[h] == ORB_OPEN && !seen[h]) {
      const int32_t count = collect_loop(f, h, seen);
      edges += count > SMALL ? count : 0;
    }
  }
  memset(seen, 0, (size_t)(uint32_t)half_edges);
  f->an_edge = edges * FAIR_AN_EDGE > all ? (double)all / (double)edges : FAIR_AN_EDGE;
}

/* fans: whether loops that are closed flat get fans. *loops: their number, counted anew. */
static orb_status close_all(fill *f, orb_fill how, int fans, int64_t *loops) {
  orb_surface *s = f->s;
  int32_t half_edges = 3 * s->mesh->triangle_count; /* of the old faces */
  ORB_TRY(orb_mesh_reserve(s->ctx, s->mesh, (int32_t)*loops, (int32_t)s->edges.open));
  *loops = 0;
  f->later = s->edges.open;
  unsigned char *seen = ORB_NEW0(s->ctx, unsigned char, half_edges);
  orb_status status = seen ? ORB_OK : ORB_E_NO_MEMORY;
  if (seen && how == ORB_FILL_FAIR) {
    share_out(f, seen, half_edges);
  }
  for (int32_t h = 0; h < half_edges && status == ORB_OK; h++) {
    if (s->twin[h] != ORB_OPEN || seen[h]) {
      continue;
    }
    int32_t count = collect_loop(f, h, seen);
    ORB_ASSERT(count >= 3);
    f->later -= count;
    if (how == ORB_FILL_FAIR && count > SMALL && f->an_edge >= FAIR_LEAST) {
      status = close_fairly(f, count);
    } else if (fans) {
      close_with_fan(f, count);
    } else {
      close_with_diagonals(f, count);
    }
    ++*loops;
    status = status == ORB_OK ? orb_context_check(s->ctx) : status;
  }
  orb_free(s->ctx, seen);
  return status;
}

/* Matches the edges again, with the new faces. */
static orb_status grow_surface(orb_surface *s) {
  const int32_t faces = s->mesh->triangle_count;
  orb_free(s->ctx, s->twin);
  orb_free(s->ctx, s->piece);
  orb_free(s->ctx, s->reversed);
  s->twin = ORB_NEW(s->ctx, int32_t, 3 * (size_t)faces);
  s->piece = ORB_NEW(s->ctx, int32_t, faces);
  s->reversed = ORB_NEW(s->ctx, unsigned char, faces);
  return s->twin && s->piece && s->reversed ? orb_surface_rematch(s) : ORB_E_NO_MEMORY;
}

static orb_status run(fill *f, orb_fill how, int64_t *count) {
  orb_surface *s = f->s;
  orb_mesh *mesh = s->mesh;
  int64_t loops = 0, open = s->edges.open, before = s->edges.crowded;
  const int32_t faces = mesh->triangle_count, vertices = mesh->vertex_count;
  ORB_TRY(orb_surface_loops(s, &loops));
  if (3 * (faces + open) > INT32_MAX) {
    return orb_fail(s->ctx, ORB_E_TOO_LARGE, "The mesh would be too large with its holes filled; decimate it first.");
  }
  f->loop = ORB_NEW(s->ctx, int32_t, open);
  f->vertex = ORB_NEW(s->ctx, int32_t, open);
  f->cut = ORB_NEW(s->ctx, int32_t, 3 * open);
  if (!f->loop || !f->vertex || !f->cut) {
    return ORB_E_NO_MEMORY;
  }
  ORB_TRY(orb_polygon_reserve(s->ctx, &f->polygon, (int32_t)open));
  ORB_TRY(close_all(f, how, how == ORB_FILL_FANS, &loops));
  ORB_TRY(grow_surface(s));
  if (s->edges.crowded > before || s->edges.open > 0) {
    mesh->triangle_count = faces;
    mesh->vertex_count = vertices;
    ORB_TRY(orb_surface_rematch(s));
    ORB_TRY(close_all(f, how, 1, &loops));
    ORB_TRY(grow_surface(s));
  }
  *count = loops;
  return ORB_OK;
}

orb_status orb_surface_fill(orb_surface *s, orb_fill how, int64_t *loops) {
  fill *f = orb_calloc(s->ctx, 1, sizeof *f);
  if (!f) {
    return ORB_E_NO_MEMORY;
  }
  f->s = s;
  orb_status status = run(f, how, loops);
  orb_polygon_free(s->ctx, &f->polygon);
  orb_free(s->ctx, f->loop);
  orb_free(s->ctx, f->vertex);
  orb_free(s->ctx, f->cut);
  orb_free(s->ctx, f);
  return status;
}
