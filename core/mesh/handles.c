/* Closing handles.
 *
 * A cut along a loop that does not divide the surface, with a patch over each rim, removes one handle, whether the
 * loop goes around the handle (which is cut then) or around its tunnel (which is filled then). The loops of one round
 * share no vertex and together leave the surface connected, so a round removes as many handles as it has loops. Both
 * loops of a handle cross, so only the shorter one is cut.
 *
 * The vertices of a loop get a copy each; the copies lie at the same places, and both patches have the same shape.
 */
#include "mesh/handles.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/error.h"
#include "base/grow.h"
#include "base/memory.h"
#include "mesh/apart.h"
#include "mesh/cycles.h"
#include "mesh/edit.h"
#include "mesh/fill.h"
#include "mesh/sort.h"
#include "numeric/vec3.h"

/* Short loops are cheaper to find: searches begin with an eighth of the limit, and double it. */
static const double FIRST_LIMIT = 0.125;
/* How many vertices the searches for loops to close may settle for each triangle, and on small meshes besides. Lattices
 * take up to 89, tori 32; where searches cannot share their work (see cycles.c), a million triangles could take a
 * thousand each. A vertex takes 0.15 µs. */
enum { SETTLED_A_TRIANGLE = 256, SETTLED_LEAST = 1000000 };
/* Rounds that search for the loops to list in an error; each costs some searches of the whole surface. No round begins
 * once searches have settled so many vertices for each triangle, and on small meshes besides: what is found by then is
 * listed. That is a second or two, or some more where vertices have many edges. Chosen on one mesh of the latter kind;
 * with 4 million, the tests of handles find the same loops. */
enum { LIST_ROUNDS = 24, LISTED_A_TRIANGLE = 16, LISTED_LEAST = 8000000 };
/* A round of whole searches finds 64 loops at most. Of more handles than this, each round finds as many
 * short ones as share no vertex; plates, lattices and balls with tubes took one to seven rounds. */
enum { FEW_HANDLES = 1000, MANY_ROUNDS = 8 };

void orb_loops_free(orb_context *ctx, orb_loops *loops) {
  orb_free(ctx, loops->loop);
  orb_free(ctx, loops->vertices);
  *loops = (orb_loops){0};
}

/* The diagonal of the vertices that faces use, and the sign of the volume. */
static double diagonal_of(const orb_mesh *mesh, double *facing) {
  double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY}, volume = 0;
  const double *origin = mesh->positions + 3 * (size_t)mesh->triangles[0];
  for (int32_t t = 0; t < mesh->triangle_count; t++) {
    double p[3][3], n[3];
    for (int k = 0; k < 3; k++) {
      const double *x = mesh->positions + 3 * (size_t)mesh->triangles[3 * t + k];
      for (int i = 0; i < 3; i++) {
        low[i] = fmin(low[i], x[i]);
        high[i] = fmax(high[i], x[i]);
      }
      orb_sub(x, origin, p[k]);
    }
    orb_cross(p[0], p[1], n);
    volume += orb_dot(n, p[2]);
  }
  *facing = volume < 0 ? -1 : 1;
  return sqrt(orb_distance2(low, high));
}

static double area_of(const orb_mesh *mesh, int32_t t) {
  const int32_t *c = mesh->triangles + 3 * (size_t)t;
  return orb_triangle_area_at(mesh->positions, c);
}

/* Whether the patches of a loop lie outside the body: the surface then faces the loop's centre. */
static int is_tunnel(const orb_surface *s, const int32_t *loop, int32_t count, double facing) {
  const orb_mesh *mesh = s->mesh;
  double centre[3] = {0, 0, 0}, toward = 0;
  for (int32_t i = 0; i < count; i++) {
    const double *p = mesh->positions + 3 * (size_t)mesh->triangles[loop[i]];
    for (int k = 0; k < 3; k++) {
      centre[k] += p[k] / count;
    }
  }
  for (int32_t i = 0; i < 2 * count; i++) {
    int32_t h = i < count ? loop[i] : s->twin[loop[i - count]];
    const double *p = mesh->positions + 3 * (size_t)mesh->triangles[h];
    const double *q = mesh->positions + 3 * (size_t)mesh->triangles[orb_next(h)];
    const double *r = mesh->positions + 3 * (size_t)mesh->triangles[orb_prev(h)];
    double u[3], w[3], n[3], in[3];
    orb_sub(q, p, u);
    orb_sub(r, p, w);
    orb_cross(u, w, n);
    for (int k = 0; k < 3; k++) {
      in[k] = centre[k] - 0.5 * (p[k] + q[k]);
    }
    double size = orb_length(n);
    toward += size > 0 ? orb_dot(n, in) / size * orb_length(u) : 0;
  }
  return toward * facing > 0;
}

