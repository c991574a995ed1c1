/* One damped Newton step of every vertex of a batch, lane by lane.
 *
 * A step is over-relaxed, goes at most 0.8 of the way to the nearest plane of the kernel, is halved once where the
 * energy does not fall, and is dropped where it still does not. A whole batch is swept in floats, twice as many at a
 * time as doubles. A batch with a triangle that is too flat for floats, or too small, is swept in doubles: a lane moves
 * only where every new determinant exceeds 1e-14 times the star's radius. That is far above what rounding of the stored
 * point can do to a determinant (about 4e-16 times that radius). Lanes that start below twice that bound are reported
 * as stiff and left to the scalar step with its exact test.
 *
 * In floats, rounding can change a determinant by about 1e-6 of the squares of its sides. SWEEP_FLAT is well above
 * that. Twice the bound of doubles is added to it. */

enum {
  SWEEP_GROUP = 2, /* batches that are swept side by side */
  SWEEP_TRIES = 2, /* lengths of a step: full and half */
  SWEEP_RING = 64  /* room for a ring; at least ORB_SWEEP_RING_MAX */
};
static const float SWEEP_FLAT = 1e-5F;

#define STAR(x) x##_floats
#define SV bf
#define SM bm
#define SV_SET(x) bf_set(x)
#define SV_SQRT bf_sqrt
#define SV_RECIPROCAL bf_reciprocal
#define SV_MAX bf_max
#define SV_MIN bf_min
#define SV_CHOOSE bf_choose
#define SV_ROW bf_load
#include "embed/newton/vector/star.inc.h"

#define STAR(x) x##_doubles
#define SV vd
#define SM vm
#define SV_SET(x) vd_set(x)
#define SV_SQRT vd_sqrt
#define SV_RECIPROCAL(x) (1 / (x))
#define SV_MAX vd_max
#define SV_MIN vd_min
#define SV_CHOOSE vd_choose
#define SV_ROW vd_load_floats
#include "embed/newton/vector/star.inc.h"

/* Centre and frame (Duff et al. 2017) of half a batch. */
typedef struct sweep_frame {
  vd p[3], e1[3], e2[3];
} sweep_frame;

static inline void sweep_open(const orb_sweep_job *job, int64_t batch, int half, sweep_frame *at) {
  vd_gather3(job->point, job->vertex + batch * BATCH + half * LANES, at->p);
  vd p0 = at->p[0], p1 = at->p[1], p2 = at->p[2], one = vd_set(1);
  vd s = vd_choose(p2 < 0, -one, one), a = -one / (s + p2), b = p0 * p1 * a;
  at->e1[0] = one + s * p0 * p0 * a;
  at->e1[1] = s * b;
  at->e1[2] = -s * p0;
  at->e2[0] = b;
  at->e2[1] = s + p1 * p1 * a;
  at->e2[2] = -p1;
}

static inline sweep_weights_floats sweep_weights_of_floats(const orb_newton_energy *e) {
  return (sweep_weights_floats){bf_set((float)e->w), bf_set((float)e->angle), bf_set((float)e->area)};
}

static inline sweep_weights_doubles sweep_weights_of_doubles(const orb_newton_energy *e) {
  return (sweep_weights_doubles){vd_set(e->w), vd_set(e->angle), vd_set(e->area)};
}

/* Moves the lanes by (s, t), those not at all where both are 0. Lanes that stand for the same vertex move alike. */
static inline void sweep_store(const orb_sweep_job *job, int64_t batch, int half, const sweep_frame *at, vd s, vd t) {
  vd to[3];
  for (int k = 0; k < 3; k++) {
    to[k] = at->p[k] + s * at->e1[k] + t * at->e2[k];
  }
  vm moved = (vm)(s != 0) | (vm)(t != 0);
  vd inverse = 1.0 / vd_sqrt(to[0] * to[0] + to[1] * to[1] + to[2] * to[2]);
  for (int k = 0; k < 3; k++) {
    to[k] = vd_choose(moved, to[k] * inverse, at->p[k]);
  }
  vd_scatter3(job->point, job->vertex + batch * BATCH + half * LANES, to);
}

static inline unsigned vm_bits(vm mask) {
  unsigned bits = 0;
  for (int l = 0; l < LANES; l++) {
    bits |= mask[l] ? 1U << l : 0U;
  }
  return bits;
}

