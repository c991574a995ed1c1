/* Splits of a triangle and of an edge each add one vertex and two triangles, so T = 2V − 4 always holds. */
#include "sphere/net.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/error.h"
#include "base/memory.h"
#include "numeric/predicates.h"
#include "numeric/vec3.h"

/* A clearly positive triangle is higher than 1 / CLEARLY of its longest side. */
static const double CLEARLY = 1e6;

static int32_t origin(const orb_net *net, int32_t h) {
  return net->triangles[h];
}

orb_status orb_net_reserve(orb_context *ctx, orb_net *net, int64_t more) {
  int64_t vertices = (int64_t)net->vertex_count + more;
  if (vertices <= net->vertex_capacity) {
    return ORB_OK;
  }
  vertices += vertices / 4;
  if (vertices > INT32_MAX / 6) {
    return orb_fail(ctx, ORB_E_TOO_LARGE, "The supermesh would need more than %d vertices; send smaller meshes.",
                    INT32_MAX / 6);
  }
  double *points = orb_realloc(ctx, net->points, 3 * (size_t)vertices, sizeof(double));
  if (points) {
    net->points = points;
  }
  int32_t *out = points ? orb_realloc(ctx, net->out, (size_t)vertices, sizeof(int32_t)) : NULL;
  if (out) {
    net->out = out;
  }
  int32_t *triangles = out ? orb_realloc(ctx, net->triangles, 6 * (size_t)vertices, sizeof(int32_t)) : NULL;
  if (triangles) {
    net->triangles = triangles;
  }
  int32_t *twin = triangles ? orb_realloc(ctx, net->twin, 6 * (size_t)vertices, sizeof(int32_t)) : NULL;
  if (!twin) {
    return ORB_E_NO_MEMORY;
  }
  net->twin = twin;
  net->vertex_capacity = (int32_t)vertices;
  net->triangle_capacity = 2 * (int32_t)vertices;
  return ORB_OK;
}

orb_status orb_net_init(orb_context *ctx, orb_net *net, const double *points, int32_t vertex_count,
                        const int32_t *triangles, int32_t triangle_count, const int32_t *twin,
                        int64_t vertex_capacity) {
  memset(net, 0, sizeof *net);
  orb_status status = orb_net_reserve(ctx, net, vertex_capacity > vertex_count ? vertex_capacity : vertex_count);
  if (status == ORB_OK && twin) {
    memcpy(net->twin, twin, 3 * (size_t)triangle_count * sizeof *twin);
  } else if (status == ORB_OK) {
    status = orb_mesh_twins(ctx, triangles, triangle_count, vertex_count, net->twin);
  }
  if (status != ORB_OK) {
    orb_net_free(ctx, net);
    return status;
  }
  net->vertex_count = vertex_count;
  net->triangle_count = triangle_count;
  memcpy(net->points, points, 3 * (size_t)vertex_count * sizeof *points);
  memcpy(net->triangles, triangles, 3 * (size_t)triangle_count * sizeof *triangles);
  for (int32_t h = 3 * triangle_count - 1; h >= 0; h--) {
    net->out[triangles[h]] = h;
  }
  return ORB_OK;
}

void orb_net_free(orb_context *ctx, orb_net *net) {
  orb_free(ctx, net->points);
  orb_free(ctx, net->triangles);
  orb_free(ctx, net->twin);
  orb_free(ctx, net->out);
  memset(net, 0, sizeof *net);
}

orb_sphere_view orb_net_view(const orb_net *net) {
  return (orb_sphere_view){net->points, net->triangles, net->twin, net->triangle_count};
}

static void join(orb_net *net, int32_t g, int32_t h) {
  net->twin[g] = h;
  net->twin[h] = g;
}

static void set_triangle(orb_net *net, int32_t t, int32_t a, int32_t b, int32_t c) {
  net->triangles[3 * t] = a;
  net->triangles[3 * t + 1] = b;
  net->triangles[3 * t + 2] = c;
  net->out[a] = 3 * t;
  net->out[b] = 3 * t + 1;
  net->out[c] = 3 * t + 2;
}

static int32_t new_vertex(orb_net *net, const double p[3]) {
  ORB_ASSERT(net->vertex_count < net->vertex_capacity);
  memcpy(net->points + 3 * (int64_t)net->vertex_count, p, 3 * sizeof(double));
  return net->vertex_count++;
}

/* (a,b,c) becomes (a,b,v), (b,c,v), (c,a,v). */
static int32_t split_triangle(orb_net *net, int32_t t, const double p[3]) {
  int32_t a = origin(net, 3 * t), b = origin(net, 3 * t + 1), c = origin(net, 3 * t + 2);
  int32_t bc = net->twin[3 * t + 1], ca = net->twin[3 * t + 2];
  int32_t v = new_vertex(net, p), u = net->triangle_count, w = u + 1;
  net->triangle_count += 2;
  set_triangle(net, t, a, b, v);
  set_triangle(net, u, b, c, v);
  set_triangle(net, w, c, a, v);
  join(net, 3 * u, bc);
  join(net, 3 * w, ca);
  join(net, 3 * t + 1, 3 * u + 2);
  join(net, 3 * u + 1, 3 * w + 2);
  join(net, 3 * w + 1, 3 * t + 2);
  return v;
}