/* Appends a loop in the file's numbers. */
static orb_status note_loop(orb_surface *s, const orb_cycles *cycles, int32_t i, double diagonal, orb_loops *out) {
  const orb_cycle *cycle = &cycles->cycle[i];
  if (cycle->count > INT32_MAX / 2 - out->vertex_count) {
    return ORB_E_NO_MEMORY;
  }
  if (out->count == out->room) {
    int32_t room = 2 * out->room + 8;
    if (!orb_regrow(s->ctx, &out->loop, (size_t)room, sizeof *out->loop)) {
      return ORB_E_NO_MEMORY;
    }
    out->room = room;
  }
  if (cycle->count > out->vertex_room - out->vertex_count) {
    int32_t room = 2 * (out->vertex_count + cycle->count);
    if (!orb_regrow(s->ctx, &out->vertices, (size_t)room, sizeof *out->vertices)) {
      return ORB_E_NO_MEMORY;
    }
    out->vertex_room = room;
  }
  out->loop[out->count++] =
      (orb_handle){.start = out->vertex_count, .count = cycle->count, .length_relative = cycle->length / diagonal};
  for (int32_t k = 0; k < cycle->count; k++) {
    out->vertices[out->vertex_count++] = s->mesh->source[s->mesh->triangles[cycles->half_edges[cycle->start + k]]];
  }
  return ORB_OK;
}

/* Gives the faces on the left of a loop their own copies of its vertices; the mesh has room for them. number: of the
 * loop, for each vertex, −1: in none. */
static void split(orb_surface *s, const int32_t *loop, int32_t count, int32_t number, int32_t *of) {
  orb_mesh *mesh = s->mesh;
  int32_t first = mesh->vertex_count;
  for (int32_t i = 0; i < count; i++) {
    int32_t v = mesh->triangles[loop[i]];
    memcpy(mesh->positions + 3 * (size_t)(first + i), mesh->positions + 3 * (size_t)v, 3 * sizeof(double));
    mesh->source[first + i] = mesh->source[v];
    of[v] = of[first + i] = number;
  }
  for (int32_t i = 0; i < count; i++) {
    int32_t before = loop[i > 0 ? i - 1 : count - 1], c = loop[i];
    for (;; c = s->twin[orb_prev(c)]) { /* the twins are those of the surface before the cut */
      mesh->triangles[c] = first + i;
      if (orb_prev(c) == before) {
        break;
      }
    }
  }
  mesh->vertex_count += count;
}

/* Cuts along all cycles and covers the rims. area[i]: of the patches of cycle i. */
static orb_status cut(orb_surface *s, const orb_cycles *cycles, int fans, double *area) {
  orb_mesh *mesh = s->mesh;
  int64_t more = 0, loops = 0;
  for (int32_t i = 0; i < cycles->count; i++) {
    more += cycles->cycle[i].count;
    area[i] = 0;
  }
  if (more > INT32_MAX - mesh->vertex_count) {
    return orb_fail(s->ctx, ORB_E_TOO_LARGE, "The repaired mesh would be too large; decimate it first.");
  }
  ORB_TRY(orb_mesh_reserve(s->ctx, mesh, (int32_t)more, 0));
  int32_t old = mesh->triangle_count;
  int32_t *of = ORB_NEW(s->ctx, int32_t, (size_t)mesh->vertex_count + (size_t)more);
  if (!of) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t i = 0; i < cycles->count; i++) {
    split(s, cycles->half_edges + cycles->cycle[i].start, cycles->cycle[i].count, i, of);
  }
  orb_status status = orb_surface_rematch(s);
  if (status == ORB_OK) {
    status = orb_surface_fill(s, fans ? ORB_FILL_FANS : ORB_FILL_FLAT, &loops);
  }
  if (status == ORB_OK) {
    ORB_ASSERT(loops == 2 * (int64_t)cycles->count);
    for (int32_t t = old; t < mesh->triangle_count; t++) {
      area[of[mesh->triangles[3 * (size_t)t]]] += area_of(mesh, t); /* the first corner lies on the rim */
      mesh->source_triangle[t] = ORB_MADE_COVER;
    }
  }
  orb_free(s->ctx, of);
  return status;
}

/* Closes the handles that one search finds, of this genus; *count: how many. */
static orb_status close_round(orb_surface *s, double limit, double diagonal, double facing, int64_t genus,
                              int64_t *allowed, orb_loops *done, int32_t *count) {
  orb_cycles cycles = {0};
  double *area = NULL;
  int *tunnel = NULL;
  const int many = genus > ORB_CYCLES_LABELLED;
  *count = 0;
  orb_status status = orb_cycles_find(s, limit, many ? INT32_MAX : ORB_CYCLES_LABELLED, allowed, &cycles);
  if (status == ORB_OK && many) {
    status = orb_cycles_apart(s, &cycles);
  }
  if (status == ORB_OK) {
    area = ORB_NEW(s->ctx, double, cycles.count);
    tunnel = ORB_NEW(s->ctx, int, cycles.count);
    status = area && tunnel ? ORB_OK : ORB_E_NO_MEMORY;
  }
  for (int32_t i = 0; i < cycles.count && status == ORB_OK; i++) {
    const orb_cycle *cycle = &cycles.cycle[i];
    tunnel[i] = is_tunnel(s, cycles.half_edges + cycle->start, cycle->count, facing);
    status = note_loop(s, &cycles, i, diagonal, done);
  }
  if (status == ORB_OK && cycles.count > 0) {
    *count = cycles.count;
    status = cut(s, &cycles, 0, area);
  }
  for (int32_t i = 0; i < *count && status == ORB_OK; i++) {
    orb_handle *handle = &done->loop[done->count - *count + i];
    handle->filled = tunnel[i];
    handle->area_relative = area[i] / (diagonal * diagonal);
  }
  orb_free(s->ctx, area);
  orb_free(s->ctx, tunnel);
  orb_cycles_free(s->ctx, &cycles);
  return status;
}

