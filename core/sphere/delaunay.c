/* Delaunay edge flips over a whole net (Lawson 1977). */
#include "sphere/delaunay.h"

#include "base/memory.h"
#include "numeric/vec3.h"

/* How far beyond the plane a point must lie, relative to its distance: rounding cannot make the flips cycle. */
static const double CLEARLY = 1e-9;
/* Flips per edge after which the loop ends in any case; Lawson's flips are about linear in the number of edges. */
enum { FLIPS_AN_EDGE = 64 };
enum { CHECK_EVERY = 8192 }; /* flips between two checks for cancellation */

/* Points on the sphere are Delaunay where the flat triangles form a convex hull: d must not lie beyond plane abc. */
static int violates_delaunay(const orb_net *net, int32_t h) {
  int32_t g = net->twin[h];
  const double *a = orb_net_point(net, net->triangles[h]), *b = orb_net_point(net, net->triangles[g]);
  const double *c = orb_net_point(net, net->triangles[orb_prev(h)]);
  const double *d = orb_net_point(net, net->triangles[orb_prev(g)]);
  double u[3], v[3], w[3], n[3];
  orb_sub(b, a, u);
  orb_sub(c, a, v);
  orb_sub(d, a, w);
  orb_cross(u, v, n);
  return orb_dot(n, w) > CLEARLY * orb_length(n) * orb_dot(w, w);
}

orb_status orb_net_delaunay(orb_context *ctx, orb_net *net) {
  int32_t edges = 3 * net->triangle_count, top = 0;
  int32_t *stack = ORB_NEW(ctx, int32_t, edges);
  unsigned char *queued = ORB_NEW0(ctx, unsigned char, edges);
  orb_status status = stack && queued ? ORB_OK : ORB_E_NO_MEMORY;
  for (int32_t h = edges - 1; h >= 0 && status == ORB_OK; h--) {
    if (h < net->twin[h]) {
      stack[top++] = h;
      queued[h] = 1;
    }
  }
  int64_t flips = 0, limit = FLIPS_AN_EDGE * (int64_t)edges;
  while (status == ORB_OK && top > 0 && flips < limit) {
    int32_t h = stack[--top];
    queued[h] = 0;
    if (!violates_delaunay(net, h) || !orb_net_can_flip(net, h)) {
      continue;
    }
    orb_net_flip(net, h);
    int32_t ring[4] = {orb_next(h), orb_prev(h), orb_next(net->twin[h]), orb_prev(net->twin[h])};
    for (int k = 0; k < 4; k++) {
      int32_t e = ring[k] < net->twin[ring[k]] ? ring[k] : net->twin[ring[k]];
      if (!queued[e]) {
        queued[e] = 1;
        stack[top++] = e;
      }
    }
    if (++flips % CHECK_EVERY == 0) {
      status = orb_context_check(ctx);
    }
  }
  orb_free(ctx, stack);
  orb_free(ctx, queued);
  return status;
}
