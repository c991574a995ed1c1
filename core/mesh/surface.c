#include "mesh/surface.h"

#include <string.h>

#include "base/check.h"
#include "base/forest.h"
#include "base/memory.h"
#include "mesh/edit.h"

orb_status orb_surface_rematch(orb_surface *s) {
  return orb_edges_match(s->ctx, s->mesh->triangles, s->mesh->triangle_count, s->mesh->vertex_count, s->twin,
                         &s->edges);
}

orb_status orb_surface_open(orb_context *ctx, orb_mesh *mesh, orb_surface *s) {
  *s = (orb_surface){.ctx = ctx, .mesh = mesh, .conflict = -1};
  s->twin = ORB_NEW(ctx, int32_t, 3 * (size_t)mesh->triangle_count);
  s->piece = ORB_NEW(ctx, int32_t, mesh->triangle_count);
  s->reversed = ORB_NEW(ctx, unsigned char, mesh->triangle_count);
  if (!s->twin || !s->piece || !s->reversed) {
    return ORB_E_NO_MEMORY;
  }
  return orb_surface_rematch(s);
}

void orb_surface_close(orb_surface *s) {
  orb_free(s->ctx, s->twin);
  orb_free(s->ctx, s->piece);
  orb_free(s->ctx, s->reversed);
  s->twin = s->piece = NULL;
  s->reversed = NULL;
}

orb_status orb_surface_pieces(orb_surface *s) {
  int32_t faces = s->mesh->triangle_count;
  const int32_t *triangles = s->mesh->triangles;
  int32_t *queue = ORB_NEW(s->ctx, int32_t, faces);
  if (!queue) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t t = 0; t < faces; t++) {
    s->piece[t] = -1;
  }
  s->piece_count = 0;
  s->conflict = -1;
  for (int32_t seed = 0; seed < faces; seed++) {
    if (s->piece[seed] >= 0) {
      continue;
    }
    int32_t head = 0, tail = 0;
    s->piece[seed] = s->piece_count;
    s->reversed[seed] = 0;
    queue[tail++] = seed;
    while (head < tail) {
      int32_t t = queue[head++];
      for (int32_t h = 3 * t; h < 3 * t + 3; h++) {
        int32_t g = s->twin[h];
        if (g < 0) {
          continue;
        }
        int32_t u = g / 3;
        unsigned char reversed = (unsigned char)(s->reversed[t] ^ (triangles[h] == triangles[g]));
        if (s->piece[u] < 0) {
          s->piece[u] = s->piece_count;
          s->reversed[u] = reversed;
          queue[tail++] = u;
        } else if (s->reversed[u] != reversed && s->conflict < 0) {
          s->conflict = h;
        }
      }
    }
    s->piece_count++;
  }
  orb_free(s->ctx, queue);
  return orb_context_check(s->ctx);
}

/* The next corner of the same vertex, clockwise (over the incoming edge) or counter-clockwise; negative at a boundary.
 */
static int32_t corner_clockwise(const int32_t *twin, int32_t h) {
  return twin[orb_prev(h)];
}
static int32_t corner_counter(const int32_t *twin, int32_t h) {
  return twin[h] < 0 ? twin[h] : orb_next(twin[h]);
}

/* Marks the fan of corner h as seen; sets the vertex of its corners to `vertex` unless that is negative. */
static void take_fan(orb_surface *s, int32_t h, int32_t vertex, unsigned char *seen) {
  int32_t *triangles = s->mesh->triangles;
  int32_t c = h;
  do {
    seen[c] = 1;
    if (vertex >= 0) {
      triangles[c] = vertex;
    }
    c = corner_clockwise(s->twin, c);
  } while (c >= 0 && c != h);
  if (c < 0) {
    for (c = corner_counter(s->twin, h); c >= 0; c = corner_counter(s->twin, c)) {
      seen[c] = 1;
      if (vertex >= 0) {
        triangles[c] = vertex;
      }
    }
  }
}

