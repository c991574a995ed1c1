/* A place names one triangle, but a place on an edge lies in two, and a place at a vertex in all around it. The corner
 * that lies in the fewest triangles gives the candidates; whether the other two lie in a candidate follows from the
 * numbers of the vertices that carry them. There is no arithmetic, so nothing is rounded. */
#include "transfer/inside.h"

#include <string.h>

#include "base/memory.h"
#include "base/parallel.h"

enum { GRAIN = 2048 }; /* triangles a thread takes at a time */
enum { RING = 64 };    /* triangles visited around a vertex: bounds the time at vertices of high degree */

int orb_place_in(const int32_t *triangles, const orb_place *place, int32_t triangle, double at[3]) {
  const int32_t *own = triangles + 3 * (int64_t)place->triangle, *other = triangles + 3 * (int64_t)triangle;
  at[0] = at[1] = at[2] = 0;
  for (int k = 0; k < 3; k++) {
    if (place->at[k] != 0) {
      int j = own[k] == other[0] ? 0 : own[k] == other[1] ? 1 : own[k] == other[2] ? 2 : -1;
      if (j < 0) {
        return 0;
      }
      at[j] = place->at[k];
    }
  }
  return 1;
}

static int holds(const int32_t *triangles, int32_t triangle, const orb_place *const corner[3]) {
  double at[3];
  return orb_place_in(triangles, corner[0], triangle, at) && orb_place_in(triangles, corner[1], triangle, at) &&
         orb_place_in(triangles, corner[2], triangle, at);
}

static int carriers(const orb_place *place) {
  return (place->at[0] != 0) + (place->at[1] != 0) + (place->at[2] != 0);
}

static int32_t find(const int32_t *triangles, const int32_t *twin, const orb_place *const corner[3]) {
  const orb_place *least = corner[0];
  for (int k = 1; k < 3; k++) {
    least = carriers(corner[k]) > carriers(least) ? corner[k] : least;
  }
  int32_t own = least->triangle;
  if (holds(triangles, own, corner)) {
    return own;
  }
  if (carriers(least) == 2) { /* the other side of its edge, which lies opposite the corner that carries nothing */
    int k = least->at[0] == 0 ? 0 : least->at[1] == 0 ? 1 : 2;
    int32_t other = twin[3 * own + (k + 1) % 3] / 3;
    return holds(triangles, other, corner) ? other : -1;
  }
  if (carriers(least) == 1) {
    int32_t start = 3 * own + (least->at[0] != 0 ? 0 : least->at[1] != 0 ? 1 : 2);
    int32_t h = orb_next(twin[start]);
    for (int i = 0; h != start && i < RING; h = orb_next(twin[h]), i++) {
      if (holds(triangles, h / 3, corner)) {
        return h / 3;
      }
    }
  }
  return -1;
}

typedef struct inside_job {
  const orb_mesh *input;
  const int32_t *twin, *triangles;
  const orb_place *places;
  int32_t *of;
} inside_job;

static void inside_body(void *arg, int64_t begin, int64_t end, int thread) {
  const inside_job *job = arg;
  (void)thread;
  for (int64_t t = begin; t < end; t++) {
    const int32_t *v = job->triangles + 3 * t;
    const orb_place *corner[3] = {job->places + v[0], job->places + v[1], job->places + v[2]};
    job->of[t] = find(job->input->triangles, job->twin, corner);
  }
}

orb_status orb_inside_make(orb_context *ctx, const orb_mesh *input, const int32_t *twin, const int32_t *triangles,
                           int32_t triangle_count, const orb_place *places, orb_inside *out) {
  memset(out, 0, sizeof *out);
  out->of = ORB_NEW(ctx, int32_t, triangle_count);
  out->first = ORB_NEW0(ctx, int32_t, (int64_t)input->triangle_count + 1);
  out->held = ORB_NEW(ctx, int32_t, triangle_count);
  if (!out->of || !out->first || !out->held) {
    orb_inside_free(ctx, out);
    return ORB_E_NO_MEMORY;
  }
  inside_job job = {input, twin, triangles, places, out->of};
  orb_parallel_for(ctx, triangle_count, GRAIN, inside_body, &job);
  for (int32_t t = 0; t < triangle_count; t++) {
    if (out->of[t] >= 0) {
      out->first[out->of[t]]++; /* counts, then ends, then, filled from the back, beginnings */
    }
  }
  for (int32_t i = 0; i < input->triangle_count; i++) {
    out->first[i + 1] += out->first[i];
  }
  for (int32_t t = triangle_count - 1; t >= 0; t--) {
    if (out->of[t] >= 0) {
      out->held[--out->first[out->of[t]]] = t;
    }
  }
  return orb_context_check(ctx);
}

void orb_inside_free(orb_context *ctx, orb_inside *inside) {
  orb_free(ctx, inside->of);
  orb_free(ctx, inside->first);
  orb_free(ctx, inside->held);
  memset(inside, 0, sizeof *inside);
}
