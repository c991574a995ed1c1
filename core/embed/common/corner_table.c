#include "embed/common/corner_table.h"

#include <math.h>

#include "base/check.h"
#include "base/error.h"
#include "base/loops.h"
#include "base/memory.h"
#include "numeric/vec3.h"

enum {
  MORTON_BITS = 10, /* of each coordinate; 30 bits sort in three passes */
  GRAIN = 8192      /* elements of a chunk */
};

static const double PI = 3.14159265358979323846;
static const double AREA_FLOOR = 1e-7; /* least target area of a triangle, as a share of the mean */
/* Total areas of a mesh in the box [−1, 1]³. Below THIN the scale stops growing, so that floats can hold the positions.
 * Below VANISHING, areas are rounding errors, and all triangles count alike. */
static const double THIN = 1e-12, VANISHING = 1e-30;

typedef struct setup {
  orb_context *ctx;
  const orb_mesh *mesh;
  orb_corner_table *s;
  double middle[3], half; /* of the bounding box; half its longest side */
  uint32_t *key[2];
  int32_t *id[2];
  int32_t *first;    /* vertex_count + 1: first corner of a vertex in incident */
  int32_t *incident; /* corners by vertex */
  double *chunk;     /* per-chunk sums of area */
  double scale, area_scale;
  atomic_int broken;
} setup;

static uint32_t spread_bits(uint32_t x) {
  x &= 1023;
  x = (x | x << 16) & 0x30000ff;
  x = (x | x << 8) & 0x300f00f;
  x = (x | x << 4) & 0x30c30c3;
  return (x | x << 2) & 0x9249249;
}

static orb_status find_bounds(setup *w) {
  const orb_mesh *mesh = w->mesh;
  double low[3], high[3];
  for (int k = 0; k < 3; k++) {
    low[k] = high[k] = mesh->positions[k];
  }
  for (int64_t i = 0; i < mesh->vertex_count; i++) {
    for (int k = 0; k < 3; k++) {
      double x = mesh->positions[3 * i + k];
      if (!isfinite(x)) {
        return orb_fail(w->ctx, ORB_E_NOT_FINITE, "Vertex %lld has a coordinate that is not finite.", (long long)i);
      }
      low[k] = x < low[k] ? x : low[k];
      high[k] = x > high[k] ? x : high[k];
    }
  }
  w->half = 0;
  for (int k = 0; k < 3; k++) { /* halves first: the difference of two huge numbers may overflow */
    w->middle[k] = 0.5 * low[k] + 0.5 * high[k];
    w->half = fmax(w->half, 0.5 * high[k] - 0.5 * low[k]);
  }
  return ORB_OK;
}

/* Coordinate k of mesh vertex i in the box [−1, 1]³. */
static double boxed(const setup *w, int64_t i, int k) {
  if (!(w->half > 0)) {
    return 0;
  }
  double x = (0.5 * w->mesh->positions[3 * i + k] - 0.5 * w->middle[k]) / (0.5 * w->half);
  return x < -1 ? -1 : x > 1 ? 1 : x;
}

static void make_keys(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  setup *w = arg;
  for (int64_t i = begin; i < end; i++) {
    uint32_t key = 0;
    for (int k = 0; k < 3; k++) {
      key |= spread_bits((uint32_t)((boxed(w, i, k) * 0.5 + 0.5) * 1023)) << k;
    }
    w->key[0][i] = key;
    w->id[0][i] = (int32_t)i;
  }
}

static void radix_sort(setup *w) {
  for (int pass = 0; pass < 3; pass++) {
    uint32_t count[(1 << MORTON_BITS) + 1] = {0}, *from = w->key[pass & 1], *to = w->key[~pass & 1];
    int32_t *id_from = w->id[pass & 1], *id_to = w->id[~pass & 1], n = w->mesh->vertex_count;
    int shift = pass * MORTON_BITS;
    for (int32_t i = 0; i < n; i++) {
      count[(from[i] >> shift & 1023) + 1]++;
    }
    for (int i = 0; i < 1023; i++) {
      count[i + 1] += count[i];
    }
    for (int32_t i = 0; i < n; i++) {
      uint32_t at = count[from[i] >> shift & 1023]++;
      to[at] = from[i];
      id_to[at] = id_from[i];
    }
  }
}