/* h = a→b of (a,b,c), twin in (b,a,d): (a,v,c), (v,b,c), (b,v,d), (v,a,d). */
static int32_t split_edge(orb_net *net, int32_t h, const double p[3]) {
  int32_t g = net->twin[h], t = h / 3, s = g / 3;
  int32_t a = origin(net, h), b = origin(net, g), c = origin(net, orb_prev(h)), d = origin(net, orb_prev(g));
  int32_t bc = net->twin[orb_next(h)], ca = net->twin[orb_prev(h)];
  int32_t ad = net->twin[orb_next(g)], db = net->twin[orb_prev(g)];
  int32_t v = new_vertex(net, p), u = net->triangle_count, w = u + 1;
  net->triangle_count += 2;
  set_triangle(net, t, a, v, c);
  set_triangle(net, u, v, b, c);
  set_triangle(net, s, b, v, d);
  set_triangle(net, w, v, a, d);
  join(net, 3 * t + 2, ca);
  join(net, 3 * u + 1, bc);
  join(net, 3 * s + 2, db);
  join(net, 3 * w + 1, ad);
  join(net, 3 * t, 3 * w);
  join(net, 3 * u, 3 * s);
  join(net, 3 * t + 1, 3 * u + 2);
  join(net, 3 * s + 1, 3 * w + 2);
  return v;
}

int32_t orb_net_insert(orb_net *net, const double p[3], int32_t *triangle) {
  orb_sphere_view view = orb_net_view(net);
  orb_hit hit = orb_walk(&view, p, *triangle);
  *triangle = hit.triangle;
  int corner = orb_hit_corner(&hit);
  if (corner >= 0) {
    return origin(net, 3 * hit.triangle + corner);
  }
  int32_t edge = orb_hit_edge(&hit);
  return edge >= 0 ? split_edge(net, edge, p) : split_triangle(net, hit.triangle, p);
}

int32_t orb_net_split_edge(orb_net *net, int32_t h, const double p[3]) {
  for (int side = 0; side < 2; side++) {
    int32_t e = side ? net->twin[h] : h;
    const double *a = orb_net_point(net, origin(net, e)), *b = orb_net_point(net, origin(net, orb_next(e)));
    const double *c = orb_net_point(net, origin(net, orb_prev(e)));
    if (orb_orient(a, p, c) <= 0 || orb_orient(p, b, c) <= 0) {
      return -1;
    }
  }
  return split_edge(net, h, p);
}

int orb_net_is_clearly_positive(const orb_net *net, int32_t a, int32_t b, int32_t c) {
  const double *p = orb_net_point(net, a), *q = orb_net_point(net, b), *r = orb_net_point(net, c);
  double height = CLEARLY * orb_det(p, q, r);
  return height > orb_distance2(p, q) && height > orb_distance2(q, r) && height > orb_distance2(r, p) &&
         orb_orient(p, q, r) > 0;
}

int32_t orb_net_edge(const orb_net *net, int32_t v, int32_t w) {
  int32_t first = net->out[v], h = first;
  do {
    if (origin(net, orb_next(h)) == w) {
      return h;
    }
    h = net->twin[orb_prev(h)];
  } while (h != first);
  return -1;
}

int orb_net_adjacent(const orb_net *net, int32_t a, int32_t b) {
  return orb_net_edge(net, a, b) >= 0;
}

int orb_net_can_flip(const orb_net *net, int32_t h) {
  int32_t g = net->twin[h];
  int32_t a = origin(net, h), b = origin(net, g), c = origin(net, orb_prev(h)), d = origin(net, orb_prev(g));
  return c != d && orb_net_clearly_positive(net, c, d, b) && orb_net_clearly_positive(net, d, c, a) &&
         !orb_net_adjacent(net, c, d);
}

/* h = a→b of (a,b,c), twin in (b,a,d). The corners are set so that half-edge h stays the flipped edge:
 * (c,d,b) with h = c→d and (d,c,a) with twin[h] = d→c. */
void orb_net_flip(orb_net *net, int32_t h) {
  int32_t g = net->twin[h];
  int32_t a = origin(net, h), b = origin(net, g), c = origin(net, orb_prev(h)), d = origin(net, orb_prev(g));
  int32_t bc = net->twin[orb_next(h)], ca = net->twin[orb_prev(h)];
  int32_t ad = net->twin[orb_next(g)], db = net->twin[orb_prev(g)];
  int32_t hn = orb_next(h), hp = orb_prev(h), gn = orb_next(g), gp = orb_prev(g);
  net->triangles[h] = c;
  net->triangles[hn] = d;
  net->triangles[hp] = b;
  net->triangles[g] = d;
  net->triangles[gn] = c;
  net->triangles[gp] = a;
  join(net, hn, db);
  join(net, hp, bc);
  join(net, gn, ca);
  join(net, gp, ad);
  net->out[a] = gp;
  net->out[b] = hp;
  net->out[c] = h;
  net->out[d] = g;
}

