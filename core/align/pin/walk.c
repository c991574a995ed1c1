/* The landmark walk.
 *
 * All shapes are decimated with their landmarks kept, and embedded up to a level of a few hundred vertices. There
 * rotations bring the landmarks together, and their spherical means become targets. Each step moves a landmark along
 * the great circle, as far as no triangle around it shrinks below a share of its size; sweeps of the other vertices
 * make room between the steps. When landmarks no longer advance, the level is refined and the walk continues: more
 * vertices give more freedom. Once all have arrived they are pinned, and the refinement continues to the full meshes.
 */
#include <math.h>
#include <string.h>

#include "align/pin/walk.h"
#include "align/rotate/procrustes.h"
#include "align/rotate/rotate.h"
#include "base/check.h"
#include "base/context.h"
#include "base/error.h"
#include "base/memory.h"
#include "base/tasks.h"
#include "embed/newton/advance.h"
#include "numeric/vec3.h"

/* Chosen by trial. */
enum {
  STEPS_MAX = 160,    /* of all landmarks on a level */
  TRIES = 24,         /* lengths of a landmark's step */
  SWEEPS = 3,         /* between steps */
  LEVELS = 3,         /* on which landmarks walk, */
  FINEST_WALK = 4000, /* none beyond this number of vertices */
  SETTLE = 60         /* most sweeps after all have arrived */
};
enum { STEPS_OF_VERTEX = 20 }; /* for progress: for each vertex, a stage takes as long as so many steps of a map */
static const double LEAST_SHARE = 0.6;  /* that a determinant keeps in one step */
static const double SHORTER = 0.6;      /* a try's length relative to the one before it */
static const double NO_PROGRESS = 1e-4; /* chords of all landmarks in one step: less ends the level */
static const double SETTLED = 0.002;    /* gain of the energy by SWEEPS sweeps that ends settling */
static const double CENTRAL = 1e-3;   /* a chord that passes this near to the centre of the sphere gives no direction */
static const double TOO_NEAR = 1e-16; /* squared chord: nearer targets count as one place */

typedef struct walker {
  orb_context *ctx;
  orb_sheet *sheet;
  orb_hierarchy *hierarchy;
  orb_refiner *refiner;
  const int32_t *landmarks; /* numbers of the landmarks in the request */
  int32_t count;
  int32_t *vertices, *triangles; /* of the current level */
  int32_t vertex_count, triangle_count;
  int32_t *link_start, *link; /* for each landmark the far edges of its triangles, two vertices each */
} walker;

static int32_t landmark_vertex(const walker *w, int32_t k) {
  return w->sheet->shape.landmark_vertices[w->landmarks[k]];
}

static void walker_free(walker *w) {
  if (!w->ctx) {
    return;
  }
  orb_refiner_destroy(w->ctx, w->refiner);
  orb_hierarchy_destroy(w->ctx, w->hierarchy);
  orb_free(w->ctx, w->vertices);
  orb_free(w->ctx, w->triangles);
  orb_free(w->ctx, w->link_start);
  orb_free(w->ctx, w->link);
  memset(w, 0, sizeof *w);
}

