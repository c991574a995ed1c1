/* What is done with whole nets: Delaunay turns, and the hand-over as a supermesh. */
#include <string.h>

#include "numeric/vec3.h"
#include "remesh/net.h"

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

orb_status orb_net_export(orb_context *ctx, const orb_net *net, orb_supermesh *out, int32_t *map) {
  int32_t vertices = 0, triangles = 0;
  for (int32_t v = 0; v < net->vertex_count; v++) {
    vertices += net->out[v] >= 0;
  }
  for (int32_t t = 0; t < net->triangle_count; t++) {
    triangles += net->triangles[3 * t] >= 0;
  }
  int32_t *number = map ? map : ORB_NEW(ctx, int32_t, net->vertex_count);
  out->points = ORB_NEW(ctx, double, 3 * (int64_t)vertices);
  out->triangles = ORB_NEW(ctx, int32_t, 3 * (int64_t)triangles);
  orb_status status = number && out->points && out->triangles ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    for (int32_t v = 0; v < net->vertex_count; v++) {
      number[v] = -1;
      if (net->out[v] >= 0) {
        number[v] = out->vertex_count++;
        memcpy(out->points + 3 * (int64_t)number[v], orb_net_point(net, v), 3 * sizeof(double));
      }
    }
    for (int32_t t = 0; t < net->triangle_count; t++) {
      for (int k = 0; k < 3 && net->triangles[3 * t] >= 0; k++) {
        out->triangles[3 * (int64_t)out->triangle_count + k] = number[net->triangles[3 * t + k]];
      }
      out->triangle_count += net->triangles[3 * t] >= 0;
    }
  }
  if (!map) {
    orb_free(ctx, number);
  }
  return status;
}
