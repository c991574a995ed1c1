/* Undoing a round, placing its vertices in their kernels, and what happens where doubles have no room for that.
 *
 * A vertex goes to the centroid of its ring if that lies well inside its kernel, otherwise to a point that a search of
 * the kernel finds; then it makes one Newton step. The stars of a round do not overlap, so all of this runs in
 * parallel. In exact arithmetic the kernel is never empty, because the ring is a fan from the vertex that was split.
 * Where doubles have no room for it, the collapse is applied again, the vertices around it are relaxed (their energy is
 * a barrier that opens thin triangles), more of them at each attempt, and the placement is tried again. Every placement
 * is tested exactly, so all live triangles are exactly positive at all times.
 */
#include "embed/newton/place.h"

#include <math.h>

#include "base/check.h"
#include "base/error.h"
#include "base/loops.h"
#include "base/memory.h"
#include "embed/common/kernel.h"
#include "embed/newton/collapse.h"
#include "embed/newton/multires.h"
#include "embed/newton/refiner.h"
#include "embed/newton/relax.h"
#include "embed/newton/star.h"
#include "numeric/vec3.h"

enum {
  GRAIN = 256,        /* vertices of a chunk */
  AHEAD = 8,          /* collapses between a prefetch and its use */
  PLAIN_ABOVE = 1000, /* live vertices above which one well inside its kernel makes no step, as sweeps follow */
  RELAX_MOST = 400,   /* ring entries relaxed around one crowded vertex: about 60 stars, or one pole */
  POLE = 100,         /* only the sweeps move a vertex of this valence or more */
  ATTEMPTS = 16       /* at a kernel that doubles have no room for */
};

static const double WELL_INSIDE = 0.02; /* least determinant of a triangle over its squared edge on the ring */

typedef struct round_job {
  orb_context *ctx;
  orb_refiner *r;
  double blend;
  int32_t first;         /* collapses first … are placed */
  unsigned char *failed; /* of each collapse of the round */
  atomic_int status;     /* an orb_status; the first failure of any thread */
  atomic_int any_failed;
} round_job;

/* Sets p to the centroid of the ring. Returns whether it lies well inside the kernel. */
static int centroid_inside(const orb_star *star, double p[3]) {
  p[0] = p[1] = p[2] = 0;
  for (int32_t i = 0; i < star->count; i++) {
    for (int k = 0; k < 3; k++) {
      p[k] += star->ring[i][k];
    }
  }
  if (!(orb_normalize(p) > 1e-6)) {
    return 0;
  }
  double radius2 = 0, least = INFINITY;
  for (int32_t i = 0; i < star->count; i++) {
    const double *a = star->ring[i], *b = star->ring[i + 1 < star->count ? i + 1 : 0];
    double det = orb_det(p, a, b), reach2 = orb_distance2(p, a);
    if (!(det > WELL_INSIDE * orb_distance2(a, b))) {
      return 0;
    }
    radius2 = reach2 > radius2 ? reach2 : radius2;
    least = det < least ? det : least;
  }
  /* the error of orb_det() is below 1e-15 times a sum of six products, each at most the squared radius */
  return least > 1e-14 * radius2 || orb_kernel_contains((const double(*)[3])star->ring, star->count, p);
}

/* Places one vertex whose collapse is undone; *found is 0 where its kernel has no room. */
static orb_status place_vertex(orb_context *ctx, orb_refiner *r, int32_t v, double blend, int thread, int *found) {
  orb_star *star = &r->star[thread];
  const orb_corner_table *s = &r->hierarchy->surface;
  double p[3], before;
  ORB_TRY(orb_star_walk(ctx, star, s, v, r->point));
  *found = centroid_inside(star, p);
  r->crowding[v] = 0;
  if (*found && r->live > PLAIN_ABOVE) {
    memcpy(r->point + 4 * (int64_t)v, p, sizeof p);
    return ORB_OK;
  }
  if (!*found) {
    ORB_TRY(orb_kernel_point(ctx, &r->room[thread], (const double(*)[3])star->ring, star->count, p, found));
  }
  if (*found) {
    orb_star_shape(star, s, v, blend);
    double energy = orb_star_newton(star, orb_refiner_energy(r), p, &before);
    memcpy(r->point + 4 * (int64_t)v, p, sizeof p);
    r->crowding[v] = (float)(energy / (2 * star->area));
  }
  return ORB_OK;
}