/* Half a batch in doubles. Adds to *energy and *fall; returns the stiff lanes. */
static unsigned sweep_half(const orb_sweep_job *job, int64_t batch, int half, double *energy, double *fall) {
  sweep_frame at;
  sweep_star_doubles q;
  int k = job->valence[batch], used = job->fill[batch] - half * LANES;
  const int32_t *ring = job->ring + job->offset[batch] * BATCH + half * LANES;
  const float *shape = job->shape + 4 * job->offset[batch] * BATCH + half * LANES;
  vd count;
  const sweep_weights_doubles w = sweep_weights_of_doubles(&job->weight);
  if (k < 3 || k > ORB_SWEEP_RING_MAX) {
    __builtin_unreachable(); /* level.c makes no such batch */
  }
  for (int l = 0; l < LANES; l++) {
    count[l] = job->count[batch * BATCH + half * LANES + l];
  }
  sweep_open(job, batch, half, &at);
  for (int i = 0; i < k; i++) {
    vd u[3];
    vd_gather3(job->point, ring + (int64_t)i * BATCH, u);
    u[0] -= at.p[0];
    u[1] -= at.p[1];
    u[2] -= at.p[2];
    q.ring[i].x = u[0] * at.e1[0] + u[1] * at.e1[1] + u[2] * at.e1[2];
    q.ring[i].y = u[0] * at.e2[0] + u[1] * at.e2[1] + u[2] * at.e2[2];
    q.ring[i].z = u[0] * at.p[0] + u[1] * at.p[1] + u[2] * at.p[2];
  }
  q.scale = q.down = vd_set(1);
  q.flatness = vd_set(0);
  q.least = vd_set(1e-14);
  sweep_expand_doubles(shape, w, k, job->count[batch * BATCH], count, &q);
  sweep_direction_doubles(&q, vd_set(job->relax), k);
  vm stiff = ~(vm)(q.spare > q.least * q.radius), todo = sweep_todo_doubles(&q) & ~stiff;
  vd s = vd_set(0), t = s, after = q.energy;
  for (int i = 0; i < SWEEP_TRIES && vm_any(todo); i++) {
    sweep_try_doubles(&q, shape, w, k, &todo, &s, &t, &after);
  }
  unsigned lanes = used >= LANES ? (1U << LANES) - 1 : used > 0 ? (1U << used) - 1 : 0, bits = vm_bits(stiff) & lanes;
  sweep_store(job, batch, half, &at, s, t);
  for (int l = 0; l < LANES; l++) {
    if ((lanes & ~bits) >> l & 1) {
      *energy += q.energy[l];
      *fall += q.energy[l] - after[l];
    }
  }
  return bits;
}

/* A batch on its way through the floats. */
typedef struct sweep_whole {
  sweep_frame at[HALVES];
  sweep_star_floats q;
  const float *shape;
  bm todo;
  bf s, t, after;
  int k, in_floats;
} sweep_whole;

