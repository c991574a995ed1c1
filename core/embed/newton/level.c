#include "embed/newton/level.h"

#include "base/check.h"
#include "base/loops.h"
#include "base/memory.h"

enum {
  BINS = ORB_SWEEP_RING_MAX + 1, /* one for each valence */
  GRAIN = 128,                   /* batches of a chunk */
  UNCOLOURED = -1,               /* no colour yet */
  SET_ASIDE = -2                 /* heavy: gets no colour */
};

typedef struct builder {
  orb_context *ctx;
  orb_level *level;
  const orb_corner_table *s;
  double blend;
  unsigned char *valence;                    /* of level vertices, capped */
  int32_t bin[ORB_LEVEL_COLOURS][BINS];      /* vertices of each colour and valence */
  int32_t bin_next[ORB_LEVEL_COLOURS][BINS]; /* the lane of the next one, counted through all batches */
  int32_t batches;
} builder;

static void free_batches(orb_context *ctx, orb_level *level) {
  orb_free(ctx, level->vertex);
  orb_free(ctx, level->batch_vertex);
  orb_free(ctx, level->batch_valence);
  orb_free(ctx, level->lane_valence);
  orb_free(ctx, level->batch_fill);
  orb_free(ctx, level->batch_stiff);
  orb_free(ctx, level->batch_offset);
  orb_free(ctx, level->batch_energy);
  orb_free(ctx, level->batch_fall);
  orb_free(ctx, level->ring);
  orb_free(ctx, level->shape);
  orb_free(ctx, level->heavy);
  signed char *colour = level->colour;
  const orb_vector_loops *loops = level->loops;
  memset(level, 0, sizeof *level);
  level->colour = colour;
  level->loops = loops;
}

void orb_level_free(orb_context *ctx, orb_level *level) {
  free_batches(ctx, level);
  orb_free(ctx, level->colour);
  memset(level, 0, sizeof *level);
}

/* Greedy colouring in vertex order; counts the bins. */
static orb_status colour_vertices(builder *b) {
  orb_level *level = b->level;
  const orb_corner_table *s = b->s;
  int32_t heavy = 0;
  for (int32_t i = 0; i < level->count; i++) {
    int32_t v = level->vertex[i], start = s->vertex_corner[v], c = start;
    uint64_t used = 0;
    do {
      int q = level->colour[s->corner[orb_corner_next(c)]];
      used |= q >= 0 ? UINT64_C(1) << q : 0;
      c = orb_corner_swing(s, c);
    } while (c != start);
    if (s->valence[v] > ORB_SWEEP_RING_MAX || used == UINT64_MAX) {
      level->colour[v] = SET_ASIDE;
      level->heavy[heavy++] = v;
      continue;
    }
    int q = __builtin_ctzll(~used);
    level->colour[v] = (signed char)q;
    level->colours = q + 1 > level->colours ? q + 1 : level->colours;
    b->bin[q][s->valence[v]]++;
    if ((i & 16383) == 16383) {
      ORB_TRY(orb_context_check(b->ctx));
    }
  }
  level->heavy_count = heavy;
  return ORB_OK;
}

static void count_batches(builder *b) {
  orb_level *level = b->level;
  int lanes = level->loops->lanes;
  b->batches = 0;
  for (int q = 0; q < level->colours; q++) {
    int32_t lane = 0;
    level->batch_start[q] = b->batches;
    for (int k = 0; k < BINS; k++) {
      b->bin_next[q][k] = b->batches * lanes + lane;
      lane += b->bin[q][k];
    }
    b->batches += (lane + lanes - 1) / lanes;
  }
  level->batch_start[level->colours] = b->batches;
}