/* Reads the level and gathers the links of the landmarks. */
static orb_status read_level(walker *w) {
  orb_context *ctx = w->ctx;
  orb_free(ctx, w->vertices);
  orb_free(ctx, w->triangles);
  orb_free(ctx, w->link_start);
  orb_free(ctx, w->link);
  w->vertices = w->triangles = w->link_start = w->link = NULL;
  ORB_TRY(orb_refiner_level(ctx, w->refiner, &w->vertices, &w->vertex_count, &w->triangles, &w->triangle_count));
  int32_t n = w->sheet->shape.mesh.vertex_count;
  int32_t *number = ORB_NEW(ctx, int32_t, n);
  w->link_start = ORB_NEW0(ctx, int32_t, w->count + 2);
  w->link = ORB_NEW(ctx, int32_t, 6 * (size_t)w->triangle_count);
  if (!number || !w->link_start || !w->link) {
    orb_free(ctx, number);
    return ORB_E_NO_MEMORY;
  }
  for (int32_t v = 0; v < n; v++) {
    number[v] = -1;
  }
  for (int32_t k = 0; k < w->count; k++) {
    number[landmark_vertex(w, k)] = k;
  }
  int32_t *fill = w->link_start + 2;
  for (int32_t h = 0; h < 3 * w->triangle_count; h++) {
    int32_t k = number[w->triangles[h]];
    if (k >= 0 && k + 1 < w->count) {
      fill[k]++;
    }
  }
  for (int32_t k = 1; k + 1 < w->count; k++) {
    fill[k] += fill[k - 1];
  }
  for (int32_t h = 0; h < 3 * w->triangle_count; h++) {
    int32_t k = number[w->triangles[h]];
    if (k >= 0) {
      int32_t at = w->link_start[k + 1]++;
      w->link[2 * at] = w->triangles[orb_next(h)];
      w->link[2 * at + 1] = w->triangles[orb_prev(h)];
    }
  }
  orb_free(ctx, number);
  return ORB_OK;
}

static orb_status walker_create(orb_context *ctx, orb_sheet *sheet, const int32_t *landmarks, int32_t count,
                                const orb_walk_options *walk, walker *w) {
  const orb_mesh *mesh = &sheet->shape.mesh;
  orb_status status = ORB_OK;
  *w = (walker){.ctx = ctx, .sheet = sheet, .landmarks = landmarks, .count = count};
  unsigned char *keep = ORB_NEW0(ctx, unsigned char, mesh->vertex_count);
  if (!keep) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t k = 0; k < count; k++) {
    keep[landmark_vertex(w, k)] = 1;
  }
  orb_embed_options options;
  orb_embed_defaults(&options);
  options.preset = walk->preset;
  ORB_GO(status, orb_hierarchy_create(ctx, mesh, keep, walk->coarse, &w->hierarchy), end);
  ORB_GO(status, orb_refiner_create(ctx, w->hierarchy, &options, &w->refiner), end);
  if (walk->keep_angles) {
    orb_refiner_keep_angles(w->refiner);
  }
  ORB_GO(status, orb_refiner_advance(ctx, w->refiner, walk->coarse), end);
  ORB_GO(status, read_level(w), end);
end:
  orb_free(ctx, keep);
  return status;
}

static int all_live(const walker *w) {
  int32_t found = 0;
  for (int32_t k = 0; k < w->count; k++) {
    found += w->link_start[k + 1] > w->link_start[k];
  }
  return found == w->count;
}

static void rotate_level(walker *w, const double rotation[9]) {
  for (int32_t i = 0; i < w->vertex_count; i++) {
    double p[3];
    orb_refiner_point(w->refiner, w->vertices[i], p);
    orb_rotate_point(rotation, p, p);
    orb_normalize(p);
    orb_refiner_move(w->refiner, w->vertices[i], p);
  }
}

/* Does landmark k at x keep the least share of each of its determinants at p? */
static int may_stand(const walker *w, int32_t k, const double p[3], const double x[3]) {
  for (int32_t i = w->link_start[k]; i < w->link_start[k + 1]; i++) {
    double a[3], b[3];
    orb_refiner_point(w->refiner, w->link[2 * i], a);
    orb_refiner_point(w->refiner, w->link[2 * i + 1], b);
    if (!(orb_det(x, a, b) >= LEAST_SHARE * orb_det(p, a, b))) {
      return 0;
    }
  }
  return 1;
}

/* One step of a landmark; returns its length. *arrived: the landmark is at its target, bit for bit. */
static double step_one(walker *w, int32_t k, const double target[3], int *arrived) {
  int32_t v = landmark_vertex(w, k);
  double p[3], x[3];
  orb_refiner_point(w->refiner, v, p);
  if (memcmp(p, target, sizeof p) == 0) {
    *arrived = 1;
    return 0;
  }
  double length = sqrt(orb_distance2(p, target)), t = 1;
  *arrived = 0;
  for (int i = 0; i < TRIES; i++, t *= SHORTER) {
    for (int c = 0; c < 3; c++) {
      x[c] = i == 0 ? target[c] : p[c] + t * (target[c] - p[c]);
    }
    if (i > 0 && orb_normalize(x) < CENTRAL) {
      continue;
    }
    if (may_stand(w, k, p, x)) {
      orb_refiner_move(w->refiner, v, x);
      *arrived = i == 0;
      return t * length;
    }
  }
  return 0;
}

