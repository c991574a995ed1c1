/* Delaunay edge flips over a whole net (Lawson 1977). */
#include "sphere/delaunay.h"
#include "numeric/vec3.h"

/* Points on the sphere are Delaunay where the flat triangles form a convex hull: d must not lie beyond plane abc.
 * Only clear cases count, so that rounding cannot make the turns circle. */
static int not_delaunay(const orb_net *net, int32_t h) {
  int32_t g = net->twin[h];
  const double *a = orb_net_point(net, net->triangles[h]), *b = orb_net_point(net, net->triangles[g]);
  const double *c = orb_net_point(net, net->triangles[orb_prev(h)]);
  const double *d = orb_net_point(net, net->triangles[orb_prev(g)]);
  double u[3], v[3], w[3], n[3];
  orb_sub(b, a, u);
  orb_sub(c, a, v);
  orb_sub(d, a, w);
  orb_cross(u, v, n);
  return orb_dot(n, w) > 1e-9 * orb_length(n) * orb_dot(w, w);
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
  int64_t turns = 0, limit = 64 * (int64_t)edges; /* a bound in case of rounding; Lawson's turns are about linear */
  while (status == ORB_OK && top > 0 && turns < limit) {
    int32_t h = stack[--top];
    queued[h] = 0;
    if (!not_delaunay(net, h) || !orb_net_can_flip(net, h)) {
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
    if ((++turns & 8191) == 0) {
      status = orb_context_check(ctx);
    }
  }
  orb_free(ctx, stack);
  orb_free(ctx, queued);
  return status;
}
