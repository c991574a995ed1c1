/* A place names one triangle, but a place on an edge lies in two, and a place at a vertex in all around it. The corner
 * that lies in the fewest triangles gives the candidates; whether the other two lie in a candidate follows from the
 * numbers of the vertices that carry them. There is no arithmetic, so nothing is rounded. */
#include "transfer/inside.h"

#include <string.h>

#include "base/memory.h"
#include "base/parallel.h"

enum { GRAIN = 2048 }; /* triangles a thread takes at a time */
enum { RING = 64 };    /* triangles visited around a vertex: bounds the time at vertices of high degree */

typedef struct inside_job {
  const orb_mesh *input;
  const int32_t *triangles;
  const orb_place *places;
  orb_inside *inside;
} inside_job;

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

/* The vertex with the fewest triangles around it among those that carry the place. */
static int32_t least_carrier(const inside_job *job, const orb_place *place) {
  const int32_t *corner = job->input->triangles + 3 * (int64_t)place->triangle, *first = job->inside->ring_first;
  int32_t least = -1;
  for (int k = 0; k < 3; k++) {
    int32_t v = corner[k];
    if (place->at[k] != 0 && (least < 0 || first[v + 1] - first[v] < first[least + 1] - first[least])) {
      least = v;
    }
  }
  return least;
}

static int32_t find(const inside_job *job, const orb_place *const corner[3]) {
  const int32_t *triangles = job->input->triangles;
  const orb_place *least = corner[0];
  for (int k = 1; k < 3; k++) {
    least = carriers(corner[k]) > carriers(least) ? corner[k] : least;
  }
  if (holds(triangles, least->triangle, corner)) {
    return least->triangle;
  }
  int32_t v = least_carrier(job, least);
  if (v >= 0 && carriers(least) < 3) {
    const int32_t *ring = job->inside->ring + job->inside->ring_first[v];
    int32_t size = job->inside->ring_first[v + 1] - job->inside->ring_first[v];
    for (int32_t i = 0; i < size && i < RING; i++) {
      if (holds(triangles, ring[i] / 3, corner)) {
        return ring[i] / 3;
      }
    }
  }
  return -1;
}

static void inside_body(void *arg, int64_t begin, int64_t end, int thread) {
  const inside_job *job = arg;
  (void)thread;
  for (int64_t t = begin; t < end; t++) {
    const int32_t *v = job->triangles + 3 * t;
    const orb_place *corner[3] = {job->places + v[0], job->places + v[1], job->places + v[2]};
    job->inside->of[t] = find(job, corner);
  }
}

static void make_rings(const orb_mesh *input, orb_inside *out) {
  for (int32_t h = 0; h < 3 * input->triangle_count; h++) {
    out->ring_first[input->triangles[h]]++; /* counts, then ends, then, filled from the back, beginnings */
  }
  for (int32_t v = 0; v < input->vertex_count; v++) {
    out->ring_first[v + 1] += out->ring_first[v];
  }
  for (int32_t h = 3 * input->triangle_count - 1; h >= 0; h--) {
    out->ring[--out->ring_first[input->triangles[h]]] = h;
  }
}

orb_status orb_inside_make(orb_context *ctx, const orb_mesh *input, const int32_t *triangles, int32_t triangle_count,
                           const orb_place *places, orb_inside *out) {
  memset(out, 0, sizeof *out);
  out->of = ORB_NEW(ctx, int32_t, triangle_count);
  out->first = ORB_NEW0(ctx, int32_t, (int64_t)input->triangle_count + 1);
  out->held = ORB_NEW(ctx, int32_t, triangle_count);
  out->ring_first = ORB_NEW0(ctx, int32_t, (int64_t)input->vertex_count + 1);
  out->ring = ORB_NEW(ctx, int32_t, 3 * (int64_t)input->triangle_count);
  if (!out->of || !out->first || !out->held || !out->ring_first || !out->ring) {
    orb_inside_free(ctx, out);
    return ORB_E_NO_MEMORY;
  }
  make_rings(input, out);
  inside_job job = {input, triangles, places, out};
  orb_parallel_for(ctx, triangle_count, GRAIN, inside_body, &job);
  for (int32_t t = 0; t < triangle_count; t++) {
    if (out->of[t] >= 0) {
      out->first[out->of[t]]++; /* as above */
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
  orb_free(ctx, inside->ring_first);
  orb_free(ctx, inside->ring);
  memset(inside, 0, sizeof *inside);
}
