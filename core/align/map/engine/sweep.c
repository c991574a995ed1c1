/* Sweeps of a level by the vector loops: what steps read is laid out once for all sweeps of a round.
 *
 * A sweep goes through the parts of the level, which run side by side, and then through the border between them. So
 * threads of a small level wait for each other once a sweep, and not after each colour, which took longer than its
 * steps; colours of a border are shared only where they are large. Each part, and the border, goes from colour to
 * colour. No two vertices of a colour are neighbours, so their steps are independent: the stirred ones, near which
 * something has moved, are listed first and stepped then. Parts and lists are the same for any number of threads, and
 * so are the results. */
#include "align/map/engine/sweep.h"

#include <string.h>

#include "align/map/engine/step.h"
#include "align/map/engine/vector/loops.h"
#include "base/check.h"
#include "base/context.h"
#include "base/memory.h"
#include "base/parallel.h"

enum {
  STEP_GRAIN = 32
}; /* vertices of a chunk of the border: a multiple of all lanes, so that only the last is not full */

typedef struct sweep_run {
  const orb_map_loops *loops;
  orb_map_step_job job;
  int32_t *large; /* where by_group has vertices with more than ORB_MAP_STEP_RING_MAX spokes: in the border */
  int32_t large_count;
  int32_t *stepped; /* vertices of each part, in this sweep */
} sweep_run;

static void run_free(orb_context *ctx, sweep_run *s) {
  orb_free(ctx, s->job.row);
  orb_free(ctx, s->job.at);
  orb_free(ctx, s->job.triangle);
  orb_free(ctx, s->job.ring);
  orb_free(ctx, s->job.list);
  orb_free(ctx, s->job.spoke);
  orb_free(ctx, s->large);
  orb_free(ctx, s->stepped);
}

static void put_vertex(const orb_map_step_job *j, int32_t v) {
  const orb_map_level *l = j->level;
  double *row = j->row + ORB_MAP_ROW * (size_t)v;
  memcpy(row, l->y + 3 * (size_t)v, sizeof(double[3]));
  memcpy(row + 3, l->x + 3 * (size_t)v, sizeof(double[3]));
  memcpy(row + 6, l->n + 3 * (size_t)v, sizeof(double[3]));
  row[9] = l->density[v];
  j->triangle[v] = l->place[v].triangle;
  memcpy(j->at + 3 * (size_t)v, l->place[v].at, sizeof(double[3]));
}

static void take_vertex(const orb_map_step_job *j, int32_t v) {
  orb_map_level *l = j->level;
  const double *row = j->row + ORB_MAP_ROW * (size_t)v;
  memcpy(l->y + 3 * (size_t)v, row, sizeof(double[3]));
  memcpy(l->x + 3 * (size_t)v, row + 3, sizeof(double[3]));
  memcpy(l->n + 3 * (size_t)v, row + 6, sizeof(double[3]));
  l->density[v] = row[9];
  l->place[v].triangle = j->triangle[v];
  memcpy(l->place[v].at, j->at + 3 * (size_t)v, sizeof(double[3]));
}

static int32_t valence(const orb_map_level *l, int32_t v) {
  return l->start[v + 1] - l->start[v];
}

/* Pinned vertices do not move, and so do not stir their neighbours. */
static void fill(sweep_run *s) {
  orb_map_step_job *j = &s->job;
  orb_map_level *l = j->level;
  for (int32_t v = 0; v < l->count; v++) {
    put_vertex(j, v);
    j->pulled |= l->pull[v] > 0;
    l->moved[v] = l->pinned[v] ? 0 : l->moved[v];
  }
  for (size_t i = 0; i < 3 * (size_t)l->triangle_count; i++) {
    const orb_map_spoke *from = &l->spoke[i];
    const float shape[4] = {(float)from->cv, (float)from->cq, (float)from->cr, (float)from->area};
    j->ring[i] = from->q;
    memcpy(j->spoke + 4 * i, shape, sizeof shape);
  }
  for (int32_t i = l->group_start[l->parts * l->colours]; i < l->moving; i++) {
    if (valence(l, l->by_group[i]) > ORB_MAP_STEP_RING_MAX) {
      s->large[s->large_count++] = i;
    }
  }
}

static orb_status reserve(orb_context *ctx, sweep_run *s) {
  orb_map_step_job *j = &s->job;
  size_t n = (size_t)j->level->count, m = 3 * (size_t)j->level->triangle_count;
  j->row = ORB_NEW0(ctx, double, (size_t)ORB_MAP_ROW *n); /* zeroed: whole vectors are read */
  j->at = ORB_NEW(ctx, double, 3 * n);
  j->triangle = ORB_NEW(ctx, int32_t, n);
  j->ring = ORB_NEW(ctx, int32_t, m);
  j->list = ORB_NEW(ctx, int32_t, n);
  j->spoke = ORB_NEW(ctx, float, 4 * m);
  s->large = ORB_NEW(ctx, int32_t, m / ORB_MAP_STEP_RING_MAX);
  s->stepped = ORB_NEW(ctx, int32_t, j->level->parts);
  return j->row && j->at && j->triangle && j->ring && j->list && j->spoke && s->large && s->stepped ? ORB_OK
                                                                                                    : ORB_E_NO_MEMORY;
}