/* Loads and expands a batch; clears in_floats where it needs doubles. */
static inline void sweep_begin(const orb_sweep_job *job, int64_t batch, sweep_whole *b) {
  int k = job->valence[batch];
  if (k < 3 || k > ORB_SWEEP_RING_MAX) {
    __builtin_unreachable(); /* level.c makes no such batch */
  }
  const int32_t *ring = job->ring + job->offset[batch] * BATCH;
  const unsigned char *counts = job->count + batch * BATCH;
  float scale = (float)job->scale;
  sweep_frame *at = b->at;
  bf frame[3][3], count = bf_set((float)k);
  b->k = k;
  b->shape = job->shape + 4 * job->offset[batch] * BATCH;
  for (int half = 0; half < HALVES; half++) {
    sweep_open(job, batch, half, &at[half]);
  }
  for (int i = 0; i < 3; i++) {
    frame[0][i] = bf_join(at[0].e1[i], at[1].e1[i]) * scale;
    frame[1][i] = bf_join(at[0].e2[i], at[1].e2[i]) * scale;
    frame[2][i] = bf_join(at[0].p[i], at[1].p[i]) * scale;
  }
  for (int i = 0; i < k; i++) {
    vd u[HALVES][3];
    bf v[3];
    for (int half = 0; half < HALVES; half++) {
      vd_gather3(job->point, ring + (int64_t)i * BATCH + half * LANES, u[half]);
    }
    for (int c = 0; c < 3; c++) {
      v[c] = bf_join(u[0][c] - at[0].p[c], u[1][c] - at[1].p[c]);
    }
    b->q.ring[i].x = v[0] * frame[0][0] + v[1] * frame[0][1] + v[2] * frame[0][2];
    b->q.ring[i].y = v[0] * frame[1][0] + v[1] * frame[1][1] + v[2] * frame[1][2];
    b->q.ring[i].z = v[0] * frame[2][0] + v[1] * frame[2][1] + v[2] * frame[2][2];
  }
  if (counts[0] < k) {
    for (int l = 0; l < BATCH; l++) {
      count[l] = counts[l];
    }
  }
  b->q.scale = bf_set(scale);
  b->q.down = bf_set(1 / scale);
  b->q.flatness = bf_set(SWEEP_FLAT);
  b->q.least = bf_set(2e-14F * scale);
  sweep_expand_floats(b->shape, sweep_weights_of_floats(&job->weight), k, counts[0], count, &b->q);
  bm fine = (bm)(b->q.spare > bf_set(0)) & (bm)(b->q.energy < bf_set(1e20F));
  b->in_floats = bm_bits(fine) == (unsigned)((1ULL << BATCH) - 1);
}

static inline void sweep_end(const orb_sweep_job *job, int64_t batch, const sweep_whole *b) {
  bm counted = bm_first(job->fill[batch]);
  double unscale = 1 / (job->scale * job->scale);
  job->energy[batch] = unscale * (double)bf_sum(bf_choose(counted, b->q.energy, bf_set(0)));
  job->fall[batch] = unscale * (double)bf_sum(bf_choose(counted, b->q.energy - b->after, bf_set(0)));
  job->stiff[batch] = 0;
  bf s = b->s * b->q.down, t = b->t * b->q.down;
  for (int half = 0; half < HALVES; half++) {
    sweep_store(job, batch, half, &b->at[half], bf_half(s, half), bf_half(t, half));
  }
}

static void sweep_in_doubles(const orb_sweep_job *job, int64_t batch) {
  unsigned stiff = 0;
  double energy = 0, fall = 0;
  for (int half = 0; half < HALVES; half++) {
    stiff |= sweep_half(job, batch, half, &energy, &fall) << (half * LANES);
  }
  job->stiff[batch] = (uint16_t)stiff;
  job->energy[batch] = energy;
  job->fall[batch] = fall;
}

/* Sweeps some batches side by side, stage by stage: a stage is short enough for the processor to overlap its batches.
 */
static void sweep_group(const orb_sweep_job *job, int64_t first, int count) {
  sweep_whole group[SWEEP_GROUP];
  const sweep_weights_floats w = sweep_weights_of_floats(&job->weight);
  bf relax = bf_set((float)job->relax);
  for (int i = 0; i < count; i++) {
    sweep_begin(job, first + i, &group[i]);
  }
  for (int i = 0; i < count; i++) {
    sweep_direction_floats(&group[i].q, relax, group[i].k);
    group[i].s = group[i].t = bf_set(0);
    group[i].after = group[i].q.energy;
    group[i].todo = sweep_todo_floats(&group[i].q);
  }
  for (int length = 0; length < SWEEP_TRIES; length++) {
    for (int i = 0; i < count; i++) {
      sweep_whole *b = &group[i];
      if (length == 0 || bm_any(b->todo)) {
        sweep_try_floats(&b->q, b->shape, w, b->k, &b->todo, &b->s, &b->t, &b->after);
      }
    }
  }
  for (int i = 0; i < count; i++) {
    if (group[i].in_floats) {
      sweep_end(job, first + i, &group[i]);
    } else {
      sweep_in_doubles(job, first + i);
    }
  }
}

static void sweep_range(const orb_sweep_job *job, int64_t begin, int64_t end) {
  for (int64_t i = begin; i < end; i += SWEEP_GROUP) {
    sweep_group(job, i, end - i < SWEEP_GROUP ? (int)(end - i) : SWEEP_GROUP);
  }
}
