/* An indexed heap holds every live vertex v1 by its cheapest collapse v1→v2. Eq. 1 is the product of a factor that
 * falls with the Gaussian curvature at v1 (so that limbs go first and coarse meshes are round) and the aspect ratios of
 * the triangles around v2 after the collapse. Large meshes are first reduced to qem_until vertices by quadric errors
 * (Garland & Heckbert 1997; section 9.2).
 *
 * The paper leaves a gap: 1/(1 + K) depends on scale, and as K falls to −1 and below it blows up and turns negative.
 * The mesh has area 4π here, so that K is 1 on average for a sphere, and for K < 0 the factor continues along its
 * tangent, 1 − K: smooth, positive, falling. A collapse keeps the link condition; a vertex without such a collapse
 * waits until its surroundings change.
 */
#include "embed/kernel_sampling/simplify.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/context.h"
#include "base/error.h"
#include "base/memory.h"
#include "numeric/vec3.h"

static const double MAX_ASPECT = 1e12; /* of a degenerate triangle, so that sums stay finite */

enum { POLE = 100 };                   /* a vertex of a higher valence is a pole */
static const double POLE_COST = 1e300; /* above all others */

typedef struct simplifier {
  orb_context *ctx;
  orb_ks_mesh *m;
  double *cost;          /* of each vertex's cheapest collapse */
  int32_t *target;       /* its half-edge */
  double *aspect_sum;    /* Eq. 1: Σ cr / 2ir around each vertex */
  double (*quadric)[10]; /* QEM; NULL in the phase of Eq. 1 */
  int32_t *heap, *slot;  /* indexed binary heap, least cost first */
  int32_t heap_count;
  int32_t *mark, stamp;
} simplifier;

static int comes_before(const simplifier *s, int32_t a, int32_t b) {
  return s->cost[a] < s->cost[b] || (s->cost[a] == s->cost[b] && a < b);
}

static void heap_put(simplifier *s, int32_t at, int32_t v) {
  s->heap[at] = v;
  s->slot[v] = at;
}

static void sift_up(simplifier *s, int32_t at) {
  int32_t v = s->heap[at];
  for (; at > 0 && comes_before(s, v, s->heap[(at - 1) / 2]); at = (at - 1) / 2) {
    heap_put(s, at, s->heap[(at - 1) / 2]);
  }
  heap_put(s, at, v);
}

static void sift_down(simplifier *s, int32_t at) {
  int32_t v = s->heap[at];
  for (;;) {
    int32_t child = 2 * at + 1;
    if (child >= s->heap_count) {
      break;
    }
    if (child + 1 < s->heap_count && comes_before(s, s->heap[child + 1], s->heap[child])) {
      child++;
    }
    if (!comes_before(s, s->heap[child], v)) {
      break;
    }
    heap_put(s, at, s->heap[child]);
    at = child;
  }
  heap_put(s, at, v);
}

static void heap_remove(simplifier *s, int32_t v) {
  int32_t at = s->slot[v], last = s->heap[--s->heap_count];
  if (last != v) {
    heap_put(s, at, last);
    sift_up(s, at);
    sift_down(s, s->slot[last]);
  }
}

/* circumradius / (2 inradius) = abc(a+b+c) / 16A²: 1 for an equilateral triangle. */
static double aspect(const double *p, const double *q, const double *r) {
  double u[3], w[3], n[3], c2 = orb_distance2(q, r);
  orb_sub(q, p, u);
  orb_sub(r, p, w);
  orb_cross(u, w, n);
  double a = sqrt(orb_dot(u, u)), b = sqrt(orb_dot(w, w)), c = sqrt(c2), four_area2 = orb_dot(n, n);
  double top = a * b * c * (a + b + c);
  return top < MAX_ASPECT * 4 * four_area2 ? top / (4 * four_area2) : MAX_ASPECT;
}

static const double *at(const simplifier *s, int32_t v) {
  return s->m->x + 3 * (size_t)v;
}

static double ring_aspect(const simplifier *s, int32_t v) {
  double sum = 0;
  int32_t e = s->m->out[v];
  do {
    int32_t next = orb_ks_rotate(s->m, e);
    sum += aspect(at(s, v), at(s, orb_ks_head(s->m, e)), at(s, orb_ks_head(s->m, next)));
    e = next;
  } while (e != s->m->out[v]);
  return sum;
}

/* The first factor of Eq. 1, continued for negative curvature. */
static double curvature_factor(const simplifier *s, int32_t v) {
  double angles = 0, area = 0;
  int32_t e = s->m->out[v];
  do {
    int32_t next = orb_ks_rotate(s->m, e);
    double u[3], w[3], n[3];
    orb_sub(at(s, orb_ks_head(s->m, e)), at(s, v), u);
    orb_sub(at(s, orb_ks_head(s->m, next)), at(s, v), w);
    orb_cross(u, w, n);
    double doubled = orb_length(n);
    angles += atan2(doubled, orb_dot(u, w));
    area += 0.5 * doubled;
    e = next;
  } while (e != s->m->out[v]);
  double curvature = (2 * M_PI - angles) / (area / 3 + 1e-12);
  return curvature >= 0 ? 1 / (1 + curvature) : 1 - curvature;
}