/* Has anything around v moved since v was last optimal? Vertices that were pinned after the level was made have a
 * colour, but stay. */
static int is_stirred(const orb_map_step_job *j, int32_t v) {
  const orb_map_level *l = j->level;
  if (l->pinned[v]) {
    return 0;
  }
  int stirred = l->moved[v] > j->rules->still;
  for (int32_t i = l->start[v]; i < l->start[v + 1] && !stirred; i++) {
    stirred = l->moved[j->ring[i]] > j->rules->still;
  }
  return stirred;
}

/* Lists those of group g that are stirred and have few spokes, from `list` on; returns how many. */
static int32_t list_group(const orb_map_step_job *j, int32_t g, int32_t *list) {
  orb_map_level *l = j->level;
  int32_t count = 0;
  for (int32_t i = l->group_start[g]; i < l->group_start[g + 1]; i++) {
    const int32_t v = l->by_group[i];
    if (valence(l, v) > ORB_MAP_STEP_RING_MAX) {
      continue;
    }
    if (is_stirred(j, v)) {
      list[count++] = v;
    } else {
      l->moved[v] = 0;
    }
  }
  return count;
}

/* Sweeps parts. Each has its own stretch of the list. */
static void sweep_parts(void *arg, int64_t begin, int64_t end, int thread) {
  const sweep_run *s = arg;
  const orb_map_level *l = s->job.level;
  (void)thread;
  for (int32_t part = (int32_t)begin; part < end; part++) {
    const int32_t first = l->group_start[part * l->colours];
    s->stepped[part] = 0;
    for (int32_t c = 0; c < l->colours; c++) {
      const int32_t count = list_group(&s->job, part * l->colours + c, s->job.list + first);
      s->loops->steps(&s->job, first, first + count);
      s->stepped[part] += count;
    }
  }
}

static void step_chunk(void *arg, int64_t begin, int64_t end, int thread) {
  const sweep_run *s = arg;
  (void)thread;
  s->loops->steps(&s->job, begin, end);
}

/* The step of step.c, which works on the level itself. */
static void step_large(const orb_map_step_job *j, int32_t v) {
  orb_map_level *l = j->level;
  for (int32_t i = l->start[v]; i < l->start[v + 1]; i++) {
    take_vertex(j, j->ring[i]);
  }
  take_vertex(j, v);
  l->moved[v] = orb_map_level_step(l, &j->fixed->b, j->rules, v);
  put_vertex(j, v);
}

/* Sweeps colour c of the border; returns the number of steps. next: of s->large, the first that is not yet swept. */
static int32_t sweep_border(orb_context *ctx, sweep_run *s, int32_t c, int32_t *next) {
  orb_map_level *l = s->job.level;
  const int32_t g = l->parts * l->colours + c;
  int32_t stepped = list_group(&s->job, g, s->job.list);
  orb_parallel_for(ctx, stepped, STEP_GRAIN, step_chunk, s);
  for (; *next < s->large_count && s->large[*next] < l->group_start[g + 1]; (*next)++) {
    int32_t v = l->by_group[s->large[*next]];
    if (is_stirred(&s->job, v)) {
      step_large(&s->job, v);
      stepped++;
    } else {
      l->moved[v] = 0;
    }
  }
  return stepped;
}

/* One sweep. *stepped: the number of steps. */
static orb_status sweep_once(orb_context *ctx, sweep_run *s, int32_t *stepped) {
  const orb_map_level *l = s->job.level;
  int32_t next = 0;
  *stepped = 0;
  orb_parallel_for(ctx, l->parts, 1, sweep_parts, s);
  for (int32_t part = 0; part < l->parts; part++) {
    *stepped += s->stepped[part];
  }
  for (int32_t c = 0; c < l->colours; c++) {
    ORB_TRY(orb_context_check(ctx));
    *stepped += sweep_border(ctx, s, c, &next);
  }
  return orb_context_check(ctx);
}

orb_status orb_map_level_sweeps(orb_context *ctx, orb_map_level *l, const orb_map_packed *packed,
                                const orb_map_rules *rules, int count, int32_t enough, int64_t *work) {
  sweep_run s = {.loops = orb_map_loops_of(orb_context_cpu(ctx)), .job = {.fixed = packed, .rules = rules, .level = l}};
  int32_t stepped = l->count;
  orb_status status;
  ORB_GO(status, reserve(ctx, &s), done);
  fill(&s);
  for (int i = 0; i < count && stepped > enough && status == ORB_OK; i++) {
    status = sweep_once(ctx, &s, &stepped);
    *work -= stepped;
    orb_progress_steps(ctx, stepped);
  }
  for (int32_t v = 0; v < l->count; v++) {
    take_vertex(&s.job, v);
  }
done:
  run_free(ctx, &s);
  return status;
}
