/* Rings and shapes of a batch of stars, before it is swept: shape_cotangents() (star.c) lane by lane.
 *
 * The shapes are computed here, from the positions of the ring, although each triangle lies in three stars: reading
 * them from a table of triangles would miss the cache as often as reading positions does, and the table would cost 16
 * bytes per triangle. */

static const double FILL_TINY2 = 1e-30, FILL_FLAT = 1e-6; /* TINY2 and FLAT of star.c */

/* All lanes walk in step, so that their cache misses overlap. A ring that is shorter than the longest goes on with its
 * first vertex. */
static inline void fill_walk(const orb_corner_table *s, const int32_t *vertex, const unsigned char *count, int k,
                             int32_t *ring, float *shape) {
  int32_t c[LANES];
  for (int l = 0; l < LANES; l++) {
    c[l] = s->vertex_corner[vertex[l]];
  }
  for (int i = 0; i < k; i++) {
    float *doubled_area = shape + ((int64_t)i * 4 + 3) * BATCH;
    for (int l = 0; l < LANES; l++) {
      int inside = i < count[l];
      ring[i * BATCH + l] = inside ? s->corner[orb_corner_next(c[l])] : ring[l];
      doubled_area[l] = inside ? 2 * orb_corner_area(s, c[l]) : 0;
      c[l] = orb_corner_swing(s, c[l]);
    }
  }
}

/* Positions, 3 per vertex. */
static inline void fill_gather(const double *position, const int32_t *id, vd out[3]) {
  double lane[3][LANES];
  for (int l = 0; l < LANES; l++) {
    const double *p = position + 3 * (int64_t)id[l];
    lane[0][l] = p[0];
    lane[1][l] = p[1];
    lane[2][l] = p[2];
  }
  for (int k = 0; k < 3; k++) {
    memcpy(&out[k], lane[k], sizeof out[k]);
  }
}

static inline vd fill_distance2(const vd a[3], const vd b[3]) {
  vd x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];
  return x * x + y * y + z * z;
}

/* The half cotangents of the triangle of centre, ring[i] and ring[i+1], whose squared edges are: centre to ring[i]
 * (ab), centre to ring[i+1] (ac), and between the two (bc). 0 in lanes where `inside` is not set. */
static inline void fill_shape(vd ab, vd ac, vd bc, double blend, vm inside, float *out) {
  vd more = (ab + ac + bc) * (blend / 3) + FILL_TINY2, zero = vd_set(0);
  ab += more;
  ac += more;
  bc += more;
  vd sum = ab + ac + bc, sixteen = 2 * (ab * ac + ac * bc + bc * ab) - (ab * ab + ac * ac + bc * bc);
  vd half = vd_choose(inside, 0.5 / vd_max(vd_sqrt(vd_max(sixteen, zero)), sum * FILL_FLAT), zero);
  vd_store_floats(out, (ac + bc - ab) * half);             /* at ring[i+1] */
  vd_store_floats(out + BATCH, (ab + bc - ac) * half);     /* at ring[i] */
  vd_store_floats(out + 2 * BATCH, (ab + ac - bc) * half); /* at the centre */
}

static inline void fill_half(const orb_fill_job *job, int64_t batch, int part) {
  int k = job->valence[batch];
  const int32_t *vertex = job->vertex + batch * BATCH + part * LANES;
  const unsigned char *count = job->count + batch * BATCH + part * LANES;
  int32_t *ring = job->ring + job->offset[batch] * BATCH + part * LANES;
  float *shape = job->shape + 4 * job->offset[batch] * BATCH + part * LANES;
  const double *position = job->surface->position;
  fill_walk(job->surface, vertex, count, k, ring, shape);
  vd centre[3], first[3], here[3], next[3];
  vm counts;
  for (int l = 0; l < LANES; l++) {
    counts[l] = count[l];
  }
  fill_gather(position, vertex, centre);
  fill_gather(position, ring, first);
  memcpy(here, first, sizeof here);
  vd to_first = fill_distance2(centre, first), to_here = to_first;
  for (int i = 0; i < k; i++) {
    vd to_next = to_first;
    if (i + 1 < k) {
      fill_gather(position, ring + (int64_t)(i + 1) * BATCH, next);
      to_next = fill_distance2(centre, next);
    } else {
      memcpy(next, first, sizeof next);
    }
    fill_shape(to_here, to_next, fill_distance2(here, next), job->blend, (vm)(counts > i),
               shape + (int64_t)i * 4 * BATCH);
    memcpy(here, next, sizeof here);
    to_here = to_next;
  }
}

/* Lanes that do not count are those of the last vertex that does. */
static void fill_range(const orb_fill_job *job, int64_t begin, int64_t end) {
  for (int64_t i = begin; i < end; i++) {
    for (int l = job->fill[i]; l < BATCH; l++) {
      job->vertex[i * BATCH + l] = job->vertex[i * BATCH + job->fill[i] - 1];
      job->count[i * BATCH + l] = job->count[i * BATCH + job->fill[i] - 1];
    }
    for (int part = 0; part < HALVES; part++) {
      fill_half(job, i, part);
    }
  }
}
