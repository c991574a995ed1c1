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
#include "numeric/predicates.h"
#include "numeric/vec3.h"

typedef struct smoothing {
  orb_map_level *level;
  const orb_map_params *params;
  double *target; /* 3 per vertex: where it was placed, on the sphere */
  double *trust;  /* 0 to 1 */
  double *smooth; /* likewise: 0 for outliers, else how long a vertex has been without flips */
} smoothing;

static double bounded(const smoothing *s, double cotangent) {
  return fmin(fmax(cotangent, s->params->smooth.least_cotangent), s->params->smooth.most_cotangent);
}

/* One vertex to the mean of its target and its neighbours. */
static void relax(const smoothing *s, int32_t v) {
  const orb_map_level *l = s->level;
  const double reach = s->params->smooth.reach;
  double all = 2 * s->trust[v] * l->area[v] / (reach * reach), sum[3], *x = l->x + 3 * (size_t)v;
  for (int k = 0; k < 3; k++) {
    sum[k] = all * s->target[3 * (size_t)v + (size_t)k];
  }
  for (int32_t i = l->start[v]; i < l->start[v + 1]; i++) {
    const orb_map_spoke *spoke = &l->spoke[i];
    const double wq = bounded(s, spoke->cr), wr = bounded(s, spoke->cq);
    const double *q = l->x + 3 * (size_t)spoke->q, *r = l->x + 3 * (size_t)spoke->r;
    for (int k = 0; k < 3; k++) {
      sum[k] += wq * q[k] + wr * r[k];
    }
    all += wq + wr;
  }
  for (int k = 0; k < 3; k++) {
    x[k] += s->params->smooth.over * (sum[k] / all - x[k]);
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
      if (orb_orient(l->x + 3 * (size_t)v, l->x + 3 * (size_t)spoke->q, l->x + 3 * (size_t)spoke->r) <= 0) {
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
    const double far2 = orb_distance2(l->x + 3 * (size_t)v, s->target + 3 * (size_t)v);
    const double scale2 = fmax(l->density[v], ORB_TINY); /* not 0 where the fixed shape has a flat triangle */
    const double share = 1 / (1 + far2 / (scale2 * outlier * outlier));
    s->trust[v] = share * share * s->smooth[v];
  }
}

orb_status orb_map_smooth(orb_map_run *c, orb_map_level *l, const int32_t *to_mesh) {
  const orb_map_params *p = &c->params;
  smoothing s = {.level = l,
                 .params = p,
                 .target = ORB_NEW(c->ctx, double, 3 * (size_t)l->count),
                 .trust = ORB_NEW(c->ctx, double, l->count),
                 .smooth = ORB_NEW(c->ctx, double, l->count)};
  orb_status status = s.target && s.trust && s.smooth ? ORB_OK : ORB_E_NO_MEMORY;
  if (status != ORB_OK) {
    goto done;
  }
  memcpy(s.target, l->x, 3 * (size_t)l->count * sizeof *s.target);
  doubt_outliers(&s, c->doubted, to_mesh);
  for (int round = 0; round < p->smooth.rounds; round++) {
    for (int sweep = 0; sweep < p->smooth.sweeps; sweep++) {
      for (int32_t v = 0; v < l->count; v++) {
        if (!l->pinned[v]) {
          relax(&s, v);
        }
      }
      ORB_GO(status, orb_context_check(c->ctx), done);
    }
    doubt_folds(&s);
    weigh(&s);
  }
  for (int32_t v = 0; v < l->count; v++) {
    if (!l->pinned[v]) {
      orb_normalize(l->x + 3 * (size_t)v);
    }
  }
  status = orb_map_level_locate_all(c->ctx, l, &c->b, 0);
done:
  orb_free(c->ctx, s.target);
  orb_free(c->ctx, s.trust);
  orb_free(c->ctx, s.smooth);
  return status;
}
