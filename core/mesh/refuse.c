#include "mesh/refuse.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/check.h"
#include "base/error.h"
#include "base/memory.h"
#include "mesh/handles.h"
#include "mesh/sort.h"

static const char *plural(int64_t count, const char *one, const char *many) {
  return count == 1 ? one : many;
}

static int32_t low_of(const orb_mesh *mesh, int32_t h) {
  int32_t a = mesh->triangles[h], b = mesh->triangles[orb_next(h)];
  return a < b ? a : b;
}
static int32_t high_of(const orb_mesh *mesh, int32_t h) {
  int32_t a = mesh->triangles[h], b = mesh->triangles[orb_next(h)];
  return a < b ? b : a;
}

static void add_edge(orb_error *error, const orb_mesh *mesh, int32_t h) {
  if (error->edge_count < ORB_ERROR_ITEMS) {
    error->edges[error->edge_count][0] = mesh->source[mesh->triangles[h]];
    error->edges[error->edge_count++][1] = mesh->source[mesh->triangles[orb_next(h)]];
  }
}

orb_status orb_refuse_sort_edges(const orb_surface *s, int32_t kind, uint64_t *entry, int32_t *start) {
  if (!entry || !start) {
    return ORB_E_NO_MEMORY;
  }
  const orb_mesh *mesh = s->mesh;
  int32_t half_edges = 3 * mesh->triangle_count;
  for (int32_t h = 0; h < half_edges; h++) {
    if (s->twin[h] == kind) {
      start[low_of(mesh, h) + 2]++;
    }
  }
  for (int32_t v = 0; v < mesh->vertex_count; v++) {
    start[v + 2] += start[v + 1];
  }
  for (int32_t h = 0; h < half_edges; h++) {
    if (s->twin[h] == kind) {
      entry[start[low_of(mesh, h) + 1]++] = (uint64_t)(uint32_t)high_of(mesh, h) << 32 | (uint32_t)h;
    }
  }
  for (int32_t v = 0; v < mesh->vertex_count; v++) {
    orb_sort_u64(entry + start[v], start[v + 1] - start[v]);
  }
  return ORB_OK;
}

orb_status orb_refuse_crowded(orb_surface *s, unsigned was_split) {
  const orb_mesh *mesh = s->mesh;
  int64_t count = 0;
  for (int32_t h = 0; h < 3 * mesh->triangle_count; h++) {
    count += s->twin[h] == ORB_CROWDED;
  }
  uint64_t *entry = ORB_NEW(s->ctx, uint64_t, count);
  int32_t *start = ORB_NEW0(s->ctx, int32_t, (size_t)mesh->vertex_count + 2);
  orb_status status = orb_refuse_sort_edges(s, ORB_CROWDED, entry, start);
  if (status == ORB_OK) {
    status = orb_fail(s->ctx, ORB_E_NOT_MANIFOLD,
                      "%lld %s to more than two faces (or %s from a vertex to itself); a surface has two "
                      "faces at each edge. Remove the surplus faces%s.",
                      (long long)s->edges.crowded, plural(s->edges.crowded, "edge belongs", "edges belong"),
                      plural(s->edges.crowded, "runs", "run"),
                      was_split ? ": splitting did not part them" : ", or send the mesh with repair=split_nonmanifold");
    orb_error *error = orb_context_error_edit(s->ctx);
    error->edge_total = s->edges.crowded;
    for (int64_t i = 0; i < count && error->edge_count < ORB_ERROR_ITEMS; i++) {
      int32_t g = i > 0 ? (int32_t)(uint32_t)entry[i - 1] : -1, h = (int32_t)(uint32_t)entry[i];
      if (g < 0 || low_of(mesh, g) != low_of(mesh, h) || high_of(mesh, g) != high_of(mesh, h)) {
        add_edge(error, mesh, h);
      }
    }
  }
  orb_free(s->ctx, entry);
  orb_free(s->ctx, start);
  return status;
}

orb_status orb_refuse_facing(orb_surface *s) {
  const orb_mesh *mesh = s->mesh;
  orb_status status =
      s->conflict >= 0
          ? orb_fail(s->ctx, ORB_E_NOT_ORIENTABLE,
                     "The surface has only one side, like a Möbius strip: its faces cannot be oriented consistently. "
                     "A walk from neighbour to neighbour returns reversed at the given edge. Cut the surface there, "
                     "and close it.")
          : orb_fail(s->ctx, ORB_E_NOT_ORIENTABLE,
                     "Faces are reversed against their neighbours at %lld %s; send the mesh with repair=safe, or "
                     "reverse them.",
                     (long long)s->edges.same_way, plural(s->edges.same_way, "edge", "edges"));
  orb_error *error = orb_context_error_edit(s->ctx);
  if (s->conflict >= 0) {
    error->edge_total = 1;
    add_edge(error, mesh, s->conflict);
    return status;
  }
  error->edge_total = s->edges.same_way;
  for (int32_t h = 0; h < 3 * mesh->triangle_count && error->edge_count < ORB_ERROR_ITEMS; h++) {
    if (s->twin[h] > h && mesh->triangles[s->twin[h]] == mesh->triangles[h]) {
      add_edge(error, mesh, h);
    }
  }
  return status;
}