/* Walks all landmarks of one shape. *left: the number that do not arrive on any level. */
static orb_status walk(walker *w, const double *targets, int32_t *left) {
  for (int32_t k = 0; k < w->count; k++) {
    orb_refiner_pin(w->refiner, landmark_vertex(w, k), 1);
  }
  int32_t n = w->sheet->shape.mesh.vertex_count;
  for (int level = 0;; level++) {
    for (int step = 0; step < STEPS_MAX; step++) {
      double progress = 0;
      *left = 0;
      for (int32_t k = 0; k < w->count; k++) {
        int arrived;
        progress += step_one(w, k, targets + 3 * (size_t)k, &arrived);
        *left += !arrived;
      }
      ORB_TRY(orb_refiner_sweep(w->ctx, w->refiner, SWEEPS, NULL));
      ORB_TRY(orb_context_check(w->ctx));
      if (*left == 0) {
        double gain = 1;
        for (int i = 0; i < SETTLE / SWEEPS && gain > SETTLED; i++) {
          ORB_TRY(orb_refiner_sweep(w->ctx, w->refiner, SWEEPS, &gain));
        }
        return ORB_OK;
      }
      if (progress < NO_PROGRESS) {
        break;
      }
    }
    int32_t live = orb_refiner_live(w->refiner);
    if (level + 1 >= LEVELS || live >= n || live >= FINEST_WALK) {
      return ORB_OK;
    }
    ORB_TRY(orb_refiner_advance(w->ctx, w->refiner, live * 2));
    ORB_TRY(read_level(w));
  }
}

/* A level as a shape: it borrows positions and triangles and owns its points. */
static orb_status level_shape(const walker *w, orb_aligned_shape *out) {
  const orb_mesh *mesh = &w->sheet->shape.mesh;
  *out = (orb_aligned_shape){.mesh = {.vertex_count = mesh->vertex_count,
                                      .triangle_count = w->triangle_count,
                                      .positions = mesh->positions,
                                      .triangles = w->triangles}};
  out->points = ORB_NEW0(w->ctx, double, 3 * (size_t)mesh->vertex_count);
  for (int32_t i = 0; out->points && i < w->vertex_count; i++) {
    orb_refiner_point(w->refiner, w->vertices[i], out->points + 3 * (size_t)w->vertices[i]);
  }
  return out->points ? ORB_OK : ORB_E_NO_MEMORY;
}

static orb_status find_rotations(orb_context *ctx, const walker *walkers, const double *points, int32_t shape_count,
                                 int32_t count, double *rotations, double *targets) {
  orb_status status = ORB_OK;
  orb_aligned_shape *levels = ORB_NEW0(ctx, orb_aligned_shape, shape_count);
  const orb_aligned_shape **list = ORB_NEW(ctx, const orb_aligned_shape *, shape_count);
  if (!levels || !list) {
    status = ORB_E_NO_MEMORY;
    goto end;
  }
  for (int32_t s = 0; s < shape_count; s++) {
    list[s] = &levels[s];
    ORB_GO(status, level_shape(&walkers[s], &levels[s]), end);
  }
  status = orb_rotations_find(ctx, list, points, shape_count, count, rotations, targets);
end:
  for (int32_t s = 0; levels && s < shape_count; s++) {
    orb_free(ctx, levels[s].points);
  }
  orb_free(ctx, levels);
  orb_free(ctx, list);
  return status;
}

