/* The cost of a collapse.
 *
 * Collapsing v into its neighbour r_j leaves the triangles r_j r_{j+i} r_{j+i+1}. The cost is the sum of S²/A over them
 * (S the sum of squared edges, A the area, at least S/1000; small and round is cheap). A triangle that faces against
 * the star's normal counts three times. If r_j then has more than 8 neighbours, each further one adds a quarter of the
 * sum. The whole is multiplied by the star's target area over its own area, which keeps vertices that already stand for
 * much. All targets j are evaluated side by side: the ring is stored twice over, so that the rotation by i is an
 * unaligned load. */

enum { COST_ROOM = 2 * ORB_COST_RING_MAX + 2 * WIDE };

typedef struct cost_ring {
  float x[COST_ROOM], y[COST_ROOM], z[COST_ROOM], valence[COST_ROOM];
  int32_t id[ORB_COST_RING_MAX];
  int count;
  float target_area, own_area; /* of the star; own doubled */
  float nx, ny, nz;            /* its summed normal */
} cost_ring;

/* Reads the ring of v; 0 where it is larger than ORB_COST_RING_MAX. */
static int cost_gather(const orb_corner_table *s, int32_t v, cost_ring *r) {
  int32_t start = s->vertex_corner[v], c = start;
  int k = 0;
  r->target_area = 0;
  if (s->valence[v] > ORB_COST_RING_MAX) {
    return 0;
  }
  do {
    int32_t u = s->corner[orb_corner_next(c)];
    const float *p = s->position4 + 4 * (int64_t)u;
    r->id[k] = u;
    r->x[k] = p[0];
    r->y[k] = p[1];
    r->z[k] = p[2];
    r->valence[k] = p[3];
    r->target_area += orb_corner_area(s, c);
    k++;
    c = orb_corner_swing(s, c);
  } while (c != start);
  r->count = k;
  for (int i = 0; i < k + WIDE; i++) { /* k + i < COST_ROOM; the tail past 2k never counts but must be defined */
    r->x[k + i] = r->x[i];
    r->y[k + i] = r->y[i];
    r->z[k + i] = r->z[i];
    r->valence[k + i] = r->valence[i];
  }
  return 1;
}

static wm cost_mask(int first, int count) {
  wm out;
  for (int i = 0; i < WIDE; i++) {
    out[i] = first + i < count ? -1 : 0;
  }
  return out;
}

static float wf_total(wf x) {
  float sum = 0;
  for (int i = 0; i < WIDE; i++) {
    sum += x[i];
  }
  return sum;
}

/* Normal and area of the star before the collapse. */
static void cost_measure_star(const float *p, cost_ring *r) {
  wf nx = wf_set(0), ny = nx, nz = nx, area = nx;
  for (int j = 0; j < r->count; j += WIDE) {
    wm used = cost_mask(j, r->count);
    wf ux = wf_load(r->x + j) - p[0], uy = wf_load(r->y + j) - p[1], uz = wf_load(r->z + j) - p[2];
    wf vx = wf_load(r->x + j + 1) - p[0], vy = wf_load(r->y + j + 1) - p[1], vz = wf_load(r->z + j + 1) - p[2];
    wf zero = wf_set(0);
    wf x = wf_choose(used, uy * vz - uz * vy, zero), y = wf_choose(used, uz * vx - ux * vz, zero);
    wf z = wf_choose(used, ux * vy - uy * vx, zero);
    nx += x;
    ny += y;
    nz += z;
    area += wf_sqrt(x * x + y * y + z * z);
  }
  r->nx = wf_total(nx);
  r->ny = wf_total(ny);
  r->nz = wf_total(nz);
  r->own_area = wf_total(area);
}

