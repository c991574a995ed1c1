#include "align/find/agreed.h"

#include <math.h>
#include <string.h>

#include "align/find/params.h"
#include "align/map/engine/surface.h"
#include "base/check.h"
#include "base/memory.h"
#include "numeric/vec3.h"

enum {
  MARKS_LEAST = 6, /* fewer do not tell a place on a surface from its mirror images */
  TURNS = 30       /* of the power iteration: weights need two digits */
};

orb_status orb_agreed_create(orb_context *ctx, const orb_mesh *first, const orb_mesh *second, orb_agreed *out) {
  const int32_t n = first->vertex_count, m = second->vertex_count, most = n > m ? n : m;
  memset(out, 0, sizeof *out);
  out->mesh[0] = first;
  out->mesh[1] = second;
  for (int s = 0; s < 2; s++) {
    const orb_mesh *mesh = out->mesh[s];
    ORB_TRY(orb_nearest_create(ctx, mesh->positions, mesh->triangles, mesh->triangle_count, &out->tree[s]));
    ORB_TRY(orb_distances_create(ctx, mesh, &out->distances[s]));
    out->from[s] = ORB_NEW(ctx, float, ORB_AGREED_MARKS *(size_t)mesh->vertex_count);
    out->image[s] = ORB_NEW(ctx, int32_t, mesh->vertex_count);
    if (!out->from[s] || !out->image[s]) {
      return ORB_E_NO_MEMORY;
    }
  }
  out->one = ORB_NEW(ctx, double, most);
  out->far = ORB_NEW(ctx, double, n);
  out->sum = ORB_NEW(ctx, float, most);
  return out->one && out->far && out->sum ? ORB_OK : ORB_E_NO_MEMORY;
}

void orb_agreed_free(orb_context *ctx, orb_agreed *a) {
  for (int s = 0; s < 2; s++) {
    orb_nearest_destroy(ctx, a->tree[s]);
    orb_distances_free(ctx, &a->distances[s]);
    orb_free(ctx, a->from[s]);
    orb_free(ctx, a->image[s]);
  }
  orb_free(ctx, a->one);
  orb_free(ctx, a->far);
  orb_free(ctx, a->sum);
  memset(a, 0, sizeof *a);
}

static void fill_images(orb_agreed *a, const double *const position[2]) {
  for (int s = 0; s < 2; s++) {
    for (int32_t v = 0; v < a->mesh[s]->vertex_count; v++) {
      orb_place place;
      (void)orb_nearest_query(a->tree[1 - s], position[s] + 3 * (size_t)v, INFINITY, &place);
      a->image[s][v] = orb_map_nearest_corner(a->mesh[1 - s]->triangles, &place);
    }
  }
}

/* Flags the vertices of the first mesh that come back to themselves, nearly. Returns the one that comes nearest, or −1,
 * and how many there are. */
static int32_t flag_agreed(orb_agreed *a, int32_t *agreed) {
  const double *x = a->mesh[0]->positions;
  int32_t nearest = -1;
  double least = ORB_FIND_AGREED;
  *agreed = 0;
  for (int32_t v = 0; v < a->mesh[0]->vertex_count; v++) {
    const int32_t again = a->image[1][a->image[0][v]];
    const double off = sqrt(orb_distance2(x + 3 * (size_t)v, x + 3 * (size_t)again));
    a->far[v] = off < ORB_FIND_AGREED ? INFINITY : -1;
    *agreed += off < ORB_FIND_AGREED;
    if (off < least) {
      least = off;
      nearest = v;
    }
  }
  return nearest;
}

/* Adds a vertex and its image as marks. `far` becomes less where the vertex is near. */
static void add_mark(orb_agreed *a, int32_t v) {
  for (int s = 1; s >= 0; s--) {
    const int32_t n = a->mesh[s]->vertex_count, mark = s ? a->image[0][v] : v;
    float *row = a->from[s] + (size_t)a->count * (size_t)n;
    orb_distances_from(&a->distances[s], mark, a->one);
    for (int32_t k = 0; k < n; k++) {
      row[k] = (float)a->one[k];
    }
    a->mark[s][a->count] = mark;
  }
  a->count++;
  for (int32_t k = 0; k < a->mesh[0]->vertex_count; k++) {
    a->far[k] = fmin(a->far[k], a->one[k]);
  }
}

/* Spreads marks over the part that agrees: each time the vertex farthest from those before it. */
static void spread_marks(orb_agreed *a, int32_t next) {
  a->count = 0;
  while (a->count < ORB_AGREED_MARKS && next >= 0 && a->far[next] > 0) {
    add_mark(a, next);
    for (int32_t v = 0; v < a->mesh[0]->vertex_count; v++) {
      next = a->far[v] > a->far[next] ? v : next;
    }
  }
}