/* Rotates the levels of the shapes so that their landmarks come together; fills the common targets. */
static orb_status gather(orb_context *ctx, walker *walkers, int32_t shape_count, int32_t count, double *targets) {
  orb_status status = ORB_OK;
  double *points = ORB_NEW(ctx, double, 3 * (size_t)shape_count * (size_t)count),
         *rotations = ORB_NEW(ctx, double, 9 * (size_t)shape_count);
  if (!points || !rotations) {
    status = ORB_E_NO_MEMORY;
    goto end;
  }
  for (int32_t s = 0; s < shape_count; s++) {
    for (int32_t k = 0; k < count; k++) {
      orb_refiner_point(walkers[s].refiner, landmark_vertex(&walkers[s], k),
                        points + 3 * ((size_t)s * (size_t)count + (size_t)k));
    }
  }
  ORB_GO(status, find_rotations(ctx, walkers, points, shape_count, count, rotations, targets), end);
  for (int32_t s = 1; s < shape_count; s++) {
    rotate_level(&walkers[s], rotations + 9 * (size_t)s);
  }
end:
  orb_free(ctx, points);
  orb_free(ctx, rotations);
  return status;
}

/* Are all targets far enough apart for a coarse level? */
static int targets_apart(const double *targets, int32_t count) {
  for (int32_t i = 0; i < count; i++) {
    for (int32_t j = 0; j < i; j++) {
      if (orb_distance2(targets + 3 * (size_t)i, targets + 3 * (size_t)j) < TOO_NEAR) {
        return 0;
      }
    }
  }
  return 1;
}

/* Refines one walked shape to its full mesh, into `points`. *good: the result is certified. */
static orb_status finish(orb_context *ctx, walker *w, double *points, int *good) {
  const orb_mesh *mesh = &w->sheet->shape.mesh;
  orb_certificate certificate;
  ORB_TRY(orb_refiner_advance(ctx, w->refiner, mesh->vertex_count));
  orb_refiner_points(w->refiner, points);
  ORB_TRY(orb_certify(ctx, points, mesh->vertex_count, mesh->triangles, mesh->triangle_count, &certificate));
  *good = certificate.valid;
  return ORB_OK;
}

void orb_walk_level_free(orb_context *ctx, orb_walk_level *level) {
  orb_hierarchy_destroy(ctx, level->hierarchy);
  orb_free(ctx, level->points);
  memset(level, 0, sizeof *level);
}

/* Moves the level of a walker to *out. */
static orb_status hand_over(walker *w, orb_walk_level *out) {
  out->points = ORB_NEW0(w->ctx, double, 3 * (size_t)w->sheet->shape.mesh.vertex_count);
  if (!out->points) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t i = 0; i < w->vertex_count; i++) {
    orb_refiner_point(w->refiner, w->vertices[i], out->points + 3 * (size_t)w->vertices[i]);
  }
  out->live = w->vertex_count;
  orb_refiner_destroy(w->ctx, w->refiner);
  w->refiner = NULL;
  out->hierarchy = w->hierarchy;
  w->hierarchy = NULL;
  return ORB_OK;
}

/* A walk of all shapes, which do each stage side by side. */
typedef struct company {
  orb_sheet *sheets;
  const int32_t *landmarks;
  int32_t count, shape_count;
  const orb_walk_options *options;
  orb_walk_level *last;
  double *targets;
  walker *walkers; /* of each shape, as what follows */
  double **points; /* where it stands at last, except one whose level is handed over */
  int32_t *left;   /* landmarks that have not arrived */
  int *good;       /* is certified */
} company;

static orb_status create_one(orb_context *ctx, void *arg, int32_t s) {
  const company *all = arg;
  return walker_create(ctx, &all->sheets[s], all->landmarks, all->count, all->options, &all->walkers[s]);
}

static orb_status walk_one(orb_context *ctx, void *arg, int32_t s) {
  const company *all = arg;
  all->walkers[s].ctx = ctx;
  return walk(&all->walkers[s], all->targets, &all->left[s]);
}

