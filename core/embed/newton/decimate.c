/* Decimation to a tetrahedron in rounds of independent collapses, without a heap.
 *
 * Each round takes a threshold at a sampled quantile of the costs. It evaluates, in parallel, the vertices whose old
 * cost is below the threshold and whose star has changed since; then it collapses, in order of vertex number, those
 * that are still below and whose ring is not locked. Costs above the threshold stay stale, as they mostly grow. On
 * coarse levels, where it costs little, all changed vertices are evaluated before the threshold is taken.
 *
 * A collapse locks its ring for the round. So the stars of a round do not overlap, and its vertices can be placed in
 * parallel when the round is undone. A collapse keeps the link condition: the ends of its edge have exactly two common
 * neighbours. On a sphere of more than four vertices some vertex of valence at most five always has such an edge, so
 * decimation always reaches the tetrahedron.
 */
#include "embed/newton/decimate.h"

#include <math.h>

#include "base/check.h"
#include "base/context.h"
#include "base/error.h"
#include "base/loops.h"
#include "base/memory.h"
#include "embed/newton/collapse.h"
#include "embed/newton/multires.h"

enum {
  LAZY_ABOVE = 4000, /* with more live vertices, stale costs stay */
  GRAIN = 1024,      /* vertices of a chunk */
  AHEAD = 12,        /* vertices between a prefetch and its use */
  SAMPLES = 2048,    /* of the costs, for the quantile */
  SMALL = 1024,      /* with at most this many live vertices the quantile is exact */
  SINGLE_BELOW = 60, /* with fewer live vertices a round is one collapse */
  CANCEL_EVERY = 8192,
  /* Rounds in a row without a collapse, after which … */
  FAILS_UNTIL_COSTLY = 2, /* … any target that keeps the link condition will do */
  FAILS_UNTIL_ALL = 30,   /* … the threshold is infinite */
  FAILS_UNTIL_KEPT = 40,  /* … the vertices to keep may go too */
  FAILS_MOST = 60         /* … the surface is not a sphere */
};

typedef struct ring {
  int32_t *vertex;
  int32_t count, capacity;
} ring;

typedef struct decimation {
  orb_context *ctx;
  orb_hierarchy *h;
  const orb_vector_loops *loops;
  const unsigned char *keep; /* flags in surface numbers, or NULL */
  int32_t keep_until;
  float *cost;
  int32_t *target;
  unsigned char *dirty, *dead;
  int32_t *mark, *lock; /* the stamp and the round that last marked and locked a vertex */
  int32_t stamp, round;
  int32_t *live, live_count;
  float threshold;
  int fails; /* rounds in a row without a collapse */
  ring ring;
} decimation;

static orb_status walk_ring(decimation *d, int32_t v) {
  const orb_corner_table *s = &d->h->surface;
  if (s->valence[v] > d->ring.capacity) {
    int32_t capacity = s->valence[v] + 64;
    int32_t *grown = ORB_NEW(d->ctx, int32_t, capacity);
    if (!grown) {
      return ORB_E_NO_MEMORY;
    }
    orb_free(d->ctx, d->ring.vertex);
    d->ring.vertex = grown;
    d->ring.capacity = capacity;
  }
  int32_t start = s->vertex_corner[v], c = start, k = 0;
  do {
    d->ring.vertex[k++] = s->corner[orb_corner_next(c)];
    c = orb_corner_swing(s, c);
  } while (c != start);
  d->ring.count = k;
  return ORB_OK;
}

static void mark_ring(decimation *d) {
  d->stamp++;
  for (int32_t i = 0; i < d->ring.count; i++) {
    d->mark[d->ring.vertex[i]] = d->stamp;
  }
}

