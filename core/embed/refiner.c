/* The hierarchy's and the refiner's life: from the tetrahedron up, level by level. */
#include <math.h>

#include "base/check.h"
#include "base/loops.h"
#include "embed/multires.h"
#include "numeric/predicates.h"
#include "numeric/vec3.h"

enum { SWEEP_GRAIN = 32, QUEUE_MOST = 65536 };

orb_status orb_hierarchy_create(orb_context *ctx, const orb_mesh *mesh, const unsigned char *keep, int32_t keep_until,
                                orb_hierarchy **out) {
  orb_hierarchy *h = ORB_NEW0(ctx, orb_hierarchy, 1);
  if (!h) {
    return ORB_E_NO_MEMORY;
  }
  h->kernels = orb_kernels_of(orb_context_cpu(ctx));
  unsigned char *kept = NULL;
  orb_status status;
  ORB_GO(status, orb_corner_table_create(ctx, mesh, &h->surface), done);
  if (keep) {
    kept = ORB_NEW(ctx, unsigned char, mesh->vertex_count);
    if (!kept) {
      status = ORB_E_NO_MEMORY;
      goto done;
    }
    for (int32_t i = 0; i < mesh->vertex_count; i++) {
      kept[i] = keep[h->surface.to_mesh[i]];
    }
  }
  ORB_GO(status, orb_decimate(ctx, h, kept, keep_until), done);
  *out = h;
  h = NULL;
done:
  orb_free(ctx, kept);
  orb_hierarchy_destroy(ctx, h);
  return status;
}

void orb_hierarchy_destroy(orb_context *ctx, orb_hierarchy *h) {
  if (h) {
    orb_corner_table_free(ctx, &h->surface);
    orb_free(ctx, h->log);
    orb_free(ctx, h->area_log);
    orb_free(ctx, h->round_start);
    orb_free(ctx, h);
  }
}

/* The first tetrahedron: regular, turned so that its faces are positive. */
static void place_base(orb_refiner *r) {
  const orb_hierarchy *h = r->hierarchy;
  const orb_corner_table *s = &h->surface;
  const double a = 0.57735026918962576451; /* 1/√3 */
  const double corner[4][3] = {{a, a, a}, {a, -a, -a}, {-a, a, -a}, {-a, -a, a}};
  int32_t c = s->vertex_corner[h->base[0]];
  int32_t v[4] = {s->corner[c], s->corner[orb_corner_next(c)], s->corner[orb_corner_prev(c)], -1};
  for (int i = 0; i < 4; i++) {
    int32_t u = h->base[i];
    r->alive[u] = 1;
    if (u != v[0] && u != v[1] && u != v[2]) {
      v[3] = u;
    }
  }
  int turned = orb_orient(corner[0], corner[1], corner[2]) < 0;
  for (int i = 0; i < 4; i++) {
    int at = turned && i == 1 ? 2 : turned && i == 2 ? 1 : i;
    memcpy(r->point + 4 * (int64_t)v[i], corner[at], sizeof corner[at]);
    (void)orb_normalize(r->point + 4 * (int64_t)v[i]);
  }
  r->live = 4;
}

static int in_range(double x, double low, double high) {
  return x >= low && x <= high;
}