static orb_status lay_out(builder *b) {
  orb_level *level = b->level;
  orb_context *ctx = b->ctx;
  int lanes = level->loops->lanes;
  level->batch_vertex = ORB_NEW(ctx, int32_t, (int64_t)b->batches * lanes);
  level->lane_valence = ORB_NEW(ctx, unsigned char, (int64_t)b->batches *lanes);
  level->batch_valence = ORB_NEW0(ctx, int32_t, b->batches);
  level->batch_fill = ORB_NEW0(ctx, unsigned char, b->batches);
  level->batch_stiff = ORB_NEW0(ctx, uint16_t, b->batches);
  level->batch_offset = ORB_NEW(ctx, int64_t, b->batches);
  level->batch_energy = ORB_NEW(ctx, double, b->batches);
  level->batch_fall = ORB_NEW(ctx, double, b->batches);
  return level->batch_vertex && level->lane_valence && level->batch_valence && level->batch_fill &&
                 level->batch_stiff && level->batch_offset && level->batch_energy && level->batch_fall
             ? ORB_OK
             : ORB_E_NO_MEMORY;
}

/* Gives each vertex its lane, each batch the ring entries that its longest ring needs. */
static orb_status assign_lanes(builder *b) {
  orb_level *level = b->level;
  int lanes = level->loops->lanes;
  for (int32_t i = 0; i < level->count; i++) {
    int32_t v = level->vertex[i], q = level->colour[v], k = b->s->valence[v];
    if (q >= 0) {
      int32_t lane = b->bin_next[q][k]++, batch = lane / lanes;
      level->batch_vertex[lane] = v;
      level->lane_valence[lane] = (unsigned char)k;
      level->batch_fill[batch]++;
      level->batch_valence[batch] = k > level->batch_valence[batch] ? k : level->batch_valence[batch];
    }
  }
  int64_t entries = 0;
  for (int32_t i = 0; i < b->batches; i++) {
    level->batch_offset[i] = entries;
    entries += level->batch_valence[i];
  }
  level->ring = ORB_NEW(b->ctx, int32_t, entries * lanes);
  level->shape = ORB_NEW(b->ctx, float, 4 * entries * lanes);
  return level->ring && level->shape ? ORB_OK : ORB_E_NO_MEMORY;
}

static void fill_batches(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  const builder *b = arg;
  const orb_level *level = b->level;
  orb_fill_job job = {.surface = b->s,
                      .blend = b->blend,
                      .vertex = level->batch_vertex,
                      .count = level->lane_valence,
                      .fill = level->batch_fill,
                      .valence = level->batch_valence,
                      .offset = level->batch_offset,
                      .ring = level->ring,
                      .shape = level->shape};
  level->loops->fill(&job, begin, end);
}

static orb_status list_vertices(builder *b, const unsigned char *alive, const unsigned char *pinned, int32_t live) {
  orb_level *level = b->level;
  orb_context *ctx = b->ctx;
  int64_t n = b->s->vertex_count;
  if (!level->colour) {
    level->colour = ORB_NEW(ctx, signed char, n);
  }
  level->vertex = ORB_NEW(ctx, int32_t, live);
  level->heavy = ORB_NEW(ctx, int32_t, live);
  if (!level->colour || !level->vertex || !level->heavy) {
    return ORB_E_NO_MEMORY;
  }
  memset(level->colour, UNCOLOURED, (size_t)n);
  int32_t found = 0;
  for (int32_t v = 0; v < n; v++) {
    found += alive[v];
    if (alive[v] && !(pinned && pinned[v])) {
      level->vertex[level->count++] = v;
    }
  }
  ORB_ASSERT(found == live);
  return ORB_OK;
}

orb_status orb_level_build(orb_context *ctx, orb_level *level, const orb_vector_loops *loops,
                           const orb_corner_table *surface, const unsigned char *alive, const unsigned char *pinned,
                           int32_t live, double blend) {
  free_batches(ctx, level);
  level->loops = loops;
  builder *b = ORB_NEW0(ctx, builder, 1);
  if (!b) {
    return ORB_E_NO_MEMORY;
  }
  b->ctx = ctx;
  b->level = level;
  b->s = surface;
  b->blend = blend;
  orb_status status;
  ORB_GO(status, list_vertices(b, alive, pinned, live), done);
  ORB_GO(status, colour_vertices(b), done);
  count_batches(b);
  ORB_GO(status, lay_out(b), done);
  ORB_GO(status, assign_lanes(b), done);
  ORB_GO(status, orb_sliced_for(ctx, b->batches, GRAIN, fill_batches, b), done);
  level->valid = 1;
done:
  orb_free(ctx, b);
  return status;
}
