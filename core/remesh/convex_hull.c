/* The convex-hull method (Peng & Timalsena 2016, section 8 and Fig. 11), the baseline of the other ones: the hull of
 * all shapes' vertices on the sphere, which is their Delaunay triangulation. It keeps every input vertex, but none of
 * the input edges; how far its surfaces deviate from the shapes is proved afterwards (placed/bound.h), not controlled.
 *
 * Points that are equal bit for bit (landmarks) become one. Qhull works with tolerances: it may omit points very
 * close to each other or to a facet's plane, and facets of nearly collinear points may come out degenerate. The corners
 * of facets that are not positive are set aside and the hull is made again from the rest. What was set aside or left
 * out is then inserted by exact location and splitting, and edges are flipped to those of the hull. The result is
 * certified like any other; where there is no certified start, the method fails with a message. */
#include "remesh/common/job.h"

#include <stdlib.h>
#include <string.h>

#include "base/check.h"
#include "base/context.h"
#include "base/error.h"
#include "base/memory.h"
#include "numeric/predicates.h"
#include "remesh/placed/export.h"
#include "remesh/qhull.h"
#include "sphere/delaunay.h"

enum { ROUNDS = 16 };        /* hulls made; each round sets more points aside */
enum { CHECK_EVERY = 4096 }; /* points between two checks for cancellation */

typedef struct hull_points {
  double *points; /* distinct, in the order of the shapes */
  int32_t count;
  unsigned char *aside; /* per point: not to be given to Qhull (again) */
  double *given;        /* what Qhull gets, and the numbers of these points */
  int32_t *number;
  int32_t given_count;
} hull_points;

static int by_coordinates(const void *a, const void *b) {
  const double *const *p = a, *const *q = b;
  int order = memcmp(*p, *q, 3 * sizeof **p);
  return order ? order : (*p > *q) - (*p < *q);
}

/* Collects all points except those equal to an earlier one, with −0 replaced by 0. */
static orb_status take_points(orb_context *ctx, const orb_remesh_job *job, hull_points *h) {
  int64_t total = 0;
  for (int32_t s = 0; s < job->shape_count; s++) {
    total += job->shapes[s].mesh.vertex_count;
  }
  if (total > ORB_QHULL_POINTS_MAX) {
    return orb_fail(
        ctx, ORB_E_TOO_LARGE,
        "The method 'convex-hull' takes at most %d vertices in all; these shapes have %lld. Use 'adaptive'.",
        ORB_QHULL_POINTS_MAX, (long long)total);
  }
  h->points = ORB_NEW(ctx, double, 3 * total);
  h->given = ORB_NEW(ctx, double, 3 * total);
  h->number = ORB_NEW(ctx, int32_t, total);
  h->aside = ORB_NEW0(ctx, unsigned char, total);
  const double **order = ORB_NEW(ctx, const double *, total);
  if (!h->points || !h->given || !h->number || !h->aside || !order) {
    orb_free(ctx, order);
    return ORB_E_NO_MEMORY;
  }
  int64_t n = 0;
  for (int32_t s = 0; s < job->shape_count; s++) {
    for (int64_t i = 0; i < 3 * (int64_t)job->shapes[s].mesh.vertex_count; i++) {
      h->points[n++] = job->shapes[s].points[i] + 0.0;
    }
  }
  for (int64_t i = 0; i < total; i++) {
    order[i] = h->points + 3 * i;
  }
  qsort(order, (size_t)total, sizeof *order, by_coordinates);
  for (int64_t i = 1; i < total; i++) {
    h->aside[(order[i] - h->points) / 3] = memcmp(order[i], order[i - 1], 3 * sizeof(double)) == 0;
  }
  orb_free(ctx, order);
  for (int64_t i = 0; i < total; i++) {
    if (!h->aside[i]) {
      memmove(h->points + 3 * (int64_t)h->count++, h->points + 3 * i, 3 * sizeof(double));
    }
  }
  memset(h->aside, 0, (size_t)total);
  return orb_context_check(ctx);
}

/* Sets aside the corners of facets that are not positive; returns how many. */
static int32_t set_aside(hull_points *h, const int32_t *triangles, int32_t triangle_count) {
  int32_t found = 0;
  for (int32_t t = 0; t < triangle_count; t++) {
    const int32_t *c = triangles + 3 * (int64_t)t;
    const double *a = h->given + 3 * (int64_t)c[0], *b = h->given + 3 * (int64_t)c[1],
                 *d = h->given + 3 * (int64_t)c[2];
    for (int k = 0; k < 3 && orb_orient(a, b, d) <= 0; k++) {
      found += !h->aside[h->number[c[k]]];
      h->aside[h->number[c[k]]] = 1;
    }
  }
  return found;
}