orb_status orb_refiner_create(orb_context *ctx, orb_hierarchy *h, const orb_embed_options *options, orb_refiner **out) {
  ORB_ASSERT(h->undone == 0);
  if (!in_range(options->energy_weight, 0, 1e6)) {
    return orb_fail(ctx, ORB_E_BAD_OPTION, "energy_weight must lie between 0 and 1000000.");
  }
  if (options->preset < ORB_PRESET_DEFAULT || options->preset > ORB_PRESET_QUALITY) {
    return orb_fail(ctx, ORB_E_BAD_OPTION, "preset must be fast, default or quality.");
  }
  int64_t n = h->surface.vertex_count;
  orb_refiner *r = ORB_NEW0(ctx, orb_refiner, 1);
  if (!r) {
    return ORB_E_NO_MEMORY;
  }
  r->hierarchy = h;
  orb_newton_settings_of(options, &r->settings);
  r->star_count = orb_threads(ctx);
  r->point = ORB_NEW0(ctx, double, 4 * n);
  r->alive = ORB_NEW0(ctx, unsigned char, n);
  r->pinned = ORB_NEW0(ctx, unsigned char, n);
  r->queued = ORB_NEW0(ctx, unsigned char, n);
  r->queue_capacity = 64;
  while (r->queue_capacity < n && r->queue_capacity < QUEUE_MOST) {
    r->queue_capacity *= 2;
  }
  r->queue = ORB_NEW(ctx, int32_t, r->queue_capacity);
  r->crowding = ORB_NEW0(ctx, float, n);
  r->star = ORB_NEW0(ctx, orb_star, r->star_count);
  r->room = ORB_NEW0(ctx, orb_kernel_room, r->star_count);
  if (!r->point || !r->alive || !r->pinned || !r->queued || !r->queue || !r->crowding || !r->star || !r->room) {
    orb_refiner_destroy(ctx, r);
    return ORB_E_NO_MEMORY;
  }
  place_base(r);
  *out = r;
  return ORB_OK;
}

void orb_refiner_destroy(orb_context *ctx, orb_refiner *r) {
  if (r) {
    orb_hierarchy *h = r->hierarchy;
    while (h->undone > 0) { /* back to the tetrahedron, for the next refiner */
      orb_collapse_redo(h, h->log_count - h->undone);
      h->undone--;
    }
    orb_refiner_abandon(ctx, r);
  }
}

void orb_refiner_abandon(orb_context *ctx, orb_refiner *r) {
  if (!r) {
    return;
  }
  for (int32_t i = 0; r->star && i < r->star_count; i++) {
    orb_star_free(ctx, &r->star[i]);
  }
  for (int32_t i = 0; r->room && i < r->star_count; i++) {
    orb_kernel_room_free(ctx, &r->room[i]);
  }
  orb_level_free(ctx, &r->level);
  orb_free(ctx, r->point);
  orb_free(ctx, r->alive);
  orb_free(ctx, r->pinned);
  orb_free(ctx, r->queued);
  orb_free(ctx, r->queue);
  orb_free(ctx, r->crowding);
  orb_free(ctx, r->star);
  orb_free(ctx, r->room);
  orb_free(ctx, r);
}

static double blend_of(const orb_refiner *r) {
  return r->live == r->hierarchy->surface.vertex_count ? r->settings.finest : r->settings.blend;
}

/* Coarse levels do not follow a w below 1: without the symmetric term they grow some triangles without bound, and the
 * fine ones cannot mend that. */
double orb_refiner_weight(const orb_refiner *r) {
  return r->live == r->hierarchy->surface.vertex_count ? r->settings.weight : fmax(r->settings.weight, 1);
}

typedef struct sweep_loop {
  const orb_level *level;
  orb_sweep_job job;
  int32_t start;
} sweep_loop;

static void sweep_batches(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  const sweep_loop *loop = arg;
  loop->level->kernels->sweep(&loop->job, loop->start + begin, loop->start + end);
}

/* What the vector sweep left over. */
static orb_status relax_left_over(orb_context *ctx, orb_refiner *r, int32_t begin, int32_t end, double blend) {
  const orb_level *level = &r->level;
  for (int32_t b = begin; b < end; b++) {
    for (int l = 0; level->batch_stiff[b] >> l; l++) {
      if (level->batch_stiff[b] >> l & 1) {
        double gain;
        ORB_TRY(
            orb_refiner_relax(ctx, r, level->batch_vertex[(int64_t)b * level->kernels->lanes + l], blend, &gain, NULL));
      }
    }
  }
  return ORB_OK;
}