int orb_net_can_collapse(const orb_net *net, int32_t h) {
  int32_t v = origin(net, orb_next(h)), first = h, e = h, shared = 0;
  do {
    shared += orb_net_adjacent(net, v, origin(net, orb_next(e)));
    e = net->twin[orb_prev(e)];
  } while (e != first);
  return shared == 2 && net->triangle_count > 4;
}

void orb_net_collapse(orb_net *net, int32_t h) {
  int32_t u = origin(net, h), v = origin(net, orb_next(h)), g = net->twin[h], e = h;
  int32_t apex[2] = {origin(net, orb_prev(h)), origin(net, orb_prev(g))};
  int32_t sides[2][2] = {{net->twin[orb_next(h)], net->twin[orb_prev(h)]},
                         {net->twin[orb_next(g)], net->twin[orb_prev(g)]}};
  do {
    net->triangles[e] = v;
    e = net->twin[orb_prev(e)];
  } while (e != h);
  for (int i = 0; i < 2; i++) {
    join(net, sides[i][0], sides[i][1]);
    int32_t at_apex = origin(net, sides[i][0]) == apex[i] ? sides[i][0] : sides[i][1];
    net->out[apex[i]] = at_apex;
    net->out[v] = net->twin[at_apex];
  }
  for (int k = 0; k < 3; k++) {
    net->triangles[h - h % 3 + k] = net->triangles[g - g % 3 + k] = -1;
  }
  net->out[u] = -1;
}

void orb_net_fill(orb_net *net, int32_t h, int n, int (*triangles)[3]) {
  int32_t slot[ORB_FILL_MOST], outer[ORB_FILL_MOST], ring[ORB_FILL_MOST], inner[ORB_FILL_MOST][ORB_FILL_MOST];
  int32_t u = origin(net, h);
  for (int i = 0; i < n; i++) {
    slot[i] = h / 3;
    outer[i] = net->twin[orb_next(h)];
    ring[i] = origin(net, orb_next(h));
    h = net->twin[orb_prev(h)];
  }
  for (int t = 0; t < n - 2; t++) {
    const int *c = triangles[t];
    set_triangle(net, slot[t], ring[c[0]], ring[c[1]], ring[c[2]]);
    for (int k = 0; k < 3; k++) {
      inner[c[k]][c[(k + 1) % 3]] = 3 * slot[t] + k;
    }
  }
  for (int t = 0; t < n - 2; t++) {
    for (int k = 0; k < 3; k++) {
      int a = triangles[t][k], b = triangles[t][(k + 1) % 3];
      join(net, inner[a][b], b == (a + 1) % n ? outer[a] : inner[b][a]);
    }
  }
  for (int t = n - 2; t < n; t++) {
    for (int k = 0; k < 3; k++) {
      net->triangles[3 * slot[t] + k] = -1;
    }
  }
  net->out[u] = -1;
}

int32_t orb_net_star(orb_net *net, const int32_t *triangles, int count, const int32_t *edges, int n,
                     const int32_t *inner, int inner_count, int32_t p) {
  int32_t ring[ORB_STAR_MOST], outer[ORB_STAR_MOST], slot[ORB_STAR_MOST];
  for (int i = 0; i < n; i++) {
    ring[i] = origin(net, edges[i]);
    outer[i] = net->twin[edges[i]];
    slot[i] = i < count ? triangles[i] : net->triangle_count++;
  }
  for (int i = 0; i < inner_count; i++) {
    net->out[inner[i]] = -1;
  }
  for (int i = n; i < count; i++) {
    for (int k = 0; k < 3; k++) {
      net->triangles[3 * triangles[i] + k] = -1;
    }
  }
  net->vertex_count += p == net->vertex_count;
  for (int i = 0; i < n; i++) {
    set_triangle(net, slot[i], p, ring[i], ring[(i + 1) % n]);
    join(net, 3 * slot[i] + 1, outer[i]);
  }
  for (int i = 0; i < n; i++) {
    join(net, 3 * slot[i] + 2, 3 * slot[(i + 1) % n]);
  }
  return slot[0];
}

int orb_net_move(orb_net *net, int32_t v, const double p[3]) {
  int32_t first = net->out[v], h = first;
  do {
    const double *b = orb_net_point(net, origin(net, orb_next(h)));
    const double *c = orb_net_point(net, origin(net, orb_prev(h)));
    if (orb_orient(p, b, c) <= 0) {
      return 0;
    }
    h = net->twin[orb_prev(h)];
  } while (h != first);
  memcpy(net->points + 3 * (int64_t)v, p, 3 * sizeof(double));
  return 1;
}