static void place_range(void *arg, int64_t begin, int64_t end, int thread) {
  round_job *job = arg;
  const orb_corner_table *s = &job->r->hierarchy->surface;
  for (int64_t i = begin; i < end; i++) {
    if (i + AHEAD < end) {
      __builtin_prefetch(s->corner + job->r->hierarchy->log[job->first + i + AHEAD].first);
      __builtin_prefetch(s->corner + job->r->hierarchy->log[job->first + i + AHEAD].last);
    }
    if (i + AHEAD / 2 < end) { /* what those blocks point to */
      int32_t c = job->r->hierarchy->log[job->first + i + AHEAD / 2].first;
      __builtin_prefetch(s->corner + s->opposite[orb_corner_next(c)]);
      __builtin_prefetch(job->r->point + 4 * (int64_t)s->corner[orb_corner_next(c)]);
      __builtin_prefetch(job->r->point + 4 * (int64_t)s->corner[orb_corner_prev(c)]);
    }
    int found = 0;
    orb_status status =
        place_vertex(job->ctx, job->r, job->r->hierarchy->log[job->first + i].vertex, job->blend, thread, &found);
    if (status != ORB_OK) {
      atomic_store(&job->status, (int)status);
      return;
    }
    job->failed[i] = !found;
    if (!found) {
      atomic_store(&job->any_failed, 1);
    }
  }
}

typedef struct queue {
  orb_refiner *r;
  int64_t head, tail;
} queue;

static void enqueue(queue *q, int32_t v) {
  if (!q->r->queued[v] && q->tail - q->head < q->r->queue_capacity) {
    q->r->queued[v] = 1;
    q->r->queue[q->tail++ & (q->r->queue_capacity - 1)] = v;
  }
}

static void enqueue_ring(queue *q, int32_t v) {
  const orb_corner_table *s = &q->r->hierarchy->surface;
  int32_t start = s->vertex_corner[v], c = start;
  do {
    enqueue(q, s->corner[orb_corner_next(c)]);
    c = orb_corner_swing(s, c);
  } while (c != start);
}

static int32_t dequeue(queue *q) {
  int32_t v = q->r->queue[q->head++ & (q->r->queue_capacity - 1)];
  q->r->queued[v] = 0;
  return v;
}

/* Relaxes the surroundings of a vertex that was placed in a narrow kernel, as long and as far as that lowers the energy
 * of crowded stars. */
static orb_status relieve(orb_context *ctx, orb_refiner *r, int32_t v, double blend) {
  const orb_corner_table *s = &r->hierarchy->surface;
  queue q = {.r = r};
  orb_status status = ORB_OK;
  enqueue_ring(&q, v);
  enqueue(&q, v);
  for (int32_t done = 0; q.head < q.tail && done < RELAX_MOST && status == ORB_OK;) {
    int32_t u = dequeue(&q);
    if (s->valence[u] >= POLE && u != v) {
      continue;
    }
    done += s->valence[u] < POLE ? s->valence[u] : POLE;
    double gain, crowding;
    status = orb_refiner_relax(ctx, r, u, blend, &gain, &crowding);
    if (s->valence[u] < POLE && gain > 0.02 && crowding > 0.5 * r->settings.crowded) {
      enqueue_ring(&q, u);
      enqueue(&q, u);
    }
  }
  while (q.head < q.tail) {
    dequeue(&q);
  }
  return status;
}

/* Relaxes about `most` vertices outwards from v, in each of `passes` passes. */
static orb_status open_up(orb_context *ctx, orb_refiner *r, int32_t v, double blend, int32_t most, int passes) {
  orb_status status = ORB_OK;
  for (int pass = 0; pass < passes && status == ORB_OK; pass++) {
    queue q = {.r = r};
    enqueue(&q, v);
    int64_t seen = 0;
    for (; seen < q.tail && q.tail < most; seen++) { /* flags stay set, so each vertex comes once */
      enqueue_ring(&q, r->queue[seen]);
    }
    for (int64_t i = 0; i < q.tail && status == ORB_OK; i++) {
      double gain;
      status = orb_refiner_relax(ctx, r, r->queue[i], blend, &gain, NULL);
      if (status == ORB_OK && (i & 255) == 255) {
        status = orb_context_check(ctx);
      }
    }
    while (q.head < q.tail) {
      dequeue(&q);
    }
  }
  return status;
}