/* One sweep; *energy before it (the stars hold each triangle three times), *fall by it. Sums are taken in the order of
 * batches. */
static orb_status sweep_once(orb_context *ctx, orb_refiner *r, double relax, double *energy, double *fall) {
  orb_level *level = &r->level;
  double blend = blend_of(r);
  sweep_loop loop = {.level = level,
                     .job = {.point = r->point,
                             .vertex = level->batch_vertex,
                             .fill = level->batch_fill,
                             .valence = level->batch_valence,
                             .offset = level->batch_offset,
                             .ring = level->ring,
                             .shape = level->shape,
                             .weight = orb_refiner_weight(r),
                             .relax = relax,
                             .energy = level->batch_energy,
                             .fall = level->batch_fall,
                             .stiff = level->batch_stiff}};
  *energy = *fall = 0;
  for (int q = 0; q < level->colours; q++) {
    int32_t begin = level->batch_start[q], end = level->batch_start[q + 1];
    loop.start = begin;
    ORB_TRY(orb_sliced_for(ctx, end - begin, SWEEP_GRAIN, sweep_batches, &loop));
    ORB_TRY(relax_left_over(ctx, r, begin, end, blend));
    for (int32_t b = begin; b < end; b++) {
      *energy += level->batch_energy[b];
      *fall += level->batch_fall[b];
    }
  }
  *energy /= 3;
  for (int32_t i = 0; i < level->heavy_count; i++) {
    double gain;
    ORB_TRY(orb_refiner_relax(ctx, r, level->heavy[i], blend, &gain, NULL));
  }
  return ORB_OK;
}

static orb_status need_level(orb_context *ctx, orb_refiner *r) {
  if (r->level.valid) {
    return ORB_OK;
  }
  return orb_level_build(ctx, &r->level, r->hierarchy->kernels, &r->hierarchy->surface, r->alive, r->pinned, r->live,
                         blend_of(r));
}

static const double OVER_RELAXATION = 1.9;

orb_status orb_refiner_sweep(orb_context *ctx, orb_refiner *r, int32_t sweeps, double *gain) {
  ORB_TRY(need_level(ctx, r));
  double energy = 1, fall = 0;
  for (int32_t i = 0; i < sweeps; i++) {
    ORB_TRY(sweep_once(ctx, r, i == 0 ? 1.0 : OVER_RELAXATION, &energy, &fall));
  }
  if (gain) {
    *gain = energy > 0 ? fall / energy : 0;
  }
  return ORB_OK;
}

/* The sweeps of a level that has just been reached: many on coarse ones, where they cost nothing and decide most. A
 * sweep ends the level early when it gains almost nothing; more are added while each still gains much. */
static orb_status settle_level(orb_context *ctx, orb_refiner *r) {
  const orb_newton_settings *set = &r->settings;
  int32_t n = r->hierarchy->surface.vertex_count;
  int last = r->live == n;
  int32_t sweeps = r->live < set->coarse_until ? set->coarse_sweeps : last ? set->final_sweeps : set->level_sweeps;
  double energy, fall;
  ORB_TRY(need_level(ctx, r));
  for (int32_t i = 0; i < sweeps; i++) {
    ORB_TRY(sweep_once(ctx, r, i == 0 ? 1.0 : OVER_RELAXATION, &energy, &fall));
    if (last) {
      orb_progress(ctx, "embed", 0.6 + 0.4 * (i + 1) / sweeps);
    }
    if (i > 1 && fall < (last ? set->settled_last : set->settled) * energy) {
      break;
    }
    if (i == sweeps - 1 && fall > (last ? set->converged_last : set->converged) * energy && sweeps < set->most_sweeps) {
      sweeps++;
    }
  }
  return ORB_OK;
}

void orb_refiner_one_way(orb_refiner *r) {
  r->one_way = 1;
}

