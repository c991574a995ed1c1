#include "mesh/holes.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "numeric/vec3.h"

int orb_has_holes(const orb_mesh *mesh) {
  for (int32_t t = 0; mesh->source_triangle && t < mesh->triangle_count; t++) {
    if (mesh->source_triangle[t] == ORB_MADE_FILL) {
      return 1;
    }
  }
  return 0;
}

void orb_holes_free(orb_context *ctx, orb_hole_list *holes) {
  orb_free(ctx, holes->of);
  orb_free(ctx, holes->half_edges);
  orb_free(ctx, holes->at);
  memset(holes, 0, sizeof *holes);
}

typedef struct walk {
  const orb_mesh *mesh;
  const int32_t *twin;
  unsigned char *seen; /* half-edges */
  int32_t *visits;     /* of each vertex, by all rims */
  int32_t used;        /* of half_edges */
} walk;

static int fills(const walk *w, int32_t h) {
  return w->mesh->source_triangle[h / 3] == ORB_MADE_FILL;
}

static int is_rim(const walk *w, int32_t h) {
  return fills(w, h) && !fills(w, w->twin[h]);
}

/* The half-edge of the rim after h. */
static int32_t next_on_rim(const walk *w, int32_t h) {
  int32_t g = orb_next(h);
  while (fills(w, w->twin[g])) {
    g = orb_next(w->twin[g]);
  }
  return g;
}

/* Follows the rim from half-edge h. */
static orb_hole follow(walk *w, int32_t first, orb_hole_list *out) {
  const orb_mesh *mesh = w->mesh;
  orb_hole hole = {.start = w->used};
  int32_t h = first;
  do {
    const int32_t v = mesh->triangles[h], to = mesh->triangles[orb_next(h)];
    out->half_edges[w->used] = h;
    out->at[w->used++] = hole.length;
    hole.length += sqrt(orb_distance2(mesh->positions + 3 * (size_t)v, mesh->positions + 3 * (size_t)to));
    hole.edges += !mesh->source || mesh->source[v] >= 0;
    hole.count++;
    w->visits[v]++;
    w->seen[h] = 1;
    h = next_on_rim(w, h);
  } while (h != first);
  return hole;
}

static void follow_all(walk *w, orb_hole_list *out) {
  for (int32_t h = 0; h < 3 * w->mesh->triangle_count; h++) {
    if (is_rim(w, h) && !w->seen[h]) {
      out->of[out->count++] = follow(w, h, out);
    }
  }
  for (int32_t i = 0; i < out->count; i++) {
    orb_hole *hole = &out->of[i];
    hole->is_simple = 1;
    for (int32_t k = 0; k < hole->count; k++) {
      hole->is_simple &= w->visits[w->mesh->triangles[out->half_edges[hole->start + k]]] == 1;
    }
  }
}

orb_status orb_holes_find(orb_context *ctx, const orb_mesh *mesh, orb_hole_list *out) {
  const size_t half_edges = 3 * (size_t)mesh->triangle_count;
  int32_t *twin = NULL, rims = 0;
  walk w = {.mesh = mesh};
  orb_status status = ORB_E_NO_MEMORY;
  memset(out, 0, sizeof *out);
  if (!orb_has_holes(mesh)) {
    return ORB_OK;
  }
  twin = ORB_NEW(ctx, int32_t, half_edges);
  w.twin = twin;
  w.seen = ORB_NEW0(ctx, unsigned char, half_edges);
  w.visits = ORB_NEW0(ctx, int32_t, mesh->vertex_count);
  if (!twin || !w.seen || !w.visits) {
    goto done;
  }
  ORB_GO(status, orb_mesh_twins(ctx, mesh->triangles, mesh->triangle_count, mesh->vertex_count, twin), done);
  for (int32_t h = 0; h < 3 * mesh->triangle_count; h++) {
    rims += is_rim(&w, h);
  }
  out->of = ORB_NEW(ctx, orb_hole, rims);
  out->half_edges = ORB_NEW(ctx, int32_t, rims);
  out->at = ORB_NEW(ctx, double, rims);
  status = out->of && out->half_edges && out->at ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    follow_all(&w, out);
  }
done:
  orb_free(ctx, twin);
  orb_free(ctx, w.seen);
  orb_free(ctx, w.visits);
  return status;
}
