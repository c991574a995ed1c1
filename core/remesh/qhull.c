/* Qhull (Barber, Dobkin & Huhdanpaa 1996) behind orb_qhull().
 *
 * Option Qt triangulates facets that were merged because their points are coplanar up to rounding; points are never
 * joggled. Qhull leaves its calls by longjmp() on errors, but qh_new_qhull() catches that itself and returns a code.
 * Its messages go to a stream that drops them. As Qhull reports every 500 facets (TF500), the stream's write function
 * also checks for cancellation, and then tells Qhull to add no further points. */
#include "remesh/qhull.h"

#include <stdio.h>

#if defined(__GNUC__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wstrict-prototypes"
#endif
#include <libqhull_r/qhull_ra.h>
#if defined(__GNUC__)
#pragma GCC diagnostic pop
#endif

#include "base/check.h"
#include "base/error.h"
#include "base/memory.h"
#include "numeric/predicates.h"

enum { BYTES_A_POINT = 1024 }; /* of the budget, for Qhull's own memory */

typedef struct listener {
  orb_context *ctx;
  qhT *qh;
  orb_status status;
} listener;

static ssize_t listen_in(void *cookie, const char *text, size_t size) {
  listener *l = cookie;
  (void)text;
  if (l->status == ORB_OK) {
    l->status = orb_context_check(l->ctx);
  }
  if (l->status != ORB_OK) {
    l->qh->STOPadd = 1;
  }
  return (ssize_t)size;
}

/* A stream whose writes go to listen_in(); NULL without memory. */
#if defined(__APPLE__)
static int listen_in_bsd(void *cookie, const char *text, int size) {
  return (int)listen_in(cookie, text, (size_t)size);
}

static FILE *open_listener(listener *l) {
  return funopen(l, NULL, listen_in_bsd, NULL, NULL);
}
#else
static FILE *open_listener(listener *l) {
  return fopencookie(l, "w", (cookie_io_functions_t){.write = listen_in});
}
#endif

/* Makes the hull face outward: if most triangles are negative, reverses all. */
static void orient_outward(const double *points, int32_t *triangles, int32_t count) {
  int64_t sum = 0;
  for (int32_t t = 0; t < count; t++) {
    const int32_t *c = triangles + 3 * (int64_t)t;
    sum += orb_orient(points + 3 * (int64_t)c[0], points + 3 * (int64_t)c[1], points + 3 * (int64_t)c[2]);
  }
  for (int32_t t = 0; t < count && sum < 0; t++) {
    int32_t *c = triangles + 3 * (int64_t)t, swap = c[1];
    c[1] = c[2];
    c[2] = swap;
  }
}

static orb_status take_facets(orb_context *ctx, qhT *qh, const double *points, int32_t **triangles,
                              int32_t *triangle_count) {
  int32_t count = 0;
  facetT *facet;
  vertexT *vertex, **vertexp;
  *triangles = ORB_NEW(ctx, int32_t, 3 * (int64_t)qh->num_facets);
  if (!*triangles) {
    return ORB_E_NO_MEMORY;
  }
  FORALLfacets {
    int32_t corner[3] = {0};
    int n = 0;
    FOREACHvertex_(facet->vertices) {
      if (n < 3) {
        corner[n] = (int32_t)((vertex->point - points) / 3);
      }
      n++;
    }
    if (n != 3 || count >= qh->num_facets) {
      return orb_fail(ctx, ORB_E_NOT_CERTIFIED, "The convex hull has a facet that is not a triangle; use 'adaptive'.");
    }
    int32_t *c = *triangles + 3 * (int64_t)count++;
    c[0] = corner[0];
    c[1] = corner[facet->toporient ? 1 : 2];
    c[2] = corner[facet->toporient ? 2 : 1];
  }
  orient_outward(points, *triangles, count);
  *triangle_count = count;
  return ORB_OK;
}

static orb_status run(orb_context *ctx, qhT *qh, double *points, int32_t count, int32_t **triangles,
                      int32_t *triangle_count) {
  char command[] = "qhull Qt Q12 Pp TF500";
  listener l = {.ctx = ctx, .qh = qh};
  FILE *messages = open_listener(&l);
  if (!messages) {
    return orb_fail(ctx, ORB_E_NO_MEMORY, "There is not enough memory for the convex hull.");
  }
  (void)setvbuf(messages, NULL, _IONBF, 0);
  qh_zero(qh, messages);
  int code = qh_new_qhull(qh, 3, count, points, False, command, NULL, messages);
  orb_status status = l.status;
  if (status == ORB_OK && code == qh_ERRmem) {
    status = orb_fail(ctx, ORB_E_NO_MEMORY, "There is not enough memory for the convex hull of %d points.", count);
  } else if (status == ORB_OK && code != 0) {
    status = orb_fail(ctx, ORB_E_NOT_CERTIFIED,
                      "Qhull failed on the convex hull of the %d points (code %d); use 'adaptive'.", count, code);
  }
  if (status == ORB_OK) {
    status = take_facets(ctx, qh, points, triangles, triangle_count);
  }
  int long_blocks, long_bytes;
  qh_freeqhull(qh, !qh_ALL);
  qh_memfreeshort(qh, &long_blocks, &long_bytes);
  (void)fclose(messages);
  return status;
}

orb_status orb_qhull(orb_context *ctx, const double *points, int32_t count, int32_t **triangles,
                     int32_t *triangle_count) {
  *triangles = NULL;
  *triangle_count = 0;
  if (count > ORB_QHULL_POINTS_MAX) {
    return orb_fail(ctx, ORB_E_TOO_LARGE, "A convex hull takes at most %d points, not %d; use 'adaptive'.",
                    ORB_QHULL_POINTS_MAX, count);
  }
  /* Qhull takes a pointer that is not const: it gets a copy, so that it cannot change the caller's points. */
  double *copy = ORB_NEW(ctx, double, 3 * (int64_t)count);
  char *reserve = ORB_NEW(ctx, char, ((int64_t)count * BYTES_A_POINT));
  qhT *qh = ORB_NEW0(ctx, qhT, 1);
  orb_status status = ORB_E_NO_MEMORY;
  if (copy && reserve && qh) {
    for (int64_t i = 0; i < 3 * (int64_t)count; i++) {
      copy[i] = points[i];
    }
    status = run(ctx, qh, copy, count, triangles, triangle_count);
  }
  orb_free(ctx, qh);
  orb_free(ctx, reserve);
  orb_free(ctx, copy);
  if (status != ORB_OK) {
    orb_free(ctx, *triangles);
    *triangles = NULL;
  }
  return status;
}
