/* Minimises ∫ |∇x|² + trust · |x − target|² / reach² over the moving shape by over-relaxed Gauss–Seidel sweeps, where x
 * is the point on the sphere; outliers have no trust. Then trusts each target by how far x has moved from it, measured
 * on the fixed shape, and less where triangles are flipped. Repeats both (iteratively reweighted least squares). So a
 * fold is smoothed over a growing distance, and all other places stay where they are. Between the rounds x is not
 * normalised: it stays near the sphere. */
#include "align/map/starts/smooth.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/context.h"
#include "base/memory.h"
#include "base/parallel.h"
#include "numeric/predicates.h"
#include "numeric/vec3.h"

/* The sum of the bounded cotangents across an edge. */
typedef struct smooth_edge {
  double weight;
  int32_t end;
} smooth_edge;

typedef struct smoothing {
  orb_map_level *level;
  const orb_map_params *params;
  double *target;    /* 3 per vertex: where it was placed, on the sphere */
  double *trust;     /* 0 to 1 */
  double *smooth;    /* likewise: 0 for outliers, else how long a vertex has been without flips */
  double *point;     /* 4 per vertex, the last unused: where it is now */
  int32_t *row;      /* the first edge of the i-th vertex of by_group */
  smooth_edge *edge; /* to the neighbours, in that order */
} smoothing;

static double bounded(const smoothing *s, double cotangent) {
  return fmin(fmax(cotangent, s->params->smooth.least_cotangent), s->params->smooth.most_cotangent);
}

/* Fills in the edges from v and returns their number. Each neighbour belongs to two spokes, as q of one and as r of the
 * other. */
static int32_t fill_row(const smoothing *s, int32_t v, smooth_edge *out) {
  const orb_map_level *l = s->level;
  int32_t count = 0;
  for (int32_t i = l->start[v]; i < l->start[v + 1]; i++) {
    const orb_map_spoke *spoke = &l->spoke[i];
    const double weight[2] = {bounded(s, spoke->cr), bounded(s, spoke->cq)};
    const int32_t end[2] = {spoke->q, spoke->r};
    for (int k = 0; k < 2; k++) {
      int32_t at = 0;
      while (at < count && out[at].end != end[k]) {
        at++;
      }
      if (at == count) {
        out[count++] = (smooth_edge){0, end[k]};
      }
      out[at].weight += weight[k];
    }
  }
  return count;
}

static void fill_edges(const smoothing *s) {
  const orb_map_level *l = s->level;
  int32_t count = 0;
  for (int32_t i = 0; i < l->moving; i++) {
    s->row[i] = count;
    count += fill_row(s, l->by_group[i], s->edge + count);
  }
  s->row[l->moving] = count;
}

/* Moves the i-th vertex of by_group to the mean of its target and its neighbours. Vertices of one colour follow each
 * other and do not depend on each other, so their steps overlap in the processor. */
static void relax(const smoothing *s, int32_t i) {
  const orb_map_level *l = s->level;
  const int32_t v = l->by_group[i];
  const double reach = s->params->smooth.reach, own = 2 * s->trust[v] * l->area[v] / (reach * reach);
  const double *target = s->target + 3 * (size_t)v;
  double sum[4] = {own * target[0], own * target[1], own * target[2], 0}, all = own;
  for (int32_t k = s->row[i]; k < s->row[i + 1]; k++) {
    const smooth_edge *one = &s->edge[k];
    const double *q = s->point + 4 * (size_t)one->end;
    for (int j = 0; j < 4; j++) {
      sum[j] += one->weight * q[j];
    }
    all += one->weight;
  }
  double *x = s->point + 4 * (size_t)v;
  for (int j = 0; j < 4; j++) {
    x[j] += s->params->smooth.over * (sum[j] / all - x[j]);
  }
}

/* Relaxes parts of the level, which do not depend on each other (engine/sweep.c). */
static void relax_parts(void *arg, int64_t begin, int64_t end, int thread) {
  const smoothing *s = arg;
  const orb_map_level *l = s->level;
  (void)thread;
  for (int32_t i = l->group_start[begin * l->colours]; i < l->group_start[end * l->colours]; i++) {
    relax(s, i);
  }
}

/* All parts, then the border between them. */
static void relax_all(orb_context *ctx, smoothing *s) {
  const orb_map_level *l = s->level;
  orb_parallel_for(ctx, l->parts, 1, relax_parts, s);
  for (int32_t i = l->group_start[l->parts * l->colours]; i < l->moving; i++) {
    relax(s, i);
  }
}