/* Places a vertex whose collapse has been applied again. */
static orb_status place_stubborn(orb_context *ctx, orb_refiner *r, int32_t index, double blend) {
  orb_hierarchy *h = r->hierarchy;
  int32_t parent = h->surface.corner[orb_corner_next(h->log[index].first)];
  for (int attempt = 0; attempt < ATTEMPTS; attempt++) {
    int found = 0;
    ORB_TRY(open_up(ctx, r, parent, blend, 16 << (attempt < 10 ? attempt : 10), 2 + attempt));
    orb_collapse_undo(h, index);
    ORB_TRY(place_vertex(ctx, r, h->log[index].vertex, blend, 0, &found));
    if (found) {
      return ORB_OK;
    }
    orb_collapse_redo(h, index);
  }
  orb_collapse_undo(h, index);
  return orb_fail(
      ctx, ORB_E_NOT_CERTIFIED,
      "Vertex %d of the mesh cannot be placed on the sphere: the triangles around it are too thin for double "
      "precision. Remove its thinnest triangles and try again.",
      h->surface.to_mesh[h->log[index].vertex]);
}

static orb_status place_failures(round_job *job, int32_t count) {
  orb_refiner *r = job->r;
  orb_hierarchy *h = r->hierarchy;
  for (int32_t i = 0; i < count; i++) {
    if (job->failed[i]) {
      orb_collapse_redo(h, job->first + i);
    }
  }
  orb_status status = ORB_OK;
  for (int32_t i = count - 1; i >= 0; i--) {
    if (job->failed[i] && status == ORB_OK) {
      status = place_stubborn(job->ctx, r, job->first + i, job->blend);
    } else if (job->failed[i]) {
      orb_collapse_undo(h, job->first + i); /* the surface must match h->undone */
    }
  }
  return status;
}

static orb_status relieve_crowded(round_job *job, int32_t count) {
  orb_refiner *r = job->r;
  for (int32_t i = count - 1; i >= 0; i--) {
    int32_t v = r->hierarchy->log[job->first + i].vertex;
    if (r->crowding[v] > r->settings.crowded || !isfinite(r->crowding[v])) {
      ORB_TRY(relieve(job->ctx, r, v, job->blend));
    }
    if ((i & 255) == 255) {
      ORB_TRY(orb_context_check(job->ctx));
    }
  }
  return ORB_OK;
}

/* The collapses of the next round to undo, or what is left of it: returns how many; *first: the first in the log. */
static int32_t next_round(const orb_hierarchy *h, int32_t *first) {
  int32_t end = h->log_count - h->undone, round = h->round_count;
  ORB_ASSERT(end > 0);
  while (h->round_start[round] >= end) {
    round--;
  }
  *first = h->round_start[round];
  return end - *first;
}

/* Undoes these collapses on the surface. */
static void undo_collapses(orb_refiner *r, int32_t first, int32_t count) {
  orb_hierarchy *h = r->hierarchy;
  r->level.valid = 0;
  for (int32_t i = first + count - 1; i >= first; i--) {
    if (i - AHEAD >= first) {
      __builtin_prefetch(h->surface.corner + h->log[i - AHEAD].first, 1);
      __builtin_prefetch(h->surface.corner + h->log[i - AHEAD].last, 1);
    }
    orb_collapse_undo(h, i);
  }
  h->undone += count;
}

orb_status orb_refiner_skip(orb_context *ctx, orb_refiner *r, int32_t vertices) {
  while (r->live < vertices) {
    int32_t first, count = next_round(r->hierarchy, &first);
    undo_collapses(r, first, count);
    for (int32_t i = 0; i < count; i++) {
      r->alive[r->hierarchy->log[first + i].vertex] = 1;
    }
    r->live += count;
    ORB_TRY(orb_context_check(ctx));
  }
  return ORB_OK;
}

orb_status orb_refiner_undo_round(orb_context *ctx, orb_refiner *r, double blend) {
  const orb_hierarchy *h = r->hierarchy;
  int32_t first, count = next_round(h, &first);
  round_job job = {.ctx = ctx, .r = r, .blend = blend, .first = first};
  job.failed = ORB_NEW0(ctx, unsigned char, count);
  if (!job.failed) {
    return ORB_E_NO_MEMORY;
  }
  undo_collapses(r, first, count);
  orb_status status;
  ORB_GO(status, orb_sliced_for(ctx, count, GRAIN, place_range, &job), done);
  ORB_GO(status, (orb_status)atomic_load(&job.status), done);
  for (int32_t i = 0; i < count; i++) {
    r->alive[h->log[first + i].vertex] = 1;
  }
  if (atomic_load(&job.any_failed)) {
    ORB_GO(status, place_failures(&job, count), done);
  }
  ORB_GO(status, relieve_crowded(&job, count), done);
  r->live += count;
done:
  orb_free(ctx, job.failed);
  return status;
}
