#include "align/find/agreed.h"

#include <math.h>
#include <string.h>

#include "align/find/params.h"
#include "base/check.h"
#include "base/memory.h"
#include "numeric/vec3.h"

enum {
  MARKS_LEAST = 6, /* fewer do not tell a place on a surface from its mirror images */
  TURNS = 30       /* of the power iteration: weights need two digits */
};

orb_status orb_agreed_create(orb_context *ctx, const orb_mesh *const mesh[2], const orb_survey *const survey[2],
                             orb_agreed *out) {
  const int32_t n = mesh[0]->vertex_count, m = mesh[1]->vertex_count;
  *out = (orb_agreed){.mesh = {mesh[0], mesh[1]}, .survey = {survey[0], survey[1]}};
  for (int s = 0; s < 2; s++) {
    out->image[s] = ORB_NEW(ctx, int32_t, mesh[s]->vertex_count);
  }
  out->far = ORB_NEW(ctx, double, n);
  out->sum = ORB_NEW(ctx, float, n > m ? n : m);
  return out->image[0] && out->image[1] && out->far && out->sum ? ORB_OK : ORB_E_NO_MEMORY;
}

void orb_agreed_free(orb_context *ctx, orb_agreed *a) {
  orb_free(ctx, a->image[0]);
  orb_free(ctx, a->image[1]);
  orb_free(ctx, a->far);
  orb_free(ctx, a->sum);
  memset(a, 0, sizeof *a);
}

/* Distances of all vertices of mesh s from mark k. */
static const float *from_mark(const orb_agreed *a, int s, int32_t k) {
  return a->survey[s]->apart + (size_t)a->mark[s][k] * (size_t)a->mesh[s]->vertex_count;
}

static void fill_images(orb_agreed *a, const double *const position[2]) {
  for (int s = 0; s < 2; s++) {
    orb_survey_images(a->survey[1 - s], a->mesh[1 - s], position[s], a->mesh[s]->vertex_count, a->image[s]);
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
  a->mark[0][a->count] = v;
  a->mark[1][a->count] = a->image[0][v];
  const float *row = from_mark(a, 0, a->count++);
  for (int32_t k = 0; k < a->mesh[0]->vertex_count; k++) {
    a->far[k] = fmin(a->far[k], (double)row[k]);
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
  const double x = from_mark(a, 0, i)[a->mark[0][k]], y = from_mark(a, 1, i)[a->mark[1][k]];
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
    const float *row = from_mark(a, 0, i);
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
  const int32_t m = a->mesh[1 - s]->vertex_count;
  float *restrict sum = a->sum;
  memset(sum, 0, (size_t)m * sizeof *sum);
  for (int32_t k = 0; k < a->count; k++) {
    const float distance = from_mark(a, s, k)[v], near = ORB_FIND_AGREED_NEAR + distance;
    const float weight = (float)a->weight[k] / (near * near);
    const float *restrict row = from_mark(a, 1 - s, k);
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