static void list_parts(orb_surface *s, const orb_parts *parts) {
  orb_error *error = orb_context_error_edit(s->ctx);
  error->component_total = parts->count;
  for (int32_t i = 0; i < parts->count && i < ORB_ERROR_ITEMS; i++) {
    snprintf(error->component_names[error->component_count], ORB_PART_NAME, "%s",
             orb_part_name(s->mesh, &parts->part[i]));
    snprintf(error->component_nodes[error->component_count], ORB_PART_NAME, "%s",
             orb_part_node(s->mesh, &parts->part[i]));
    error->components[error->component_count++] = parts->part[i].triangles;
  }
}

/* The first part without an open edge, so the largest; −1: there is none. closed: scratch, per piece. */
static int32_t find_closed(const orb_surface *s, const orb_parts *parts, unsigned char *closed) {
  memset(closed, 1, (size_t)s->piece_count);
  for (int32_t h = 0; h < 3 * s->mesh->triangle_count; h++) {
    closed[s->piece[h / 3]] &= s->twin[h] != ORB_OPEN;
  }
  for (int32_t i = 0; i < parts->count; i++) {
    if (closed[parts->part[i].piece]) {
      return i;
    }
  }
  return -1;
}

/* What to do besides closing the holes. If the largest piece has none, such as a body beside open clothes, nothing has
 * to be filled. whole: the largest piece without holes; −1: there is none. */
static void advise_open(const orb_mesh *mesh, const orb_parts *parts, int32_t whole, char *advice, size_t size) {
  const char *name = whole < 0 ? "" : orb_part_name(mesh, &parts->part[whole]);
  if (parts->count < 2) {
    snprintf(advice, size, "repair=fill_holes");
  } else if (whole == 0) {
    snprintf(advice, size, "repair=largest_component: the largest of its %d pieces has no holes", parts->count);
  } else {
    int used =
        snprintf(advice, size, "repair=fill_holes, and with largest_component or part=K to keep one of its %d pieces",
                 parts->count);
    if (whole > 0) {
      snprintf(advice + used, size - (size_t)used, "; piece %d%s%s%s has no holes", whole, name[0] ? ", \"" : "", name,
               name[0] ? "\"," : "");
    }
  }
}

orb_status orb_refuse_open(orb_surface *s) {
  int64_t loops = 0;
  char advice[160 + ORB_PART_NAME];
  orb_parts parts = {0};
  ORB_TRY(orb_surface_loops(s, &loops));
  ORB_TRY(orb_parts_list(s, &parts));
  unsigned char *closed = ORB_NEW(s->ctx, unsigned char, s->piece_count);
  if (!closed) {
    orb_free(s->ctx, parts.part);
    return ORB_E_NO_MEMORY;
  }
  advise_open(s->mesh, &parts, find_closed(s, &parts, closed), advice, sizeof advice);
  (void)orb_fail(
      s->ctx, ORB_E_NOT_CLOSED,
      "The surface is not closed: %lld %s in %lld boundary %s %s a face on one side only. Close %s, or send the "
      "mesh with %s.",
      (long long)s->edges.open, plural(s->edges.open, "edge", "edges"), (long long)loops,
      plural(loops, "loop", "loops"), plural(s->edges.open, "has", "have"), plural(loops, "the hole", "the holes"),
      advice);
  if (parts.count > 1) {
    list_parts(s, &parts);
  }
  orb_free(s->ctx, parts.part);
  orb_free(s->ctx, closed);
  orb_error *error = orb_context_error_edit(s->ctx);
  error->boundary_loops = loops;
  error->edge_total = s->edges.open;
  for (int32_t h = 0; h < 3 * s->mesh->triangle_count && error->edge_count < ORB_ERROR_ITEMS; h++) {
    if (s->twin[h] == ORB_OPEN) {
      add_edge(error, s->mesh, h);
    }
  }
  return ORB_E_NOT_CLOSED;
}

orb_status orb_refuse_part(orb_surface *s, const orb_parts *parts, const orb_repair_options *options) {
  char wanted[ORB_PART_NAME + 32];
  if (options->part_name[0]) {
    snprintf(wanted, sizeof wanted, "no part of the name \"%s\"", options->part_name);
  } else {
    snprintf(wanted, sizeof wanted, "no part %d", options->part);
  }
  if (parts->count == 1) { /* connected: the option is wrong, not the mesh */
    return orb_fail(s->ctx, ORB_E_BAD_OPTION, "The mesh is one piece and has %s. Omit the part, or name 0.", wanted);
  }
  (void)orb_fail(s->ctx, ORB_E_NOT_CONNECTED, "The mesh has %s, but %d parts: use a name or number of the list.",
                 wanted, parts->count);
  list_parts(s, parts);
  return ORB_E_NOT_CONNECTED;
}