orb_status orb_surface_close_handles(orb_surface *s, double size, int64_t *genus) {
  double facing, diagonal = diagonal_of(s->mesh, &facing), limit = FIRST_LIMIT * size;
  int64_t allowed = SETTLED_LEAST + SETTLED_A_TRIANGLE * (int64_t)s->mesh->triangle_count;
  orb_loops done = {0};
  orb_status status = ORB_OK;
  while (*genus > 0 && status == ORB_OK) {
    int32_t count;
    status = close_round(s, limit * diagonal, diagonal, facing, *genus, &allowed, &done, &count);
    if (status == ORB_OK && count == 0) {
      if (limit >= size) {
        break;
      }
      limit = fmin(fmax(2 * limit, DBL_MIN), size); /* an eighth of a tiny size is 0 */
    }
    *genus -= count;
  }
  if (status != ORB_OK) {
    orb_loops_free(s->ctx, &done);
    return status;
  }
  s->mesh->handles = done.loop;
  s->mesh->loop_vertices = done.vertices;
  s->mesh->handle_count = done.count;
  s->mesh->loop_vertex_count = done.vertex_count;
  return orb_surface_pieces(s);
}

/* Whether the last loop names a vertex twice: two vertices of the surface may stand for one of the file. */
static orb_status names_twice(orb_surface *s, const orb_loops *loops, int *twice) {
  const orb_handle *last = &loops->loop[loops->count - 1];
  uint64_t *sorted = ORB_NEW(s->ctx, uint64_t, last->count);
  if (!sorted) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t i = 0; i < last->count; i++) {
    sorted[i] = (uint64_t)loops->vertices[last->start + i];
  }
  orb_sort_u64(sorted, last->count);
  *twice = 0;
  for (int32_t i = 1; i < last->count; i++) {
    *twice |= sorted[i] == sorted[i - 1];
  }
  orb_free(s->ctx, sorted);
  return ORB_OK;
}

/* Lists the loops of some cycles, and cuts along them if handles are left. A cycle that names a vertex twice is
 * dropped: another round may find a better one for its handle. *genus: what is left. */
static orb_status list_round(orb_surface *s, orb_cycles *cycles, double diagonal, int64_t *genus, orb_loops *out) {
  int32_t kept = 0;
  for (int32_t i = 0; i < cycles->count; i++) {
    int twice = 0;
    ORB_TRY(note_loop(s, cycles, i, diagonal, out));
    ORB_TRY(names_twice(s, out, &twice));
    if (twice) {
      out->vertex_count = out->loop[--out->count].start;
    } else {
      cycles->cycle[kept++] = cycles->cycle[i];
    }
  }
  cycles->count = kept;
  *genus -= kept;
  if (kept == 0 || *genus <= 0) {
    return ORB_OK;
  }
  double *area = ORB_NEW(s->ctx, double, kept);
  orb_status status = area ? cut(s, cycles, 1, area) : ORB_E_NO_MEMORY;
  orb_free(s->ctx, area);
  return status;
}

orb_status orb_surface_list_handles(orb_surface *s, int64_t genus, orb_loops *out) {
  double facing, diagonal = diagonal_of(s->mesh, &facing);
  int many = genus > FEW_HANDLES, rounds = many ? MANY_ROUNDS : LIST_ROUNDS;
  int64_t left = LISTED_LEAST + LISTED_A_TRIANGLE * (int64_t)s->mesh->triangle_count;
  for (int round = 0; round < rounds && genus > 0 && left > 0; round++) {
    orb_cycles cycles = {0};
    orb_status status =
        many ? orb_cycles_generate(s, left, &cycles) : orb_cycles_find(s, INFINITY, ORB_CYCLES_LABELLED, NULL, &cycles);
    if (status == ORB_OK && many) {
      status = orb_cycles_apart(s, &cycles);
    }
    if (status == ORB_OK) {
      status = list_round(s, &cycles, diagonal, &genus, out);
    }
    int32_t count = cycles.count;
    left -= cycles.settled;
    orb_cycles_free(s->ctx, &cycles);
    ORB_TRY(status);
    if (count == 0) {
      break;
    }
  }
  return ORB_OK;
}