/* The second factor for collapsing h = v1→v2: the triangles around v2, less the two that die, plus the rest of v1's
 * star connected to v2. */
static double aspect_after(const simplifier *s, int32_t h) {
  const orb_ks_mesh *m = s->m;
  int32_t v1 = m->tri[h], v2 = orb_ks_head(m, h), first = orb_ks_rotate(m, h), last = orb_next(m->twin[h]);
  double sum = s->aspect_sum[v2] - aspect(at(s, v1), at(s, v2), at(s, orb_ks_head(m, first))) -
               aspect(at(s, v1), at(s, orb_ks_head(m, last)), at(s, v2));
  if (sum < 0) {
    sum = 0; /* rounding, where MAX_ASPECT cancels */
  }
  for (int32_t e = first; e != last;) {
    int32_t next = orb_ks_rotate(m, e);
    sum += aspect(at(s, v2), at(s, orb_ks_head(m, e)), at(s, orb_ks_head(m, next)));
    e = next;
  }
  return sum;
}

static double quadric_value(const double *q, const double *p) {
  return q[0] * p[0] * p[0] + q[4] * p[1] * p[1] + q[7] * p[2] * p[2] + q[9] +
         2 * (q[1] * p[0] * p[1] + q[2] * p[0] * p[2] + q[5] * p[1] * p[2] + q[3] * p[0] + q[6] * p[1] + q[8] * p[2]);
}

/* Quadric error, plus a small share of the squared edge length so that flat regions thin out evenly. */
static double quadric_cost(const simplifier *s, int32_t h) {
  int32_t v1 = s->m->tri[h], v2 = orb_ks_head(s->m, h);
  const double *p = at(s, v2);
  double error = quadric_value(s->quadric[v1], p) + quadric_value(s->quadric[v2], p);
  return fmax(error, 0) + 1e-6 * (4 * M_PI / s->m->vertex_count) * orb_distance2(at(s, v1), p);
}

/* Evaluating a pole would take O(valence²), so it is collapsed last, or once it is no longer a pole. */
static int is_pole(const simplifier *s, int32_t v) {
  return s->m->valence[v] > POLE;
}

/* Finds v's cheapest collapse. With `linked`, only among those that keep the link condition. */
static void evaluate(simplifier *s, int32_t v, int linked) {
  int pole = is_pole(s, v);
  double factor = s->quadric || pole ? 1 : curvature_factor(s, v), best = INFINITY;
  int32_t target = -1, e = s->m->out[v];
  do {
    if (!linked || orb_ks_link_holds(s->m, e, s->mark, ++s->stamp)) {
      double cost = pole ? POLE_COST : s->quadric ? quadric_cost(s, e) : factor * aspect_after(s, e);
      if (cost < best) {
        best = cost;
        target = e;
      }
    }
    e = orb_ks_rotate(s->m, e);
  } while (e != s->m->out[v] && !(pole && target >= 0));
  s->cost[v] = best;
  s->target[v] = target;
}

static void reevaluate(simplifier *s, int32_t v) {
  evaluate(s, v, 0);
  sift_up(s, s->slot[v]);
  sift_down(s, s->slot[v]);
}

/* Updates costs after a collapse into v: quadric costs change on v's ring, those of Eq. 1 one ring further, but not
 * beyond a pole, whose whole ring would be visited for every collapse at it. */
static void refresh_around(simplifier *s, int32_t v) {
  const orb_ks_mesh *m = s->m;
  if (!s->quadric) {
    s->aspect_sum[v] = ring_aspect(s, v);
  }
  int32_t seen = s->stamp += 2; /* stamps only grow, so no mark has this value */
  int32_t e = m->out[v];
  int32_t ring_count = 0;
  do {
    if (!s->quadric) {
      s->aspect_sum[orb_ks_head(m, e)] = ring_aspect(s, orb_ks_head(m, e));
    }
    ring_count++;
    e = orb_ks_rotate(m, e);
  } while (e != m->out[v]);
  ORB_ASSERT(ring_count == m->valence[v]);
  s->mark[v] = seen;
  reevaluate(s, v);
  e = m->out[v];
  do {
    int32_t w = orb_ks_head(m, e);
    if (s->mark[w] != seen) {
      s->mark[w] = seen;
      reevaluate(s, w);
    }
    for (int32_t f = m->out[w], start = f; !s->quadric && !is_pole(s, w);) {
      if (s->mark[orb_ks_head(m, f)] != seen) {
        s->mark[orb_ks_head(m, f)] = seen;
        reevaluate(s, orb_ks_head(m, f));
      }
      if ((f = orb_ks_rotate(m, f)) == start) {
        break;
      }
    }
    e = orb_ks_rotate(m, e);
  } while (e != m->out[v]);
}

