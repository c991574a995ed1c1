/* Damped Newton steps of batches of vertices: the step of step.c, lane by lane. */
#include "align/map/engine/vector/expand.inc.h"
#include "align/map/engine/vector/trace.inc.h"

/* Places that a step reaches, and the surface there. */
typedef struct step_try {
  int32_t triangle[ORB_LANES];
  vd at[3], y[3], x[3];
  vm reached; /* lanes whose path ended; the others stay where they are */
} step_try;

/* Walks from the places of the lanes `todo` by t times the step. */
static inline void try_trace(const orb_map_step_job *job, const step_batch *b, vm todo, vd t, const vd step[2],
                             step_try *out) {
  vd sum = vd_set(0);
  for (int l = 0; l < LANES; l++) {
    const int32_t v = b->v[l];
    const double *at = job->at + 3 * (int64_t)v;
    step_path p = {job->triangle[v], -1, {at[0], at[1], at[2]}, {t[l] * step[0][l], t[l] * step[1][l]}};
    int reached = todo[l] && path_end(job->fixed, &p);
    out->reached[l] = -reached;
    out->triangle[l] = reached ? p.triangle : job->triangle[v];
    for (int k = 0; k < 3; k++) {
      out->at[k][l] = reached ? p.at[k] : at[k];
    }
  }
  for (int k = 0; k < 3; k++) {
    sum += out->at[k];
  }
  sum = 1.0 / sum;
  for (int k = 0; k < 3; k++) {
    out->at[k] *= sum;
  }
}

/* Lane l gets the row of corner c of its triangle, from a column on. */
static inline void try_rows(const orb_map_step_job *job, const step_try *t, int c, int column,
                            const double *row[ORB_LANES]) {
  for (int l = 0; l < LANES; l++) {
    int32_t corner = job->fixed->triangles[3 * (int64_t)t->triangle[l] + c];
    row[l] = job->fixed->vertex_row + ORB_MAP_ROW * (int64_t)corner + column;
  }
}

/* Position and point on the sphere at the places. */
static inline void try_lift(const orb_map_step_job *job, step_try *t) {
  vd sum[8] = {0};
  for (int c = 0; c < 3; c++) {
    const double *row[ORB_LANES];
    vd part[8];
    try_rows(job, t, c, 0, row);
    vd_rows4(row, part);
    try_rows(job, t, c, 4, row);
    vd_rows4(row, part + 4);
    for (int k = 0; k < 6; k++) {
      sum[k] += t->at[c] * part[k];
    }
  }
  memcpy(t->y, sum, sizeof t->y);
  memcpy(t->x, sum + 3, sizeof t->x);
  vd scale = 1.0 / vd_sqrt(dot3(t->x, t->x));
  for (int k = 0; k < 3; k++) {
    t->x[k] *= scale;
  }
}

static inline void try_normal(const orb_map_step_job *job, const step_try *t, vd n[3]) {
  n[0] = n[1] = n[2] = vd_set(0);
  for (int c = 0; c < 3; c++) {
    const double *row[ORB_LANES];
    vd part[4];
    try_rows(job, t, c, 6, row);
    vd_rows4(row, part);
    for (int k = 0; k < 3; k++) {
      n[k] += t->at[c] * part[k];
    }
  }
  vd scale = 1.0 / (vd_sqrt(dot3(n, n)) + TINY);
  for (int k = 0; k < 3; k++) {
    n[k] *= scale;
  }
}

/* Moves the lanes `good`. length: of their steps. */
static inline void try_put(const orb_map_step_job *job, const step_batch *b, const step_try *t, vm good, vd length) {
  vd n[3];
  try_normal(job, t, n);
  for (int l = 0; l < b->count; l++) {
    if (!good[l]) {
      continue;
    }
    int32_t v = b->v[l];
    double *row = job->row + ORB_MAP_ROW * (int64_t)v;
    for (int k = 0; k < 3; k++) {
      row[k] = t->y[k][l];
      row[3 + k] = t->x[k][l];
      row[6 + k] = n[k][l];
      job->at[3 * (int64_t)v + k] = t->at[k][l];
    }
    row[9] = job->fixed->triangle_row[ORB_MAP_ROW * (int64_t)t->triangle[l] + 10];
    job->triangle[v] = t->triangle[l];
    job->level->moved[v] = length[l];
  }
}

/* Lengths along the direction, from long to short, until every lane descends enough or has tried all. */
static inline void batch_search(const orb_map_step_job *job, const step_batch *b, vm todo, const vd step[2], vd slope) {
  const orb_map_params *params = job->level->params;
  vd length = vd_sqrt(step[0] * step[0] + step[1] * step[1]), most = vd_sqrt(b->longest2),
     t = vd_set(job->rules->omega);
  t = vd_choose(t * length > most, most / (length + TINY), t);
  for (int tries = 0; tries < params->step.tries && vm_any(todo); tries++) {
    step_try at;
    try_trace(job, b, todo, t, step, &at);
    try_lift(job, &at);
    vd energy = batch_energy(job, b, at.y, at.x);
    vm over = (vm)(t > 1.0);
    vd enough = b->system.energy + vd_choose(over, vd_set(0), params->step.sufficient * t * slope);
    vm good = todo & at.reached & (vm)(energy <= enough);
    if (vm_any(good)) {
      try_put(job, b, &at, good, t * length);
      todo &= ~good;
    }
    t = vd_choose(over, vd_set(1), params->step.shorten * t);
  }
}

static void batch_step(const orb_map_step_job *job, int64_t begin, int64_t end) {
  step_batch b;
  vd step[2], slope;
  batch_load(job, begin, end, &b);
  batch_expand(job, &b);
  vm todo = batch_solve(job, &b, step, &slope);
  for (int l = 0; l < LANES; l++) {
    job->level->moved[b.v[l]] = 0;
    todo[l] = l < b.count ? todo[l] : 0;
  }
  batch_search(job, &b, todo, step, slope);
}

static void step_range(const orb_map_step_job *job, int64_t begin, int64_t end) {
  for (int64_t i = begin; i < end; i += LANES) {
    batch_step(job, i, i + LANES < end ? i + LANES : end);
  }
}
