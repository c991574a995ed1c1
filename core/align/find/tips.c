/* Tips of limbs by distances along the surface.
 *
 * The mean distance of a point from the rest of the surface is greatest at the tips of limbs (the integral geodesic of
 * Hilaga et al. 2001, as Zhang et al. 2005 use it). A few sources, spread by farthest points, represent all points.
 */
#include "align/find/tips.h"

#include <math.h>
#include <string.h>

#include "align/find/params.h"
#include "base/check.h"
#include "base/memory.h"
#include "spectral/distances.h"

/* The mean distance of every vertex from the sources; *mean: over all vertices. buffer: two doubles a vertex. */
static orb_status mean_distances(orb_context *ctx, orb_distances *g, double *far, double *buffer, double *mean) {
  double *one = buffer, *nearest = buffer + g->vertices;
  int32_t source = 0;
  for (int32_t v = 0; v < g->vertices; v++) {
    far[v] = 0;
    nearest[v] = INFINITY;
  }
  for (int i = -1; i < ORB_FIND_SOURCES; i++) { /* round −1 only finds the first source */
    orb_distances_from(g, source, one);
    int32_t next = 0;
    for (int32_t v = 0; v < g->vertices; v++) {
      far[v] += i < 0 ? 0 : one[v] / ORB_FIND_SOURCES;
      nearest[v] = i < 1 || one[v] < nearest[v] ? one[v] : nearest[v];
      next = nearest[v] > nearest[next] ? v : next;
    }
    source = next;
    ORB_TRY(orb_context_check(ctx));
  }
  *mean = 0;
  for (int32_t v = 0; v < g->vertices; v++) {
    *mean += far[v] / g->vertices;
  }
  return ORB_OK;
}

static int is_peak(const orb_distances *g, const double *far, int32_t v) {
  for (int32_t i = g->start[v]; i < g->start[v + 1]; i++) {
    int32_t u = g->link[i].vertex;
    if (far[u] > far[v] || (far[u] == far[v] && u < v)) {
      return 0;
    }
  }
  return 1;
}

/* The farthest peak that is beyond `least` and not near another tip; −1: none. */
static int32_t next_peak(const orb_distances *g, const double *far, const unsigned char *near, double least) {
  int32_t best = -1;
  for (int32_t v = 0; v < g->vertices; v++) {
    if (!near[v] && far[v] > least && (best < 0 || far[v] > far[best]) && is_peak(g, far, v)) {
      best = v;
    }
  }
  return best;
}

static orb_status find(orb_context *ctx, orb_distances *g, double *buffer, unsigned char *near, orb_tips *out) {
  double *far = buffer, *one = buffer + g->vertices, mean;
  ORB_TRY(mean_distances(ctx, g, far, one, &mean));
  for (int32_t v; out->count < ORB_TIPS_MAX && (v = next_peak(g, far, near, ORB_FIND_TIP_LEAST * mean)) >= 0;) {
    int is_highest = 1;
    orb_distances_from(g, v, one);
    for (int32_t u = 0; u < g->vertices; u++) {
      if (one[u] < ORB_FIND_TIPS_APART * mean) {
        near[u] = 1;
        is_highest = is_highest && far[u] <= far[v];
      }
    }
    if (is_highest) {
      int32_t k = out->count++;
      out->vertex[k] = v;
      out->far[k] = far[v] / mean;
      for (int32_t i = 0; i <= k; i++) {
        out->distance[i][k] = out->distance[k][i] = one[out->vertex[i]] / mean;
      }
    }
    ORB_TRY(orb_context_check(ctx));
  }
  return ORB_OK;
}

orb_status orb_tips_find(orb_context *ctx, const orb_mesh *mesh, orb_tips *out) {
  orb_status status;
  orb_distances g = {0};
  double *buffer = ORB_NEW(ctx, double, 3 * (size_t)mesh->vertex_count);
  unsigned char *near = ORB_NEW0(ctx, unsigned char, mesh->vertex_count);
  memset(out, 0, sizeof *out);
  if (!buffer || !near) {
    status = ORB_E_NO_MEMORY;
    goto end;
  }
  ORB_GO(status, orb_distances_create(ctx, mesh, &g), end);
  status = find(ctx, &g, buffer, near, out);
end:
  orb_distances_free(ctx, &g);
  orb_free(ctx, buffer);
  orb_free(ctx, near);
  return status;
}