/* Whether u has exactly two neighbours in the marked ring. */
static int link_holds(const decimation *d, int32_t u) {
  const orb_corner_table *s = &d->h->surface;
  int32_t start = s->vertex_corner[u], c = start, common = 0;
  do {
    common += d->mark[s->corner[orb_corner_next(c)]] == d->stamp;
    c = orb_corner_swing(s, c);
  } while (c != start && common < 3);
  return common == 2;
}

/* The shape term of the cost (vector/cost.inc.h) of going into ring[j], for targets that the vector loop did not pick.
 */
static float plain_cost(const decimation *d, int32_t j) {
  const float *x = d->h->surface.position4;
  int32_t k = d->ring.count;
  const float *a = x + 4 * (int64_t)d->ring.vertex[j];
  float sum = 0;
  for (int32_t i = 1; i < k - 1; i++) {
    const float *b = x + 4 * (int64_t)d->ring.vertex[(j + i) % k];
    const float *c = x + 4 * (int64_t)d->ring.vertex[(j + i + 1) % k];
    float u[3], w[3], edges = 0;
    for (int q = 0; q < 3; q++) {
      u[q] = b[q] - a[q];
      w[q] = c[q] - a[q];
      edges += u[q] * u[q] + w[q] * w[q] + (c[q] - b[q]) * (c[q] - b[q]);
    }
    float nx = u[1] * w[2] - u[2] * w[1], ny = u[2] * w[0] - u[0] * w[2], nz = u[0] * w[1] - u[1] * w[0];
    float area = 0.5F * sqrtf(nx * nx + ny * ny + nz * nz);
    sum += edges * edges / (fmaxf(area, 1e-3F * edges) + 1e-30F);
  }
  return sum;
}

/* The ring's cheapest vertex that keeps the link condition, −1 if none does. */
static int32_t other_target(const decimation *d, float *cost) {
  int32_t best = -1;
  *cost = INFINITY;
  int large = d->ring.count > ORB_COST_RING_MAX; /* then the first will do: the costs would take O(k²) */
  for (int32_t j = 0; j < d->ring.count; j++) {
    if (link_holds(d, d->ring.vertex[j])) {
      float c = large ? ORB_COST_LARGE : plain_cost(d, j);
      if (best < 0 || c < *cost) {
        *cost = c;
        best = d->ring.vertex[j];
      }
      if (large) {
        break;
      }
    }
  }
  return best;
}

static int is_kept(const decimation *d, int32_t v, int32_t live) {
  return d->keep && d->keep[v] && live > d->keep_until && d->fails < FAILS_UNTIL_KEPT;
}

static orb_status collapse_into(decimation *d, int32_t v, int32_t u) {
  orb_hierarchy *h = d->h;
  orb_corner_table *s = &h->surface;
  int32_t valence = d->ring.count, c = s->vertex_corner[v];
  ORB_TRY(orb_collapse_reserve(d->ctx, h, valence));
  while (s->corner[orb_corner_next(c)] != u) {
    c = orb_corner_swing(s, c);
  }
  for (int32_t i = 0; i < valence; i++) {
    d->lock[d->ring.vertex[i]] = d->round;
    d->dirty[d->ring.vertex[i]] = 1;
  }
  orb_collapse *log = &h->log[h->log_count++];
  orb_collapse_apply(s, c, valence, log, h->area_log + h->area_count);
  log->areas = h->area_count;
  h->area_count += valence - 2;
  d->dead[v] = 1;
  return ORB_OK;
}

/* Collapses v if the round allows it, and counts it in *done. */
static orb_status try_collapse(decimation *d, int32_t v, float threshold, int32_t *done) {
  if (d->cost[v] > threshold || d->lock[v] == d->round || is_kept(d, v, d->live_count - *done)) {
    return ORB_OK;
  }
  ORB_TRY(walk_ring(d, v));
  mark_ring(d);
  int32_t u = d->target[v];
  if (!link_holds(d, u)) {
    float cost;
    u = other_target(d, &cost);
    if (u < 0 || (cost > 4 * threshold && d->fails < FAILS_UNTIL_COSTLY)) {
      return ORB_OK;
    }
  }
  ++*done;
  return collapse_into(d, v, u);
}