/* Costs of collapsing into r_j … r_{j + WIDE − 1}. */
static wf cost_of_targets(const cost_ring *r, int j) {
  wf x0 = wf_load(r->x + j), y0 = wf_load(r->y + j), z0 = wf_load(r->z + j);
  wf bx = wf_load(r->x + j + 1) - x0, by = wf_load(r->y + j + 1) - y0, bz = wf_load(r->z + j + 1) - z0;
  wf lb = bx * bx + by * by + bz * bz, sum = wf_set(0);
  for (int i = 2; i < r->count; i++) {
    wf ax = bx, ay = by, az = bz, la = lb;
    bx = wf_load(r->x + j + i) - x0;
    by = wf_load(r->y + j + i) - y0;
    bz = wf_load(r->z + j + i) - z0;
    lb = bx * bx + by * by + bz * bz;
    wf ex = bx - ax, ey = by - ay, ez = bz - az;
    wf nx = ay * bz - az * by, ny = az * bx - ax * bz, nz = ax * by - ay * bx;
    wf edges = la + lb + ex * ex + ey * ey + ez * ez;
    wf area = wf_sqrt(nx * nx + ny * ny + nz * nz) * 0.5F;
    wf cost = edges * edges / (wf_max(area, edges * 1e-3F) + 1e-30F);
    wf facing = nx * r->nx + ny * r->ny + nz * r->nz;
    sum += wf_choose(facing < 0.0F, cost * 3.0F, cost);
  }
  wf crowd = wf_load(r->valence + j) + (float)(r->count - 4 - 8);
  return wf_choose(crowd > 0.0F, sum * (crowd * 0.25F + 1.0F), sum);
}

static float cost_of_vertex(const orb_corner_table *s, int32_t v, int32_t *target) {
  cost_ring r;
  if (!cost_gather(s, v, &r)) {
    *target = s->corner[orb_corner_next(s->vertex_corner[v])];
    return ORB_COST_LARGE;
  }
  cost_measure_star(s->position4 + 4 * (int64_t)v, &r);
  float best = INFINITY;
  int at = 0;
  for (int j = 0; j < r.count; j += WIDE) {
    wf cost = cost_of_targets(&r, j);
    for (int i = 0; i < WIDE && j + i < r.count; i++) {
      if (cost[i] < best) {
        best = cost[i];
        at = j + i;
      }
    }
  }
  *target = r.id[at];
  best *= 2 * r.target_area / (r.own_area + 1e-30F);
  return best < 1e29F ? best : 1e29F;
}

static inline int cost_is_due(const orb_cost_job *job, int32_t v) {
  return job->dirty[v] && job->cost[v] <= job->threshold;
}

/* Prefetches the block of the vertex FAR ahead, and what the block of the vertex NEAR ahead points to. */
static void cost_range(const orb_cost_job *job, int64_t begin, int64_t end) {
  enum { NEAR = 4, FAR = 10 };
  const orb_corner_table *s = job->surface;
  for (int64_t i = begin; i < end; i++) {
    int32_t v = job->vertex[i];
    if (i + FAR < end && cost_is_due(job, job->vertex[i + FAR])) {
      __builtin_prefetch(s->corner + s->vertex_corner[job->vertex[i + FAR]]);
      __builtin_prefetch(s->position4 + 4 * (int64_t)job->vertex[i + FAR]);
    }
    if (i + NEAR < end && cost_is_due(job, job->vertex[i + NEAR])) {
      int32_t c = s->vertex_corner[job->vertex[i + NEAR]];
      __builtin_prefetch(s->corner + s->opposite[orb_corner_next(c)]);
      __builtin_prefetch(s->corner + s->opposite[orb_corner_prev(c)]);
      __builtin_prefetch(s->position4 + 4 * (int64_t)s->corner[orb_corner_next(c)]);
      __builtin_prefetch(s->position4 + 4 * (int64_t)s->corner[orb_corner_prev(c)]);
    }
    if (cost_is_due(job, v)) {
      job->cost[v] = cost_of_vertex(s, v, &job->target[v]);
      job->dirty[v] = 0;
    }
  }
}