/* Does not trust a target that faces another way, or that is far from those of most neighbours. */
static void doubt_outliers(const smoothing *s, const unsigned char *doubted, const int32_t *to_mesh) {
  const orb_map_level *l = s->level;
  const double far = s->params->smooth.apart;
  for (int32_t v = 0; v < l->count; v++) {
    const double scale2 = fmax(l->density[v], ORB_TINY); /* not 0 where the fixed shape has a flat triangle */
    int32_t near = 0;
    for (int32_t i = l->start[v]; i < l->start[v + 1]; i++) {
      near += orb_distance2(s->target + 3 * (size_t)v, s->target + 3 * (size_t)l->spoke[i].q) <= scale2 * far * far;
    }
    s->trust[v] = s->smooth[v] = doubted[to_mesh[l->vertex[v]]] || 2 * near < l->start[v + 1] - l->start[v] ? 0 : 1;
  }
}

/* Trusts the targets of flipped triangles less. */
static void doubt_folds(const smoothing *s) {
  const orb_map_level *l = s->level;
  for (int32_t v = 0; v < l->count; v++) {
    for (int32_t i = l->start[v]; i < l->start[v + 1]; i++) {
      const orb_map_spoke *spoke = &l->spoke[i];
      if (orb_orient(s->point + 4 * (size_t)v, s->point + 4 * (size_t)spoke->q, s->point + 4 * (size_t)spoke->r) <= 0) {
        s->smooth[v] *= s->params->smooth.folded;
        break;
      }
    }
  }
}

/* Weighs the targets anew. The density of the fixed shape converts distances on the sphere to distances on that shape.
 */
static void weigh(const smoothing *s) {
  const orb_map_level *l = s->level;
  const double outlier = s->params->smooth.outlier;
  for (int32_t v = 0; v < l->count; v++) {
    const double far2 = orb_distance2(s->point + 4 * (size_t)v, s->target + 3 * (size_t)v);
    const double scale2 = fmax(l->density[v], ORB_TINY); /* not 0 where the fixed shape has a flat triangle */
    const double share = 1 / (1 + far2 / (scale2 * outlier * outlier));
    s->trust[v] = share * share * s->smooth[v];
  }
}

static orb_status smoothing_create(orb_context *ctx, smoothing *s) {
  const orb_map_level *l = s->level;
  s->target = ORB_NEW(ctx, double, 3 * (size_t)l->count);
  s->trust = ORB_NEW(ctx, double, l->count);
  s->smooth = ORB_NEW(ctx, double, l->count);
  s->point = ORB_NEW0(ctx, double, 4 * (size_t)l->count);
  s->row = ORB_NEW(ctx, int32_t, (size_t)l->moving + 1);
  s->edge = ORB_NEW(ctx, smooth_edge, 3 * (size_t)l->triangle_count);
  if (!s->target || !s->trust || !s->smooth || !s->point || !s->row || !s->edge) {
    return ORB_E_NO_MEMORY;
  }
  memcpy(s->target, l->x, 3 * (size_t)l->count * sizeof *s->target);
  for (int32_t v = 0; v < l->count; v++) {
    memcpy(s->point + 4 * (size_t)v, l->x + 3 * (size_t)v, sizeof(double[3]));
  }
  fill_edges(s);
  return ORB_OK;
}

static void smoothing_free(orb_context *ctx, smoothing *s) {
  orb_free(ctx, s->target);
  orb_free(ctx, s->trust);
  orb_free(ctx, s->smooth);
  orb_free(ctx, s->point);
  orb_free(ctx, s->row);
  orb_free(ctx, s->edge);
}

orb_status orb_map_smooth(orb_map_run *c, orb_map_level *l, const int32_t *to_mesh) {
  const orb_map_params *p = &c->params;
  smoothing s = {.level = l, .params = p};
  orb_status status;
  ORB_GO(status, smoothing_create(c->ctx, &s), done);
  doubt_outliers(&s, c->doubted, to_mesh);
  for (int round = 0; round < p->smooth.rounds; round++) {
    for (int sweep = 0; sweep < p->smooth.sweeps; sweep++) {
      relax_all(c->ctx, &s);
      ORB_GO(status, orb_context_check(c->ctx), done);
    }
    doubt_folds(&s);
    weigh(&s);
  }
  for (int32_t i = 0; i < l->moving; i++) {
    double *x = l->x + 3 * (size_t)l->by_group[i];
    memcpy(x, s.point + 4 * (size_t)l->by_group[i], sizeof(double[3]));
    orb_normalize(x);
  }
  status = orb_map_level_locate_all(c->ctx, l, &c->b, 0);
done:
  smoothing_free(c->ctx, &s);
  return status;
}
