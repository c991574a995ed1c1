/* A client that welds a GLB's split vertices by their bits must get the supermesh back. But shapes may have distinct
 * vertices at one place, and fine supermeshes have vertices closer than float32 can distinguish.
 *
 * Vertices enter a hash table one by one, keyed by the float32 positions on every shape: first those to keep, then the
 * others, each by number. One that finds its key taken tries base coordinates ±1, ±2, … units in the last place away,
 * the coordinate of largest magnitude first (a small one may be near zero, where a unit would be lost to flushed
 * denormals). Where hundreds of vertices share a place, as where a map of shapes that do not correspond is very thin,
 * it then tries several coordinates at once, in growing cubes.
 */
#include "transfer/distinct.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/check.h"
#include "base/error.h"
#include "base/hash.h"
#include "base/memory.h"
#include "base/parallel.h"

enum { MAX_ULPS = 16 }; /* units in the last place: more find a place in denser meshes and move vertices farther */
/* Units along each of several coordinates: a cube of 13³ places. A larger one would move vertices farther. */
enum { MAX_CUBE = 6 };
enum { GRAIN = 16384 };           /* vertices a thread takes at a time */
enum { CHECK_EVERY = 16384 };     /* vertices between two checks for cancellation */
static const float TINY = 1e-30f; /* smaller coordinates are near the denormals that clients may flush to zero */

typedef struct rounding {
  const orb_context *ctx;
  double *const *positions;
  float *base, *const *deltas;
  int32_t frame_count, shapes, vertex_count;
  int32_t *slots; /* the hash table: vertex numbers, −1 empty */
  int32_t *tried; /* of each vertex: the tries of those that found its place taken, which they need not repeat */
  uint64_t mask;
} rounding;

/* Rounds vertex v's deltas against its base position. */
static void round_deltas(const rounding *r, int64_t v) {
  for (int32_t f = 1; f < r->frame_count; f++) {
    for (int c = 0; c < 3; c++) {
      r->deltas[f - 1][3 * v + c] = (float)(r->positions[f][3 * v + c] - (double)r->base[3 * v + c]) + 0.0f;
    }
  }
}

static void round_body(void *arg, int64_t begin, int64_t end, int thread) {
  rounding *r = arg;
  (void)thread;
  for (int64_t v = begin; v < end; v++) {
    for (int c = 0; c < 3; c++) {
      r->base[3 * v + c] = (float)r->positions[0][3 * v + c] + 0.0f;
    }
    round_deltas(r, v);
  }
}

/* Coordinate c of vertex v on shape f as a client computes it. */
static float shown(const rounding *r, int64_t v, int32_t f, int c) {
  float base = r->base[3 * v + c];
  return f == 0 ? base : base + r->deltas[f - 1][3 * v + c] + 0.0f;
}

static uint64_t hash_of(const rounding *r, int64_t v) {
  uint64_t hash = 0;
  for (int32_t f = 0; f < r->shapes; f++) { /* the hash of the shapes before goes into that of the next */
    struct {
      uint64_t before;
      float at[4];
    } key = {hash, {shown(r, v, f, 0), shown(r, v, f, 1), shown(r, v, f, 2), 0}};
    hash = orb_hash(r->ctx, &key, sizeof key);
  }
  return hash;
}

static int coincide(const rounding *r, int64_t a, int64_t b) {
  for (int32_t f = 0; f < r->shapes; f++) {
    for (int c = 0; c < 3; c++) {
      if (shown(r, a, f, c) != shown(r, b, f, c)) {
        return 0;
      }
    }
  }
  return 1;
}

/* Puts v into the table. Returns −1, or the vertex that has its key. */
static int32_t insert(rounding *r, int64_t v) {
  uint64_t slot = hash_of(r, v) & r->mask;
  while (r->slots[slot] >= 0) {
    if (coincide(r, v, r->slots[slot])) {
      return r->slots[slot];
    }
    slot = (slot + 1) & r->mask;
  }
  r->slots[slot] = (int32_t)v;
  return -1;
}

/* A vertex that looks for a place of its own. */
typedef struct nudging {
  int64_t v;
  int32_t skip, tries; /* tries to skip, and those so far */
} nudging;

/* Puts the vertex where its base is, unless that is taken. */
static int take_place(rounding *r, nudging *n) {
  if (n->tries++ < n->skip) {
    return 0;
  }
  round_deltas(r, n->v);
  return insert(r, n->v) < 0;
}

/* The axes by falling magnitude of the coordinate. */
static void axis_order(const float p[3], int order[3]) {
  order[0] = 0, order[1] = 1, order[2] = 2;
  for (int i = 0; i < 2; i++) {
    for (int j = 0; j < 2; j++) {
      if (fabsf(p[order[j]]) < fabsf(p[order[j + 1]])) {
        int t = order[j];
        order[j] = order[j + 1];
        order[j + 1] = t;
      }
    }
  }
}

/* Puts the vertex so many units away from where it was, unless that is taken. */
static int put_away(rounding *r, nudging *n, const float from[3], float unit, const int units[3]) {
  float *p = r->base + 3 * n->v;
  for (int c = 0; c < 3; c++) {
    p[c] = from[c] + (float)units[c] * unit + 0.0f;
    if (!isfinite(p[c]) || (units[c] != 0 && fabsf(p[c]) < TINY)) {
      return 0;
    }
  }
  return take_place(r, n);
}

