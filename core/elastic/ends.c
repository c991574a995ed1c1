#include "elastic/ends.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/check.h"
#include "base/context.h"
#include "base/memory.h"
#include "numeric/rotation.h"
#include "numeric/vec3.h"

enum { CLUSTERS = 64 };             /* crumpled parts that are listed, the first by number; a body has ten */
enum { TRIED = 2 * ORB_ENDS_MOST }; /* of them, those with most area may be ends */
enum { SMOOTHED = 4 };              /* rounds in which bends are smoothed over neighbours */
/* Bend of a vertex's edges (orb_registration_bend()), smoothed, from which it is crumpled, and the least mean of a
 * part. Of seven pairs of people, hands whose fingers had gone astray had a mean of 0.14 to 0.38. */
static const double CRUMPLED = 0.05, CRUMPLED_MEAN = 0.08;
/* Areas of a part, as shares of that of a ball: a hand has 0.02, a belly more than MOST. LEAST goes with the square of
 * the scale. */
static const double LEAST_AREA = 0.004, MOST_AREA = 0.06;
/* Least length from a wrist to its end, in radii, times the scale: a hand has 0.4, a foot 0.25. What is crumpled on
 * both sides of an elbow has its middle there. */
static const double LEAST_LENGTH = 0.2;

/* Neighbours that are crumpled. */
typedef struct cluster {
  int32_t begin, count; /* in search.order */
  double mass, bend;    /* sums; `bend` is weighted by mass */
} cluster;

typedef struct search {
  const orb_registration *r;
  double scale;
  double *bend;
  unsigned char *seen;
  int32_t *order;
  cluster cluster[CLUSTERS];
  int32_t count;
} search;

static void measure_bends(const orb_registration *r, double *bend) {
  for (int32_t v = 0; v < r->a.count; v++) {
    bend[v] = orb_registration_bend_at(r, v);
  }
}

static void smooth(const orb_body *a, double *bend, double *spare) {
  for (int i = 0; i < SMOOTHED; i++) {
    for (int32_t v = 0; v < a->count; v++) {
      double sum = bend[v] * a->mass[v], mass = a->mass[v];
      for (int32_t e = a->start[v]; e < a->start[v + 1]; e++) {
        sum += bend[a->next[e]] * a->mass[a->next[e]];
        mass += a->mass[a->next[e]];
      }
      spare[v] = mass > 0 ? sum / mass : 0;
    }
    memcpy(bend, spare, (size_t)a->count * sizeof *bend);
  }
}

/* The cluster around a crumpled vertex. */
static cluster take_cluster(search *s, int32_t from, int32_t begin) {
  const orb_body *a = &s->r->a;
  cluster out = {.begin = begin, .count = 1};
  int32_t *queue = s->order + begin;
  queue[0] = from;
  s->seen[from] = 1;
  for (int32_t k = 0; k < out.count; k++) {
    const int32_t v = queue[k];
    out.mass += a->mass[v];
    out.bend += a->mass[v] * s->bend[v];
    for (int32_t e = a->start[v]; e < a->start[v + 1]; e++) {
      const int32_t q = a->next[e];
      if (!s->seen[q] && s->bend[q] > CRUMPLED) {
        s->seen[q] = 1;
        queue[out.count++] = q;
      }
    }
  }
  return out;
}

static int by_mass(const void *x, const void *y) {
  const cluster *a = x, *b = y;
  const int more = (a->mass < b->mass) - (a->mass > b->mass);
  return more != 0 ? more : (a->begin > b->begin) - (a->begin < b->begin);
}

static void list_clusters(search *s) {
  const double ball = 4 * M_PI, least = LEAST_AREA * s->scale * s->scale * ball;
  int32_t begin = 0;
  for (int32_t v = 0; v < s->r->a.count && s->count < CLUSTERS; v++) {
    if (s->seen[v] || !(s->bend[v] > CRUMPLED)) {
      continue;
    }
    const cluster one = take_cluster(s, v, begin);
    begin += one.count;
    if (one.mass >= least && one.mass <= MOST_AREA * ball && one.bend >= CRUMPLED_MEAN * one.mass) {
      s->cluster[s->count++] = one;
    }
  }
  qsort(s->cluster, (size_t)s->count, sizeof *s->cluster, by_mass);
}

/* Distances from a cluster along edges, up to `most`: each vertex whose distance has shrunk passes it on. queue: room
 * for all vertices, waits: zero for each. */
static void spread(const search *s, const cluster *from, double most, double *away, int32_t *queue,
                   unsigned char *waits) {
  const orb_body *a = &s->r->a;
  int32_t first = 0, waiting = from->count;
  for (int32_t v = 0; v < a->count; v++) {
    away[v] = INFINITY;
  }
  for (int32_t k = 0; k < waiting; k++) {
    queue[k] = s->order[from->begin + k];
    away[queue[k]] = 0;
    waits[queue[k]] = 1;
  }
  for (; waiting > 0; waiting--) {
    const int32_t v = queue[first];
    first = (first + 1) % a->count;
    waits[v] = 0;
    for (int32_t e = a->start[v]; e < a->start[v + 1]; e++) {
      const int32_t q = a->next[e];
      const double d =
          away[v] + sqrt(orb_distance2(a->mesh->positions + 3 * (size_t)v, a->mesh->positions + 3 * (size_t)q));
      if (d < most && d < away[q]) {
        away[q] = d;
        if (!waits[q]) {
          waits[q] = 1;
          queue[(first + waiting - 1) % a->count] = q;
          waiting++;
        }
      }
    }
  }
}