static uint32_t bits_of(float x) {
  uint32_t bits;
  memcpy(&bits, &x, sizeof bits);
  return bits;
}

/* Returns the value that would stand at index `at` if x were sorted. No x is negative, so their bits order as the
 * values do. They are sorted digit by digit, and only within the digit that holds the value. Rearranges x. */
static float select_float(float *x, int32_t count, int32_t at) {
  enum { DIGIT = 11, TOP = 32 };
  for (int shift = TOP - DIGIT; count > 1; shift = shift > DIGIT ? shift - DIGIT : 0) {
    int32_t in[1 << DIGIT] = {0}, digit = 0, kept = 0;
    for (int32_t i = 0; i < count; i++) {
      in[bits_of(x[i]) >> shift & ((1U << DIGIT) - 1)]++;
    }
    for (; at >= in[digit]; digit++) {
      at -= in[digit];
    }
    for (int32_t i = 0; i < count; i++) {
      x[kept] = x[i];
      kept += (int32_t)(bits_of(x[i]) >> shift & ((1U << DIGIT) - 1)) == digit;
    }
    count = kept;
    if (shift == 0) {
      break;
    }
  }
  return x[0];
}

/* The cost up to which this round collapses. Larger shares make fewer rounds but worse collapses; levels with many
 * vertices can afford them. */
static float find_threshold(const decimation *d) {
  int32_t n = d->live_count, count = n <= SMALL ? n : SAMPLES;
  double share = n > 20000 ? 0.4 : n > 2000 ? 0.24 : n >= SINGLE_BELOW ? 0.05 : 0;
  if (d->fails > 2) { /* stuck: raise the share, in the end to all */
    share = share * (1 << (d->fails < 6 ? d->fails : 6)) + 0.02 * d->fails;
  }
  if (share > 0.9 || d->fails > FAILS_UNTIL_ALL) {
    return INFINITY;
  }
  float sample[SAMPLES];
  uint32_t seed = (uint32_t)d->round * 977;
  for (int32_t i = 0; i < count; i++) {
    seed = seed * 1664525U + 1013904223U;
    int64_t at = count == n ? i : (int64_t)(((uint64_t)seed * (uint64_t)n) >> 32);
    sample[i] = d->cost[d->live[at]];
  }
  int32_t at = (int32_t)(share * (count == n ? count : count - 1)) + (count == n ? d->fails : 0);
  return select_float(sample, count, at < count ? at : count - 1);
}

static void evaluate(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  const decimation *d = arg;
  orb_cost_job job = {.surface = &d->h->surface,
                      .vertex = d->live,
                      .dirty = d->dirty,
                      .threshold = d->threshold,
                      .cost = d->cost,
                      .target = d->target};
  d->loops->costs(&job, begin, end);
}

static orb_status begin_round(decimation *d) {
  orb_hierarchy *h = d->h;
  d->round++;
  if (h->round_count + 2 > h->round_capacity) {
    int32_t capacity = 2 * h->round_capacity + 256;
    int32_t *grown = orb_realloc(d->ctx, h->round_start, (size_t)capacity, sizeof(int32_t));
    if (!grown) {
      return ORB_E_NO_MEMORY;
    }
    h->round_start = grown;
    h->round_capacity = capacity;
  }
  h->round_start[h->round_count] = h->log_count;
  if (d->round == 1 || d->live_count <= LAZY_ABOVE || d->fails > 0) {
    d->threshold = INFINITY;
    ORB_TRY(orb_sliced_for(d->ctx, d->live_count, GRAIN, evaluate, d));
    d->threshold = find_threshold(d);
    return ORB_OK;
  }
  d->threshold = find_threshold(d);
  return orb_sliced_for(d->ctx, d->live_count, GRAIN, evaluate, d);
}