static orb_status finish_one(orb_context *ctx, void *arg, int32_t s) {
  const company *all = arg;
  walker *w = &all->walkers[s];
  if (all->last && s == all->shape_count - 1) { /* its level is handed over instead, once all others are good */
    all->good[s] = 1;
    return ORB_OK;
  }
  w->ctx = ctx;
  all->points[s] = ORB_NEW(ctx, double, 3 * (size_t)all->sheets[s].vertex_capacity);
  if (!all->points[s]) {
    return ORB_E_NO_MEMORY;
  }
  orb_status status = finish(ctx, w, all->points[s], &all->good[s]);
  walker_free(w);
  return status;
}

/* Runs a stage for all shapes. Tasks have contexts of their own, which end with them. */
static orb_status run_stage(orb_context *ctx, company *all, orb_task_fn stage) {
  orb_status status = orb_tasks_run(ctx, all->shape_count, stage, all);
  for (int32_t s = 0; s < all->shape_count; s++) {
    all->walkers[s].ctx = all->walkers[s].ctx ? ctx : NULL;
    orb_progress_steps(ctx, STEPS_OF_VERTEX * (int64_t)all->sheets[s].vertex_capacity);
  }
  return status;
}

/* *stuck stays 1 if the landmarks cannot meet. */
static orb_status walk_together(orb_context *ctx, company *all, int *stuck) {
  ORB_TRY(run_stage(ctx, all, create_one));
  for (int32_t s = 0; s < all->shape_count; s++) {
    if (!all_live(&all->walkers[s])) {
      return ORB_OK;
    }
  }
  ORB_TRY(gather(ctx, all->walkers, all->shape_count, all->count, all->targets));
  if (!targets_apart(all->targets, all->count)) {
    return ORB_OK;
  }
  ORB_TRY(run_stage(ctx, all, walk_one));
  for (int32_t s = 0; s < all->shape_count; s++) {
    if (all->left[s] > 0) {
      return ORB_OK;
    }
  }
  ORB_TRY(run_stage(ctx, all, finish_one));
  for (int32_t s = 0; s < all->shape_count; s++) {
    if (!all->good[s]) {
      return ORB_OK;
    }
  }
  if (all->last) {
    ORB_TRY(hand_over(&all->walkers[all->shape_count - 1], all->last));
  }
  for (int32_t s = 0; s < all->shape_count - (all->last != NULL); s++) {
    double *old = all->sheets[s].shape.points;
    all->sheets[s].shape.points = all->points[s];
    all->points[s] = old;
  }
  *stuck = 0;
  return ORB_OK;
}

orb_status orb_pin_walk(orb_context *ctx, orb_sheet *sheets, int32_t shape_count, const int32_t *landmarks,
                        int32_t count, const orb_walk_options *options, orb_walk_level *last, int *stuck) {
  company all = {.sheets = sheets,
                 .landmarks = landmarks,
                 .count = count,
                 .shape_count = shape_count,
                 .options = options,
                 .last = last,
                 .targets = ORB_NEW(ctx, double, 3 * (size_t)count),
                 .walkers = ORB_NEW0(ctx, walker, shape_count),
                 .points = ORB_NEW0(ctx, double *, shape_count),
                 .left = ORB_NEW0(ctx, int32_t, shape_count),
                 .good = ORB_NEW0(ctx, int, shape_count)};
  *stuck = 1;
  orb_status status = ORB_E_NO_MEMORY;
  if (all.walkers && all.targets && all.points && all.left && all.good) {
    status = walk_together(ctx, &all, stuck);
  }
  if (status == ORB_E_NOT_CERTIFIED) { /* pinned landmarks left a vertex no room: the walk is stuck */
    orb_error_clear(ctx);
    status = ORB_OK;
  }
  for (int32_t s = 0; s < shape_count; s++) {
    if (all.walkers) {
      walker_free(&all.walkers[s]);
    }
    if (all.points) {
      orb_free(ctx, all.points[s]);
    }
  }
  orb_free(ctx, all.walkers);
  orb_free(ctx, all.targets);
  orb_free(ctx, all.points);
  orb_free(ctx, all.left);
  orb_free(ctx, all.good);
  return status;
}