static void copy_positions(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  setup *w = arg;
  for (int64_t i = begin; i < end; i++) {
    int32_t old = w->s->to_mesh[i];
    w->s->from_mesh[old] = (int32_t)i;
    for (int k = 0; k < 3; k++) {
      w->s->position[3 * i + k] = boxed(w, old, k);
    }
  }
}

static orb_status order_vertices(setup *w) {
  orb_context *ctx = w->ctx;
  int64_t n = w->mesh->vertex_count;
  orb_status status = find_bounds(w);
  if (status != ORB_OK) {
    return status;
  }
  for (int i = 0; i < 2; i++) {
    w->key[i] = ORB_NEW(ctx, uint32_t, n);
    w->id[i] = ORB_NEW(ctx, int32_t, n);
    if (!w->key[i] || !w->id[i]) {
      return ORB_E_NO_MEMORY;
    }
  }
  ORB_TRY(orb_sliced_for(ctx, n, GRAIN, make_keys, w));
  radix_sort(w);
  w->s->to_mesh = w->id[1]; /* three passes end in the second buffer */
  w->id[1] = NULL;
  w->s->from_mesh = ORB_NEW(ctx, int32_t, n);
  w->s->position = ORB_NEW(ctx, double, 3 * n);
  if (!w->s->from_mesh || !w->s->position) {
    return ORB_E_NO_MEMORY;
  }
  return orb_sliced_for(ctx, n, GRAIN, copy_positions, w);
}

/* Orders triangles by their least vertex. */
static orb_status order_triangles(setup *w) {
  orb_corner_table *s = w->s;
  int64_t n = s->vertex_count, faces = s->triangle_count;
  const int32_t *in = w->mesh->triangles;
  w->first = ORB_NEW0(w->ctx, int32_t, n + 1);
  s->corner = ORB_NEW(w->ctx, int32_t, 8 * faces);
  s->opposite = s->corner ? s->corner + 4 : NULL;
  if (!w->first || !s->corner) {
    return ORB_E_NO_MEMORY;
  }
  for (int pass = 0; pass < 2; pass++) {
    for (int64_t t = 0; t < faces; t++) {
      int32_t v[3];
      for (int k = 0; k < 3; k++) {
        v[k] = s->from_mesh[in[3 * t + k]];
      }
      int32_t least = v[0] < v[1] ? v[0] : v[1];
      least = v[2] < least ? v[2] : least;
      if (pass == 0) {
        w->first[least + 1]++;
      } else {
        memcpy(s->corner + orb_triangle_corner(w->first[least]++), v, sizeof v);
      }
    }
    for (int64_t i = 0; pass == 0 && i < n; i++) {
      w->first[i + 1] += w->first[i];
    }
  }
  return orb_context_check(w->ctx);
}

static orb_status list_incidences(setup *w) {
  orb_corner_table *s = w->s;
  int64_t n = s->vertex_count, faces = s->triangle_count;
  w->incident = ORB_NEW(w->ctx, int32_t, 3 * faces);
  s->valence = ORB_NEW0(w->ctx, int32_t, n);
  s->vertex_corner = ORB_NEW(w->ctx, int32_t, n);
  if (!w->incident || !s->valence || !s->vertex_corner) {
    return ORB_E_NO_MEMORY;
  }
  for (int64_t t = 0; t < faces; t++) {
    for (int k = 0; k < 3; k++) {
      s->valence[s->corner[orb_triangle_corner(t) + k]]++;
    }
  }
  w->first[0] = 0;
  for (int64_t i = 0; i < n; i++) {
    w->first[i + 1] = w->first[i] + s->valence[i];
    s->vertex_corner[i] = w->first[i];
  }
  for (int64_t t = 0; t < faces; t++) {
    for (int32_t c = orb_triangle_corner(t), k = 0; k < 3; k++) {
      w->incident[s->vertex_corner[s->corner[c + k]]++] = c + k;
    }
  }
  for (int64_t i = 0; i < n; i++) {
    if (s->valence[i] < 3) {
      return orb_fail(w->ctx, ORB_E_NOT_MANIFOLD, "Vertex %d has fewer than three triangles; repair the mesh first.",
                      s->to_mesh[i]);
    }
    s->vertex_corner[i] = w->incident[w->first[i]];
  }
  return orb_context_check(w->ctx);
}