/* All collapses are undone for good. */
static void drop_collapses(orb_context *ctx, orb_refiner *r) {
  orb_hierarchy *h = r->hierarchy;
  orb_free(ctx, h->log);
  orb_free(ctx, h->area_log);
  orb_free(ctx, h->surface.position4);
  orb_free(ctx, r->crowding);
  h->log = NULL;
  h->area_log = h->surface.position4 = r->crowding = NULL;
}

orb_status orb_refiner_advance(orb_context *ctx, orb_refiner *r, int32_t vertices) {
  int32_t n = r->hierarchy->surface.vertex_count;
  vertices = vertices < n ? vertices : n;
  while (r->live < vertices) {
    double growth = r->live >= r->settings.fine_from ? r->settings.growth_fine : r->settings.growth;
    double next = r->live < 8 ? 8 : r->live * growth + 1;
    next = next > n / 1.3 ? n : next;
    int32_t stop = next < vertices ? (int32_t)next : vertices;
    double blend = stop == n ? r->settings.finest : r->settings.blend;
    while (r->live < stop) {
      ORB_TRY(orb_refiner_undo_round(ctx, r, blend));
      orb_progress(ctx, "embed", 0.6 * r->live / n);
    }
    if (r->one_way && r->live == n) {
      drop_collapses(ctx, r);
    }
    ORB_TRY(settle_level(ctx, r));
  }
  return ORB_OK;
}

int32_t orb_refiner_live(const orb_refiner *r) {
  return r->live;
}

orb_status orb_refiner_level(orb_context *ctx, const orb_refiner *r, int32_t **vertices, int32_t *vertex_count,
                             int32_t **triangles, int32_t *triangle_count) {
  const orb_corner_table *s = &r->hierarchy->surface;
  int32_t *v = ORB_NEW(ctx, int32_t, r->live), *t = ORB_NEW(ctx, int32_t, 3 * (2 * (int64_t)r->live - 4));
  if (!v || !t) {
    orb_free(ctx, v);
    orb_free(ctx, t);
    return ORB_E_NO_MEMORY;
  }
  int32_t count = 0, faces = 0;
  for (int32_t i = 0; i < s->vertex_count; i++) {
    if (!r->alive[i]) {
      continue;
    }
    v[count++] = s->to_mesh[i];
    int32_t start = s->vertex_corner[i], c = start;
    do {
      if ((c & 3) == 0) {
        for (int k = 0; k < 3; k++) {
          t[3 * (int64_t)faces + k] = s->to_mesh[s->corner[c + k]];
        }
        faces++;
      }
      c = orb_corner_swing(s, c);
    } while (c != start);
  }
  ORB_ASSERT(count == r->live && faces == 2 * r->live - 4);
  *vertices = v;
  *vertex_count = count;
  *triangles = t;
  *triangle_count = faces;
  return ORB_OK;
}

void orb_refiner_point(const orb_refiner *r, int32_t vertex, double out[3]) {
  memcpy(out, r->point + 4 * (int64_t)r->hierarchy->surface.from_mesh[vertex], 3 * sizeof *out);
}

void orb_refiner_move(orb_refiner *r, int32_t vertex, const double point[3]) {
  memcpy(r->point + 4 * (int64_t)r->hierarchy->surface.from_mesh[vertex], point, 3 * sizeof *point);
}

void orb_refiner_pin(orb_refiner *r, int32_t vertex, int pinned) {
  r->pinned[r->hierarchy->surface.from_mesh[vertex]] = pinned != 0;
  r->level.valid = 0;
}

void orb_refiner_points(const orb_refiner *r, double *points) {
  const orb_corner_table *s = &r->hierarchy->surface;
  for (int64_t i = 0; i < s->vertex_count; i++) {
    memcpy(points + 3 * (int64_t)s->to_mesh[i], r->point + 4 * i, 3 * sizeof *points);
  }
}