/* The middle of the vertices whose distance lies in [least, most). Returns their mass. */
static double middle_of(const orb_body *a, const double *position, const double *away, double least, double most,
                        double out[3]) {
  double mass = 0;
  memset(out, 0, sizeof(double[3]));
  for (int32_t v = 0; v < a->count; v++) {
    if (away[v] >= least && away[v] < most) {
      mass += a->mass[v];
      for (int k = 0; k < 3; k++) {
        out[k] += a->mass[v] * position[3 * (size_t)v + (size_t)k];
      }
    }
  }
  for (int k = 0; k < 3; k++) {
    out[k] /= mass > 0 ? mass : 1;
  }
  return mass;
}

/* Where the wrist is, and which way it has turned. Returns 0 if there is no wrist, or no end beyond it. */
static int measure_end(const search *s, orb_end *end) {
  const orb_body *a = &s->r->a;
  const double *given = a->mesh->positions, *now = s->r->pose->position, near = s->scale * ORB_END_NEAR,
               far = s->scale * ORB_END_FAR;
  double h[9] = {0}, tip[3], along[3];
  if (!(middle_of(a, given, end->away, near, far, end->from) > 0)) {
    return 0;
  }
  (void)middle_of(a, now, end->away, near, far, end->to);
  (void)middle_of(a, given, end->away, 0, near, tip);
  for (int32_t v = 0; v < a->count; v++) {
    if (end->away[v] >= near && end->away[v] < far) {
      double p[3], q[3];
      orb_sub(given + 3 * (size_t)v, end->from, p);
      orb_sub(now + 3 * (size_t)v, end->to, q);
      orb_add_outer(h, q, p, a->mass[v]);
    }
  }
  if (!orb_nearest_rotation(h, end->turn)) {
    return 0;
  }
  orb_sub(tip, end->from, along);
  for (int k = 0; k < 3; k++) {
    end->axis[k] = orb_dot(end->turn + 3 * k, along);
  }
  return orb_normalize(end->axis) >= s->scale * LEAST_LENGTH;
}

/* Is a cluster a part of an end that was found before? */
static int is_taken(const search *s, const cluster *one, const orb_ends *ends) {
  for (int32_t e = 0; e < ends->count; e++) {
    for (int32_t k = 0; k < one->count; k++) {
      if (ends->end[e].away[s->order[one->begin + k]] < s->scale * ORB_END_FAR) {
        return 1;
      }
    }
  }
  return 0;
}

static orb_status take_ends(const search *s, orb_ends *out, int32_t *queue, unsigned char *waits) {
  for (int32_t i = 0; i < s->count && i < TRIED && out->count < ORB_ENDS_MOST; i++) {
    ORB_TRY(orb_context_check(s->r->ctx));
    orb_end *end = &out->end[out->count];
    if (is_taken(s, &s->cluster[i], out)) {
      continue;
    }
    end->away = ORB_NEW(s->r->ctx, double, s->r->a.count);
    if (!end->away) {
      return ORB_E_NO_MEMORY;
    }
    spread(s, &s->cluster[i], s->scale * ORB_END_PIECE, end->away, queue, waits);
    if (measure_end(s, end)) {
      out->count++;
    } else {
      orb_free(s->r->ctx, end->away);
      end->away = NULL;
    }
  }
  return ORB_OK;
}

orb_status orb_ends_find(const orb_registration *r, double scale, orb_ends *out) {
  const size_t n = (size_t)r->a.count;
  search s = {.r = r,
              .scale = scale,
              .bend = ORB_NEW(r->ctx, double, n),
              .seen = ORB_NEW0(r->ctx, unsigned char, n),
              .order = ORB_NEW(r->ctx, int32_t, n)};
  double *spare = ORB_NEW(r->ctx, double, n);
  int32_t *queue = ORB_NEW(r->ctx, int32_t, n);
  unsigned char *waits = ORB_NEW0(r->ctx, unsigned char, n);
  orb_status status = ORB_E_NO_MEMORY;
  memset(out, 0, sizeof *out);
  if (s.bend && s.seen && s.order && spare && queue && waits) {
    measure_bends(r, s.bend);
    smooth(&r->a, s.bend, spare);
    list_clusters(&s);
    status = take_ends(&s, out, queue, waits);
  }
  orb_free(r->ctx, s.bend);
  orb_free(r->ctx, s.seen);
  orb_free(r->ctx, s.order);
  orb_free(r->ctx, spare);
  orb_free(r->ctx, queue);
  orb_free(r->ctx, waits);
  return status;
}

void orb_ends_free(orb_context *ctx, orb_ends *ends) {
  for (int32_t e = 0; e < ORB_ENDS_MOST; e++) {
    orb_free(ctx, ends->end[e].away);
  }
  memset(ends, 0, sizeof *ends);
}