static orb_status run_round(decimation *d) {
  ORB_TRY(begin_round(d));
  int32_t done = 0, n = d->live_count;
  const orb_corner_table *s = &d->h->surface;
  for (int32_t i = 0; i < n && n - done > 4; i++) {
    if (i + AHEAD < n && d->cost[d->live[i + AHEAD]] <= d->threshold) {
      __builtin_prefetch(s->corner + s->vertex_corner[d->live[i + AHEAD]]);
    }
    ORB_TRY(try_collapse(d, d->live[i], d->threshold, &done));
    if (n < SINGLE_BELOW && done) {
      break;
    }
    if (i % CANCEL_EVERY == CANCEL_EVERY - 1) {
      ORB_TRY(orb_context_check(d->ctx));
    }
  }
  if (done == 0) {
    if (++d->fails > FAILS_MOST) {
      return orb_fail(d->ctx, ORB_E_NOT_GENUS_ZERO,
                      "The surface cannot be reduced below %d vertices, so it is not a sphere; repair the mesh first.",
                      n);
    }
    return ORB_OK;
  }
  d->fails = 0;
  d->h->round_count++;
  d->h->round_start[d->h->round_count] = d->h->log_count;
  int32_t kept = 0;
  for (int32_t i = 0; i < n; i++) {
    if (!d->dead[d->live[i]]) {
      d->live[kept++] = d->live[i];
    }
  }
  d->live_count = kept;
  return ORB_OK;
}

static orb_status allocate(decimation *d) {
  orb_context *ctx = d->ctx;
  int64_t n = d->h->surface.vertex_count;
  d->cost = ORB_NEW(ctx, float, n);
  d->target = ORB_NEW(ctx, int32_t, n);
  d->dirty = ORB_NEW(ctx, unsigned char, n);
  d->dead = ORB_NEW0(ctx, unsigned char, n);
  d->mark = ORB_NEW0(ctx, int32_t, n);
  d->lock = ORB_NEW0(ctx, int32_t, n);
  d->live = ORB_NEW(ctx, int32_t, n);
  d->h->log = ORB_NEW(ctx, orb_collapse, n);
  d->h->area_capacity = 5 * n;
  d->h->area_log = ORB_NEW(ctx, float, d->h->area_capacity);
  if (!d->cost || !d->target || !d->dirty || !d->dead || !d->mark || !d->lock || !d->live || !d->h->log ||
      !d->h->area_log) {
    return ORB_E_NO_MEMORY;
  }
  memset(d->dirty, 1, (size_t)n);
  memset(d->cost, 0, sizeof(float) * (size_t)n);
  for (int32_t i = 0; i < n; i++) {
    d->live[i] = i;
  }
  d->live_count = (int32_t)n;
  return ORB_OK;
}

orb_status orb_decimate(orb_context *ctx, orb_hierarchy *h, const unsigned char *keep, int32_t keep_until) {
  decimation d = {.ctx = ctx, .h = h, .loops = h->loops, .keep = keep, .keep_until = keep_until};
  double full = log((double)h->surface.vertex_count / 4) + 1e-9;
  orb_status status;
  ORB_GO(status, allocate(&d), done);
  ORB_GO(status, begin_round(&d), done); /* round_start must exist even if there is nothing to do */
  while (d.live_count > 4) {
    ORB_GO(status, run_round(&d), done);
    orb_progress(ctx, "simplify", 1 - log((double)d.live_count / 4) / full);
  }
  for (int i = 0; i < 4; i++) {
    h->base[i] = d.live[i];
  }
done:
  orb_free(ctx, d.cost);
  orb_free(ctx, d.target);
  orb_free(ctx, d.dirty);
  orb_free(ctx, d.dead);
  orb_free(ctx, d.mark);
  orb_free(ctx, d.lock);
  orb_free(ctx, d.live);
  orb_free(ctx, d.ring.vertex);
  return status;
}