/* The corner opposite to c, −1 if there is none. Its triangle has the edge from b to a. The search visits the corners
 * of whichever end has fewer, so that a pole of any valence costs little. */
static int32_t find_opposite(const setup *w, int32_t c) {
  const orb_corner_table *s = w->s;
  int32_t a = s->corner[orb_corner_next(c)], b = s->corner[orb_corner_prev(c)];
  if (s->valence[b] <= s->valence[a]) {
    for (int32_t i = w->first[b]; i < w->first[b + 1]; i++) {
      int32_t d = w->incident[i];
      if (s->corner[orb_corner_next(d)] == a) {
        return orb_corner_prev(d);
      }
    }
  } else {
    for (int32_t i = w->first[a]; i < w->first[a + 1]; i++) {
      int32_t d = w->incident[i];
      if (s->corner[orb_corner_prev(d)] == b) {
        return orb_corner_next(d);
      }
    }
  }
  return -1;
}

static void link_opposites(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  setup *w = arg;
  for (int64_t t = begin; t < end; t++) {
    for (int k = 0; k < 3; k++) {
      int32_t c = orb_triangle_corner(t) + k, o = find_opposite(w, c);
      w->s->opposite[c] = o;
      if (o < 0) {
        atomic_store_explicit(&w->broken, 1, memory_order_relaxed);
      }
    }
    w->s->opposite[orb_triangle_corner(t) + 3] = -1;
  }
}

/* Checks that the triangles of each vertex form one fan. */
static void check_fans(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  setup *w = arg;
  const orb_corner_table *s = w->s;
  for (int64_t v = begin; v < end; v++) {
    int32_t c = s->vertex_corner[v], walked = 0;
    do {
      c = orb_corner_swing(s, c);
      walked++;
    } while (c != s->vertex_corner[v] && walked <= s->valence[v]);
    if (walked != s->valence[v]) {
      atomic_store_explicit(&w->broken, 1, memory_order_relaxed);
    }
  }
}

static orb_status link_triangles(setup *w) {
  orb_context *ctx = w->ctx;
  ORB_TRY(orb_sliced_for(ctx, w->s->triangle_count, GRAIN, link_opposites, w));
  if (!atomic_load(&w->broken)) {
    ORB_TRY(orb_sliced_for(ctx, w->s->vertex_count, GRAIN, check_fans, w));
  }
  if (atomic_load(&w->broken)) {
    return orb_fail(ctx, ORB_E_NOT_MANIFOLD, "The mesh is not closed and manifold; repair it before embedding.");
  }
  return ORB_OK;
}

static void measure_areas(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  setup *w = arg;
  const orb_corner_table *s = w->s;
  double sum = 0;
  for (int64_t t = begin; t < end; t++) {
    const int32_t *v = s->corner + orb_triangle_corner(t);
    double area = orb_triangle_area_at(s->position, v);
    orb_corner_set_area(w->s, orb_triangle_corner(t), (float)area);
    sum += area;
  }
  w->chunk[begin / GRAIN] = sum;
}

static void scale_vertices(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  setup *w = arg;
  for (int64_t i = begin; i < end; i++) {
    for (int k = 0; k < 3; k++) {
      w->s->position[3 * i + k] *= w->scale;
      w->s->position4[4 * i + k] = (float)w->s->position[3 * i + k];
    }
    w->s->position4[4 * i + 3] = (float)w->s->valence[i];
  }
}