/* Tries the surface of the cube of 2·reach + 1 units. */
static int nudge_within_cube(rounding *r, nudging *n, const float from[3], float unit, int reach) {
  int at[3];
  for (at[0] = -reach; at[0] <= reach; at[0]++) {
    for (at[1] = -reach; at[1] <= reach; at[1]++) {
      const int inside = abs(at[0]) < reach && abs(at[1]) < reach;
      for (at[2] = -reach; at[2] <= reach; at[2] += inside ? 2 * reach : 1) {
        if (put_away(r, n, from, unit, at)) {
          return 1;
        }
      }
    }
  }
  return 0;
}

/* Tries the places along one coordinate, the nearest first. */
static int nudge_along(rounding *r, nudging *n, const float from[3], const int order[3]) {
  float *p = r->base + 3 * n->v, moved[2][3];
  memcpy(moved[0], from, sizeof moved[0]);
  memcpy(moved[1], from, sizeof moved[1]);
  for (int step = 0; step < MAX_ULPS; step++) {
    for (int side = 0; side < 2; side++) {
      for (int i = 0; i < 3; i++) {
        int c = order[i];
        moved[side][c] = nextafterf(moved[side][c], side ? INFINITY : -INFINITY);
        if (fabsf(moved[side][c]) < TINY) {
          continue;
        }
        memcpy(p, from, 3 * sizeof *p);
        p[c] = moved[side][c] + 0.0f;
        if (isfinite(p[c]) && take_place(r, n)) {
          return 1;
        }
      }
    }
  }
  return 0;
}

/* Finds a place for v, whose own is that of another vertex. The unit of a cube is that of the largest coordinate, since
 * a small one may be 0. */
static int nudge(rounding *r, int64_t v, int32_t other) {
  const float from[3] = {r->base[3 * v], r->base[3 * v + 1], r->base[3 * v + 2]};
  nudging n = {v, r->tried[other], 0};
  int order[3];
  axis_order(from, order);
  const float largest = fabsf(from[order[0]]), unit = fmaxf(nextafterf(largest, INFINITY) - largest, TINY);
  int found = nudge_along(r, &n, from, order);
  for (int reach = 1; reach <= MAX_CUBE && !found; reach++) {
    found = nudge_within_cube(r, &n, from, unit, reach);
  }
  r->tried[other] = n.tries;
  return found;
}

static orb_status keep_apart(orb_context *ctx, rounding *r, const unsigned char *keep, int32_t *nudged) {
  for (int pass = 1; pass >= 0; pass--) {
    for (int32_t v = 0; v < r->vertex_count; v++) {
      if ((keep[v] != 0) != pass) {
        continue;
      }
      const int32_t other = insert(r, v);
      if (other >= 0) {
        if (!nudge(r, v, other)) {
          return orb_fail(ctx, ORB_E_NOT_CERTIFIED,
                          "Vertices of the supermesh coincide in every shape in 32-bit coordinates; move the shapes "
                          "nearer to the origin or ask for fewer triangles.");
        }
        (*nudged)++;
        ORB_TRY(orb_context_check(ctx));
      }
      if (v % CHECK_EVERY == 0) {
        ORB_TRY(orb_context_check(ctx));
      }
    }
  }
  return ORB_OK;
}

static orb_status check_range(orb_context *ctx, const rounding *r) {
  for (int32_t f = 0; f < r->frame_count; f++) {
    const float *values = f == 0 ? r->base : r->deltas[f - 1];
    for (int64_t i = 0; i < 3 * (int64_t)r->vertex_count; i++) {
      if (!isfinite(values[i])) {
        orb_status status = orb_fail(ctx, ORB_E_NOT_CERTIFIED,
                                     "Coordinates are too large for the 32-bit numbers of glTF; scale the shape down.");
        orb_context_error_edit(ctx)->shape = f < r->shapes ? f : -1;
        return status;
      }
    }
  }
  return ORB_OK;
}

orb_status orb_round_distinct(orb_context *ctx, double *const *positions, int32_t frame_count, int32_t shapes,
                              int32_t vertex_count, const unsigned char *keep, float *base, float *const *deltas,
                              int32_t *nudged) {
  rounding r = {ctx, positions, base, deltas, frame_count, shapes, vertex_count, NULL, NULL, 0};
  uint64_t size = 64;
  while (size < 2 * (uint64_t)vertex_count) {
    size *= 2;
  }
  r.mask = size - 1;
  r.slots = ORB_NEW(ctx, int32_t, size);
  r.tried = ORB_NEW0(ctx, int32_t, vertex_count);
  orb_status status = r.slots && r.tried ? ORB_OK : ORB_E_NO_MEMORY;
  if (status != ORB_OK) {
    goto done;
  }
  memset(r.slots, -1, size * sizeof *r.slots);
  *nudged = 0;
  orb_parallel_for(ctx, vertex_count, GRAIN, round_body, &r);
  ORB_GO(status, check_range(ctx, &r), done);
  status = keep_apart(ctx, &r, keep, nudged);
done:
  orb_free(ctx, r.slots);
  orb_free(ctx, r.tried);
  return status;
}