/* How alike the distances between two marks are on the two meshes: 1 at most. */
static double likeness(const orb_agreed *a, int32_t i, int32_t k) {
  const double x = a->from[0][(size_t)i * (size_t)a->mesh[0]->vertex_count + (size_t)a->mark[0][k]];
  const double y = a->from[1][(size_t)i * (size_t)a->mesh[1]->vertex_count + (size_t)a->mark[1][k]];
  const double off = log((x + ORB_FIND_AGREED_EDGE) / (y + ORB_FIND_AGREED_EDGE)) / ORB_FIND_AGREED_STRETCH;
  return exp(-off * off / 2);
}

/* Marks that agree with most others weigh most: the principal eigenvector of their likenesses (Leordeanu & Hebert
 * 2005). The largest weight is 1. */
static void weigh_marks(orb_agreed *a) {
  double like[ORB_AGREED_MARKS][ORB_AGREED_MARKS], next[ORB_AGREED_MARKS];
  for (int32_t i = 0; i < a->count; i++) {
    a->weight[i] = 1;
    for (int32_t k = 0; k < a->count; k++) {
      like[i][k] = i == k ? 0 : likeness(a, i, k);
    }
  }
  for (int turn = 0; turn < TURNS; turn++) {
    double most = 0;
    for (int32_t i = 0; i < a->count; i++) {
      next[i] = 0;
      for (int32_t k = 0; k < a->count; k++) {
        next[i] += like[i][k] * a->weight[k];
      }
      most = fmax(most, next[i]);
    }
    for (int32_t i = 0; i < a->count && most > 0; i++) {
      a->weight[i] = next[i] / most;
    }
  }
}

/* Only this share of the marks keeps its weight: those nearest to the others on the first mesh. Marks on limbs are the
 * outer ones, so no wrong limb has a say. */
static void keep_inner(orb_agreed *a, double share) {
  double apart[ORB_AGREED_MARKS], rising[ORB_AGREED_MARKS];
  for (int32_t i = 0; i < a->count; i++) {
    const float *row = a->from[0] + (size_t)i * (size_t)a->mesh[0]->vertex_count;
    int32_t at = i;
    apart[i] = 0;
    for (int32_t k = 0; k < a->count; k++) {
      apart[i] += (double)row[a->mark[0][k]];
    }
    for (; at > 0 && rising[at - 1] > apart[i]; at--) {
      rising[at] = rising[at - 1];
    }
    rising[at] = apart[i];
  }
  const double most = rising[(int32_t)(share * (a->count - 1))];
  for (int32_t i = 0; i < a->count; i++) {
    a->weight[i] = apart[i] > most ? 0 : a->weight[i];
  }
}

/* The vertex of the other mesh whose distances from the marks are most like those of vertex v of mesh s. Near marks
 * weigh more. */
static int32_t most_alike(orb_agreed *a, int s, int32_t v) {
  const int32_t n = a->mesh[s]->vertex_count, m = a->mesh[1 - s]->vertex_count;
  float *restrict sum = a->sum;
  memset(sum, 0, (size_t)m * sizeof *sum);
  for (int32_t k = 0; k < a->count; k++) {
    const float distance = a->from[s][(size_t)k * (size_t)n + (size_t)v], near = ORB_FIND_AGREED_NEAR + distance;
    const float weight = (float)a->weight[k] / (near * near);
    const float *restrict row = a->from[1 - s] + (size_t)k * (size_t)m;
    for (int32_t u = 0; u < m; u++) {
      const float d = distance - row[u];
      sum[u] += weight * d * d;
    }
  }
  int32_t best = 0;
  for (int32_t u = 1; u < m; u++) {
    best = sum[u] < sum[best] ? u : best;
  }
  return best;
}

orb_status orb_agreed_extend(orb_context *ctx, orb_agreed *a, const double *const position[2], double inner,
                             int32_t *forth, int32_t *back, int *extended) {
  int32_t agreed;
  fill_images(a, position);
  const int32_t first = flag_agreed(a, &agreed);
  *extended = agreed >= MARKS_LEAST && agreed < ORB_FIND_AGREED_ALL * a->mesh[0]->vertex_count;
  if (!*extended) {
    return orb_context_check(ctx);
  }
  spread_marks(a, first);
  weigh_marks(a);
  keep_inner(a, inner);
  for (int s = 0; s < 2; s++) {
    ORB_TRY(orb_context_check(ctx));
    for (int32_t v = 0; v < a->mesh[s]->vertex_count; v++) {
      (s ? back : forth)[v] = most_alike(a, s, v);
    }
  }
  return ORB_OK;
}
