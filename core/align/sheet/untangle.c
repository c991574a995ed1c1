/* Untangling by local moves. The quality of a star is the least height of its centre above a far edge, over its
 * triangles (negative where one is flipped). A vertex tries the weighted and the plain mean of its ring, a point away
 * from its worst edge, and points on the way there, and moves to the best. This maximises the quality star by star, so
 * a fold that covers several stars opens from its border inwards. */
#include "align/sheet/untangle.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "numeric/predicates.h"
#include "numeric/vec3.h"

/* Chosen by trial. */
enum {
  RINGS = 6,  /* rings around the flips that may move: 0 at first, then one more each time, fewer than this */
  ROUNDS = 24 /* of moves for each number of rings, if vertices still move */
};
/* Share of the way to a goal that a move tries: the whole, then halves, as long as they exceed this. */
static const double LEAST_WAY = 0.04;

static int is_flipped(const orb_sheet *s, int32_t t) {
  const int32_t *tri = s->shape.mesh.triangles + 3 * (size_t)t;
  const double *p = s->shape.points;
  return orb_orient(p + 3 * (size_t)tri[0], p + 3 * (size_t)tri[1], p + 3 * (size_t)tri[2]) <= 0;
}

/* Least height of x above the edges of v's ring; away (may be NULL): the direction that raises it. */
static double least_height(const orb_sheet *s, int32_t v, const double x[3], double away[3]) {
  const int32_t *tri = s->shape.mesh.triangles;
  const double *p = s->shape.points;
  int32_t start = s->corner[v], h = start;
  double least = INFINITY;
  do {
    const double *a = p + 3 * (size_t)tri[orb_next(h)], *b = p + 3 * (size_t)tri[orb_prev(h)];
    double edge = sqrt(orb_distance2(a, b)), height = orb_det(x, a, b) / (edge + ORB_TINY);
    if (height < least) {
      least = height;
      if (away) {
        orb_cross(a, b, away);
        orb_normalize(away);
      }
    }
    h = orb_sheet_swing(s, h);
  } while (h != start);
  return least;
}

static void ring_means(const orb_sheet *s, int32_t v, double plain[3], double weighted[3]) {
  const int32_t *tri = s->shape.mesh.triangles;
  const double *p = s->shape.points;
  int32_t start = s->corner[v], h = start;
  memset(plain, 0, 3 * sizeof *plain);
  memset(weighted, 0, 3 * sizeof *weighted);
  do {
    const double *a = p + 3 * (size_t)tri[orb_next(h)], *b = p + 3 * (size_t)tri[orb_prev(h)];
    double length = sqrt(orb_distance2(a, b));
    for (int k = 0; k < 3; k++) {
      plain[k] += a[k];
      weighted[k] += length * (a[k] + b[k]);
    }
    h = orb_sheet_swing(s, h);
  } while (h != start);
  orb_normalize(plain);
  orb_normalize(weighted);
}

static int improve(orb_sheet *s, int32_t v) {
  double *p = s->shape.points + 3 * (size_t)v, away[3] = {0, 0, 0}, goal[3][3], best[3] = {0, 0, 0};
  double now = least_height(s, v, p, away), top = now;
  ring_means(s, v, goal[0], goal[1]);
  double reach = sqrt(orb_distance2(p, goal[0])) + fabs(now);
  for (int k = 0; k < 3; k++) {
    goal[2][k] = p[k] + reach * away[k];
  }
  orb_normalize(goal[2]);
  for (int g = 0; g < 3; g++) {
    for (double t = 1; t > LEAST_WAY; t *= 0.5) {
      double x[3];
      for (int k = 0; k < 3; k++) {
        x[k] = p[k] + t * (goal[g][k] - p[k]);
      }
      orb_normalize(x);
      double height = least_height(s, v, x, NULL);
      if (height > top) {
        top = height;
        memcpy(best, x, sizeof best);
      }
    }
  }
  if (top > now) {
    memcpy(p, best, sizeof best);
    return 1;
  }
  return 0;
}

/* Lists the vertices of flipped triangles and of `rings` rings around them, ascending. */
static int32_t gather(const orb_sheet *s, const unsigned char *held, int rings, unsigned char *near, int32_t *list) {
  const orb_mesh *mesh = &s->shape.mesh;
  memset(near, 0, (size_t)mesh->vertex_count);
  for (int32_t t = 0; t < mesh->triangle_count; t++) {
    if (is_flipped(s, t)) {
      for (int k = 0; k < 3; k++) {
        near[mesh->triangles[3 * t + k]] = 1;
      }
    }
  }
  for (int ring = 0; ring < rings; ring++) {
    unsigned char mark = (unsigned char)(ring + 1);
    for (int32_t h = 0; h < 3 * mesh->triangle_count; h++) {
      if (near[mesh->triangles[h]] == mark && !near[mesh->triangles[orb_next(h)]]) {
        near[mesh->triangles[orb_next(h)]] = (unsigned char)(mark + 1);
      }
    }
  }
  int32_t count = 0;
  for (int32_t v = 0; v < mesh->vertex_count; v++) {
    if (near[v] && !held[v]) {
      list[count++] = v;
    }
  }
  return count;
}

static int64_t count_flipped(const orb_sheet *s) {
  int64_t count = 0;
  for (int32_t t = 0; t < s->shape.mesh.triangle_count; t++) {
    count += is_flipped(s, t);
  }
  return count;
}

orb_status orb_untangle(orb_context *ctx, orb_sheet *sheet, const unsigned char *held, int64_t *left) {
  orb_status status = ORB_OK;
  int32_t vertices = sheet->shape.mesh.vertex_count;
  unsigned char *near = ORB_NEW(ctx, unsigned char, vertices);
  int32_t *list = ORB_NEW(ctx, int32_t, vertices);
  if (!near || !list) {
    status = ORB_E_NO_MEMORY;
    goto end;
  }
  *left = count_flipped(sheet);
  for (int rings = 0; *left > 0 && rings < RINGS; rings++) {
    int32_t count = gather(sheet, held, rings, near, list);
    for (int round = 0, moved = 1; *left > 0 && moved && round < ROUNDS; round++) {
      moved = 0;
      for (int32_t i = 0; i < count; i++) {
        moved |= improve(sheet, list[i]);
      }
      ORB_GO(status, orb_context_check(ctx), end);
      *left = count_flipped(sheet);
    }
  }
end:
  orb_free(ctx, near);
  orb_free(ctx, list);
  return status;
}