/* The certified hull of the points that Qhull gets right, as a net; all others are set aside. */
static orb_status start(orb_context *ctx, hull_points *h, orb_net *net) {
  for (int round = 0; round < ROUNDS; round++) {
    h->given_count = 0;
    for (int32_t i = 0; i < h->count; i++) {
      if (!h->aside[i]) {
        h->number[h->given_count] = i;
        memcpy(h->given + 3 * (int64_t)h->given_count++, h->points + 3 * (int64_t)i, 3 * sizeof(double));
      }
    }
    if (h->given_count < 4) {
      break;
    }
    orb_supermesh hull = {.shape_count = 0};
    ORB_TRY(orb_qhull(ctx, h->given, h->given_count, &hull.triangles, &hull.triangle_count));
    if (set_aside(h, hull.triangles, hull.triangle_count) > 0) {
      orb_free(ctx, hull.triangles);
      continue;
    }
    /* Renumber the corners without the points that Qhull omitted; their order stays. */
    orb_status status = ORB_E_NO_MEMORY;
    int32_t *compact = ORB_NEW0(ctx, int32_t, h->given_count);
    if (compact) {
      for (int64_t c = 0; c < 3 * (int64_t)hull.triangle_count; c++) {
        compact[hull.triangles[c]] = 1;
      }
      for (int32_t i = 0; i < h->given_count; i++) {
        h->aside[h->number[i]] = !compact[i];
        if (compact[i]) {
          memmove(h->given + 3 * (int64_t)hull.vertex_count, h->given + 3 * (int64_t)i, 3 * sizeof(double));
          compact[i] = hull.vertex_count++;
        }
      }
      for (int64_t c = 0; c < 3 * (int64_t)hull.triangle_count; c++) {
        hull.triangles[c] = compact[hull.triangles[c]];
      }
      hull.points = h->given; /* borrowed, not freed */
      status = orb_supermesh_check(ctx, &hull);
    }
    if (status == ORB_OK) {
      status = orb_net_init(ctx, net, h->given, hull.vertex_count, hull.triangles, hull.triangle_count, NULL, h->count);
    }
    orb_free(ctx, compact);
    orb_free(ctx, hull.triangles);
    return status;
  }
  return orb_fail(
      ctx, ORB_E_NOT_CERTIFIED,
      "The convex hull has degenerate facets because vertices lie too close together on the sphere. Use 'adaptive'.");
}

/* Makes the points that are not in the net yet vertices of it. */
static orb_status insert_rest(orb_context *ctx, const hull_points *h, orb_net *net) {
  orb_locator *locator = NULL;
  int64_t inserted = 0;
  orb_status status =
      orb_locator_create(ctx, net->points, net->vertex_count, net->triangles, net->triangle_count, net->twin, &locator);
  int32_t *near = ORB_NEW(ctx, int32_t, h->count);
  if (status == ORB_OK && !near) {
    status = ORB_E_NO_MEMORY;
  }
  for (int32_t i = 0; i < h->count && status == ORB_OK; i++) {
    orb_place place;
    if (h->aside[i]) { /* located before the first split, which the locator does not know */
      orb_locate(locator, h->points + 3 * (int64_t)i, -1, &place);
      near[i] = place.triangle;
    }
  }
  orb_locator_destroy(ctx, locator);
  for (int32_t i = 0; i < h->count && status == ORB_OK; i++) {
    if (h->aside[i]) {
      (void)orb_net_insert(net, h->points + 3 * (int64_t)i, &near[i]);
      inserted++;
    }
    if (i % CHECK_EVERY == 0) {
      status = orb_context_check(ctx);
    }
  }
  orb_free(ctx, near);
  return status == ORB_OK && inserted > 0 ? orb_net_delaunay(ctx, net) : status;
}

orb_status orb_remesh_convex_hull(orb_context *ctx, const orb_remesh_job *job, orb_supermesh *out) {
  hull_points h = {0};
  orb_net net = {0};
  orb_placed_net placed = {0};
  orb_status status;
  ORB_GO(status, take_points(ctx, job, &h), end);
  orb_progress(ctx, "remesh", 0.1);
  ORB_GO(status, start(ctx, &h, &net), end);
  orb_progress(ctx, "remesh", 0.5);
  ORB_GO(status, insert_rest(ctx, &h, &net), end);
  if (job->options->max_triangles > 0 && net.triangle_count > job->options->max_triangles) {
    status = orb_fail(ctx, ORB_E_BAD_OPTION,
                      "The convex hull keeps all vertices and needs %d triangles, more than max_triangles = %lld; use "
                      "'adaptive' for fewer.",
                      net.triangle_count, (long long)job->options->max_triangles);
    goto end;
  }
  ORB_GO(status, orb_placed_create_on(ctx, job, &net, &placed), end);
  orb_progress(ctx, "remesh", 0.8);
  ORB_GO(status, orb_placed_export(ctx, &placed, out), end);
end:
  orb_placed_free(ctx, &placed);
  orb_net_free(ctx, &net);
  orb_free(ctx, h.points);
  orb_free(ctx, h.given);
  orb_free(ctx, h.number);
  orb_free(ctx, h.aside);
  return status;
}