orb_status orb_refuse_pinched(orb_surface *s, const orb_fans *fans) {
  orb_parts parts = {0};
  ORB_TRY(orb_parts_list(s, &parts));
  if (s->piece_count > 1) {
    (void)orb_fail(s->ctx, ORB_E_NOT_MANIFOLD,
                   "%d bodies are joined only at %lld %s, where the surface is not manifold. Join them "
                   "properly, or send the mesh with repair=largest_component.",
                   s->piece_count, (long long)fans->pinched, plural(fans->pinched, "vertex", "vertices"));
  } else {
    (void)orb_fail(s->ctx, ORB_E_NOT_MANIFOLD,
                   "At %lld %s several fans of faces touch; send the mesh with repair=safe, or split them.",
                   (long long)fans->pinched, plural(fans->pinched, "vertex", "vertices"));
  }
  if (s->piece_count > 1) {
    list_parts(s, &parts);
  }
  orb_error *error = orb_context_error_edit(s->ctx);
  error->vertex_total = fans->pinched;
  for (int32_t i = 0; i < fans->pinched_count; i++) {
    error->vertices[error->vertex_count++] = s->mesh->source[fans->pinched_vertices[i]];
  }
  orb_free(s->ctx, parts.part);
  return ORB_E_NOT_MANIFOLD;
}

orb_status orb_refuse_pieces(orb_surface *s) {
  orb_parts parts = {0};
  ORB_TRY(orb_parts_list(s, &parts));
  (void)orb_fail(s->ctx, ORB_E_NOT_CONNECTED,
                 "The mesh has %d pieces that do not touch; send one of them, or the mesh with "
                 "repair=largest_component, or with part=K to keep another one.",
                 s->piece_count);
  list_parts(s, &parts);
  orb_free(s->ctx, parts.part);
  return ORB_E_NOT_CONNECTED;
}

orb_status orb_refuse_handles(orb_surface *s, int64_t genus, double limit) {
  orb_loops loops = {0};
  orb_status status = orb_surface_list_handles(s, genus, &loops);
  if (status != ORB_OK) {
    orb_loops_free(s->ctx, &loops);
    return status;
  }
  if (limit > 0) {
    (void)orb_fail(s->ctx, ORB_E_NOT_GENUS_ZERO,
                   "The surface has %lld %s that no loop of up to %.3g of its diagonal goes around. %s %s.",
                   (long long)genus, plural(genus, "handle", "handles"), limit,
                   limit < ORB_HANDLE_SIZE_MOST ? "Allow more with handle_size, or fill or cut" : "Fill or cut",
                   plural(genus, "it", "them"));
  } else {
    (void)orb_fail(s->ctx, ORB_E_NOT_GENUS_ZERO,
                   "The surface has %lld %s (like a torus or a cup's ear); only surfaces like a sphere can be "
                   "morphed. Fill or cut %s, or send the mesh with repair=close_handles if %s small.",
                   (long long)genus, plural(genus, "handle", "handles"), plural(genus, "it", "them"),
                   plural(genus, "it is", "they are"));
  }
  orb_error *error = orb_context_error_edit(s->ctx);
  error->genus = genus;
  for (int32_t i = 0; i < loops.count; i++) {
    int32_t at = error->loop_start[error->loop_count], count = loops.loop[i].count;
    if (count > ORB_ERROR_LOOP_VERTICES - at) {
      continue; /* a shorter one may fit */
    }
    memcpy(error->loop_vertices + at, loops.vertices + loops.loop[i].start, (size_t)count * sizeof(int32_t));
    error->loop_length_relative[error->loop_count++] = loops.loop[i].length_relative;
    error->loop_start[error->loop_count] = at + count;
  }
  orb_loops_free(s->ctx, &loops);
  return ORB_E_NOT_GENUS_ZERO;
}

orb_status orb_refuse_size(orb_context *ctx, const orb_mesh *mesh) {
  double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY}, most = 0;
  for (size_t i = 0; i < 3 * (size_t)mesh->vertex_count; i++) {
    double x = mesh->positions[i];
    low[i % 3] = fmin(low[i % 3], x);
    high[i % 3] = fmax(high[i % 3], x);
    most = fmax(most, fabs(x));
  }
  double diagonal = hypot(hypot(high[0] - low[0], high[1] - low[1]), high[2] - low[2]);
  if (!(diagonal >= ORB_DIAGONAL_MIN)) {
    return orb_fail(ctx, ORB_E_DEGENERATE, "The mesh is only %.3g across; scale it up, to 1e-30 at least.", diagonal);
  }
  if (!(diagonal >= ORB_DIAGONAL_SHARE * most)) {
    return orb_fail(
        ctx, ORB_E_DEGENERATE,
        "The mesh is %.3g across but %.3g away from the origin, where the 32-bit numbers of glTF cannot tell "
        "its vertices apart; move it to the origin.",
        diagonal, most);
  }
  return ORB_OK;
}

orb_status orb_refuse_few(orb_surface *s) {
  return orb_fail(
      s->ctx, ORB_E_DEGENERATE,
      "%d %s left once repeated and degenerate faces are dropped; a closed surface needs four. Check that the right "
      "object was exported, and that no other program has merged its vertices.",
      s->mesh->triangle_count, plural(s->mesh->triangle_count, "triangle is", "triangles are"));
}