static void scale_areas(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  setup *w = arg;
  float mean = (float)(4 * PI / w->s->triangle_count), least = (float)AREA_FLOOR * mean;
  for (int64_t t = begin; t < end; t++) {
    float area = (float)(orb_corner_area(w->s, orb_triangle_corner(t)) * w->area_scale);
    area = w->area_scale > 0 ? area : mean;
    orb_corner_set_area(w->s, orb_triangle_corner(t), area > least ? area : least);
  }
}

static orb_status normalise(setup *w) {
  orb_context *ctx = w->ctx;
  int64_t faces = w->s->triangle_count, chunks = (faces + GRAIN - 1) / GRAIN;
  w->chunk = ORB_NEW(ctx, double, chunks);
  w->s->position4 = ORB_NEW(ctx, float, 4 * (int64_t)w->s->vertex_count);
  if (!w->chunk || !w->s->position4) {
    return ORB_E_NO_MEMORY;
  }
  ORB_TRY(orb_sliced_for(ctx, faces, GRAIN, measure_areas, w));
  double total = 0;
  for (int64_t i = 0; i < chunks; i++) {
    total += w->chunk[i];
  }
  w->scale = sqrt(4 * PI / fmax(total, THIN));
  w->area_scale = total > VANISHING ? 4 * PI / total : 0;
  ORB_TRY(orb_sliced_for(ctx, w->s->vertex_count, GRAIN, scale_vertices, w));
  return orb_sliced_for(ctx, faces, GRAIN, scale_areas, w);
}

static orb_status check_counts(orb_context *ctx, const orb_mesh *mesh) {
  if (mesh->vertex_count < 4 || (int64_t)mesh->triangle_count != 2 * (int64_t)mesh->vertex_count - 4) {
    return orb_fail(ctx, ORB_E_NOT_GENUS_ZERO,
                    "%d vertices and %d triangles do not make a closed surface of genus zero; repair the mesh first.",
                    mesh->vertex_count, mesh->triangle_count);
  }
  if (mesh->triangle_count > INT32_MAX / 8 - 1) {
    return orb_fail(ctx, ORB_E_TOO_LARGE, "The mesh has more triangles than 32-bit corner numbers reach.");
  }
  for (int64_t i = 0; i < 3 * (int64_t)mesh->triangle_count; i++) {
    if (mesh->triangles[i] < 0 || mesh->triangles[i] >= mesh->vertex_count) {
      return orb_fail(ctx, ORB_E_INTERNAL, "Triangle %lld names a vertex that does not exist.", (long long)(i / 3));
    }
  }
  return ORB_OK;
}

orb_status orb_corner_table_create(orb_context *ctx, const orb_mesh *mesh, orb_corner_table *out) {
  memset(out, 0, sizeof *out);
  ORB_TRY(check_counts(ctx, mesh));
  out->vertex_count = mesh->vertex_count;
  out->triangle_count = mesh->triangle_count;
  setup w = {.ctx = ctx, .mesh = mesh, .s = out};
  orb_status status;
  ORB_GO(status, order_vertices(&w), done);
  ORB_GO(status, order_triangles(&w), done);
  ORB_GO(status, list_incidences(&w), done);
  ORB_GO(status, link_triangles(&w), done);
  ORB_GO(status, normalise(&w), done);
done:
  for (int i = 0; i < 2; i++) {
    orb_free(ctx, w.key[i]);
    orb_free(ctx, w.id[i]);
  }
  orb_free(ctx, w.first);
  orb_free(ctx, w.incident);
  orb_free(ctx, w.chunk);
  if (status != ORB_OK) {
    orb_corner_table_free(ctx, out);
  }
  return status;
}

void orb_corner_table_free(orb_context *ctx, orb_corner_table *s) {
  orb_free(ctx, s->to_mesh);
  orb_free(ctx, s->from_mesh);
  orb_free(ctx, s->position);
  orb_free(ctx, s->position4);
  orb_free(ctx, s->corner);
  orb_free(ctx, s->vertex_corner);
  orb_free(ctx, s->valence);
  memset(s, 0, sizeof *s);
}