/* Handles a further fan of a vertex: joins pieces, lists the vertex, splits it. */
static orb_status further_fan(orb_surface *s, int32_t h, int split, const int32_t *first, int32_t *root, orb_fans *out,
                              unsigned char *seen, unsigned char *listed) {
  orb_mesh *mesh = s->mesh;
  int32_t v = mesh->triangles[h];
  out->joins += orb_forest_join(root, s->piece[h / 3], s->piece[first[v] / 3]);
  if (!listed[v]) {
    listed[v] = 1;
    out->pinched++;
    if (out->pinched_count < ORB_ERROR_ITEMS) {
      out->pinched_vertices[out->pinched_count++] = v;
    }
  }
  if (!split) {
    take_fan(s, h, -1, seen);
    return ORB_OK;
  }
  int32_t made = mesh->vertex_count++;
  memcpy(mesh->positions + 3 * (size_t)made, mesh->positions + 3 * (size_t)v, 3 * sizeof(double));
  mesh->source[made] = mesh->source[v];
  take_fan(s, h, made, seen);
  return ORB_OK;
}

orb_status orb_surface_fans(orb_surface *s, int split, orb_fans *out) {
  *out = (orb_fans){0};
  orb_mesh *mesh = s->mesh;
  int32_t half_edges = 3 * mesh->triangle_count, vertices = mesh->vertex_count;
  unsigned char *seen = ORB_NEW0(s->ctx, unsigned char, half_edges);
  unsigned char *listed = ORB_NEW0(s->ctx, unsigned char, vertices);
  int32_t *first = ORB_NEW(s->ctx, int32_t, vertices); /* a corner of the vertex's first fan, −1: unused */
  int32_t *root = ORB_NEW(s->ctx, int32_t, s->piece_count);
  orb_status status = seen && first && root && listed ? ORB_OK : ORB_E_NO_MEMORY;
  if (status != ORB_OK) {
    goto done;
  }
  memset(first, 0xff, (size_t)vertices * sizeof *first);
  for (int32_t i = 0; i < s->piece_count; i++) {
    root[i] = i;
  }
  int32_t further = 0;
  for (int32_t h = 0; h < half_edges; h++) {
    if (seen[h]) {
      continue;
    }
    out->fans++;
    int32_t v = mesh->triangles[h];
    if (first[v] < 0) {
      first[v] = h;
      take_fan(s, h, -1, seen);
    } else {
      further++;
      seen[h] = 2; /* the second loop comes back to it, after room is made */
      take_fan(s, h, -1, seen);
      seen[h] = 2;
    }
  }
  if (further > 0) {
    if (split) {
      ORB_GO(status, orb_mesh_reserve(s->ctx, mesh, further, 0), done);
    }
    for (int32_t h = 0; h < half_edges && status == ORB_OK; h++) {
      if (seen[h] == 2) {
        status = further_fan(s, h, split, first, root, out, seen, listed);
      }
    }
  }
done:
  orb_free(s->ctx, seen);
  orb_free(s->ctx, listed);
  orb_free(s->ctx, first);
  orb_free(s->ctx, root);
  return status;
}

int32_t orb_surface_next_open(const orb_surface *s, int32_t h) {
  int32_t g = orb_next(h);
  while (s->twin[g] >= 0) {
    g = orb_next(s->twin[g]);
  }
  return g;
}

orb_status orb_surface_loops(orb_surface *s, int64_t *loops) {
  *loops = 0;
  int32_t half_edges = 3 * s->mesh->triangle_count;
  unsigned char *seen = ORB_NEW0(s->ctx, unsigned char, half_edges);
  if (!seen) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t h = 0; h < half_edges; h++) {
    if (s->twin[h] == ORB_OPEN && !seen[h]) {
      ++*loops;
      for (int32_t g = h; !seen[g]; g = orb_surface_next_open(s, g)) {
        seen[g] = 1;
      }
    }
  }
  orb_free(s->ctx, seen);
  return ORB_OK;
}