static void build_quadrics(simplifier *s) {
  const orb_ks_mesh *m = s->m;
  for (int32_t t = 0; t < m->triangle_count; t++) {
    const int32_t *v = m->tri + 3 * (size_t)t;
    double u[3], w[3], n[3];
    orb_sub(at(s, v[1]), at(s, v[0]), u);
    orb_sub(at(s, v[2]), at(s, v[0]), w);
    orb_cross(u, w, n);
    double area = 0.5 * orb_normalize(n), d = -orb_dot(n, at(s, v[0]));
    const double plane[4] = {n[0], n[1], n[2], d};
    for (int k = 0; k < 3; k++) {
      double *q = s->quadric[v[k]];
      for (int i = 0, c = 0; i < 4; i++) {
        for (int j = i; j < 4; j++) {
          q[c++] += area * plane[i] * plane[j];
        }
      }
    }
  }
}

static void fill_heap(simplifier *s) {
  s->heap_count = 0;
  for (int32_t v = 0; v < s->m->vertex_count; v++) {
    if (s->m->valence[v]) {
      evaluate(s, v, 0);
      heap_put(s, s->heap_count++, v);
    }
  }
  for (int32_t i = s->heap_count / 2 - 1; i >= 0; i--) {
    sift_down(s, i);
  }
}

/* Collapses in order of cost until `until` vertices live. */
static orb_status collapse_until(simplifier *s, int32_t until) {
  orb_ks_mesh *m = s->m;
  fill_heap(s);
  int32_t total = m->vertex_count;
  while (m->live > until) {
    int32_t v = s->heap[0];
    if (s->cost[v] == INFINITY) {
      return orb_fail(s->ctx, ORB_E_INTERNAL, "No edge can be collapsed at %d vertices.", m->live);
    }
    if (!orb_ks_link_holds(m, s->target[v], s->mark, ++s->stamp)) {
      double stale = s->cost[v];
      evaluate(s, v, 1);
      ORB_ASSERT(s->cost[v] >= stale);
      sift_down(s, 0);
      if (s->heap[0] != v) {
        continue;
      }
      if (s->cost[v] == INFINITY) {
        continue;
      }
    }
    int32_t v2 = orb_ks_head(m, s->target[v]);
    if (s->quadric) {
      for (int i = 0; i < 10; i++) {
        s->quadric[v2][i] += s->quadric[v][i];
      }
    }
    heap_remove(s, v);
    ORB_TRY(orb_ks_collapse_edge(s->ctx, m, s->target[v]));
    refresh_around(s, v2);
    if ((m->log_count & 255) == 0 || is_pole(s, v2)) {
      ORB_TRY(orb_context_check(s->ctx));
      orb_progress(s->ctx, "simplify", (double)m->log_count / total);
    }
  }
  return ORB_OK;
}

orb_status orb_ks_simplify(orb_context *ctx, orb_ks_mesh *m, int32_t qem_until) {
  simplifier s = {.ctx = ctx, .m = m};
  orb_status status = ORB_E_NO_MEMORY;
  size_t n = (size_t)m->vertex_count;
  s.cost = ORB_NEW(ctx, double, n);
  s.target = ORB_NEW(ctx, int32_t, n);
  s.aspect_sum = ORB_NEW0(ctx, double, n);
  s.heap = ORB_NEW(ctx, int32_t, n);
  s.slot = ORB_NEW(ctx, int32_t, n);
  s.mark = ORB_NEW0(ctx, int32_t, n);
  if (!s.cost || !s.target || !s.aspect_sum || !s.heap || !s.slot || !s.mark) {
    goto done;
  }
  if (m->live > qem_until) {
    s.quadric = orb_calloc(ctx, n, sizeof *s.quadric);
    if (!s.quadric) {
      goto done;
    }
    build_quadrics(&s);
    ORB_GO(status, collapse_until(&s, qem_until > 4 ? qem_until : 4), done);
    orb_free(ctx, s.quadric);
    s.quadric = NULL;
  }
  for (int32_t v = 0; v < m->vertex_count; v++) {
    if (m->valence[v]) {
      s.aspect_sum[v] = ring_aspect(&s, v);
    }
  }
  status = collapse_until(&s, 4);
done:
  orb_free(ctx, s.cost);
  orb_free(ctx, s.target);
  orb_free(ctx, s.aspect_sum);
  orb_free(ctx, s.heap);
  orb_free(ctx, s.slot);
  orb_free(ctx, s.mark);
  orb_free(ctx, s.quadric);
  return status;
}
