/* If a head is mapped onto a bust, a map of least energy spreads the head over the chest, since it stretches all places
 * alike. Landmarks on the face hold only their own places. But they tell how large the head is, and where: a
 * registration in space through them lays it onto the head of the bust, and fits it closely. Then the places that fit
 * are drawn to where they lie, and the rest of the map stretches to cover the chest. It is always the part that is
 * registered, whichever shape moves: all of it has somewhere to go, while a chest would be drawn to the nearest place
 * of the head. */
#include "align/map/space/part.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "align/map/space/drawn.h"
#include "align/map/starts/place.h"
#include "align/map/starts/registration.h"
#include "base/check.h"
#include "base/loops.h"
#include "base/memory.h"
#include "numeric/vec3.h"

enum {
  LEAST_LANDMARKS = 5,
  MOST_LANDMARKS = 256 /* those that come after do not count: room grows with their square, time with their cube */
};

enum { SLICE = 1024, GRAIN = 64 }; /* vertices between checks for cancellation, and of one task: each may search all */

static int by_value(const void *a, const void *b) {
  const double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

/* The distance between two landmarks of a shape, squared, relative to the shape's area; 0: one is missing. */
static double distance2(const orb_aligned_shape *shape, double area, int32_t i, int32_t j) {
  const double *x = shape->mesh.positions;
  const int32_t *vertex = shape->landmark_vertices;
  return area > 0 && vertex[i] >= 0 && vertex[j] >= 0
             ? orb_distance2(x + 3 * (size_t)vertex[i], x + 3 * (size_t)vertex[j]) / area
             : 0;
}

/* The distances between landmarks on the fixed shape, over those on the moving one, sorted. Returns how many. */
static int32_t measure_ratios(const orb_aligned_shape *fixed, const orb_aligned_shape *moving, int32_t landmarks,
                              double *ratio) {
  orb_extent extent[2];
  int32_t count = 0;
  orb_mesh_extent(&fixed->mesh, &extent[0]);
  orb_mesh_extent(&moving->mesh, &extent[1]);
  for (int32_t i = 0; i < landmarks; i++) {
    for (int32_t j = 0; j < i; j++) {
      const double own = distance2(moving, extent[1].area, i, j), other = distance2(fixed, extent[0].area, i, j);
      if (own > 0 && other > 0) {
        ratio[count++] = sqrt(other / own);
      }
    }
  }
  qsort(ratio, (size_t)count, sizeof *ratio, by_value);
  return count;
}

orb_status orb_map_find_part(orb_context *ctx, const orb_map_params *params, const orb_aligned_shape *fixed,
                             const orb_aligned_shape *moving, int32_t landmark_count, orb_map_part *part) {
  const int32_t landmarks = landmark_count < MOST_LANDMARKS ? landmark_count : MOST_LANDMARKS;
  const double scale = params->part.scale;
  *part = ORB_MAP_NO_PART;
  if (landmarks < LEAST_LANDMARKS) {
    return ORB_OK;
  }
  double *ratio = ORB_NEW(ctx, double, (size_t)landmarks *(size_t)(landmarks - 1) / 2);
  if (!ratio) {
    return ORB_E_NO_MEMORY;
  }
  const int32_t count = measure_ratios(fixed, moving, landmarks, ratio);
  if (count > 0) {
    const double low = ratio[count / 4], high = ratio[count - 1 - count / 4];
    const int is_even = high < params->part.spread * low;
    *part = is_even && low > scale        ? ORB_MAP_PART_IS_FIXED
            : is_even && high < 1 / scale ? ORB_MAP_PART_MOVES
                                          : ORB_MAP_NO_PART;
  }
  orb_free(ctx, ratio);
  return ORB_OK;
}

/* Landmarks that hold a registration. */
static int32_t anchor_count(const orb_map_run *c) {
  return c->pairs.landmarks < MOST_LANDMARKS ? c->pairs.landmarks : MOST_LANDMARKS;
}

/* Does a point fit at a place of a surface: is it near, and does the surface face like it? y: where the place is. */
static int fits_at(const orb_map_run *c, const orb_map_surface *on, const orb_place *place, const double point[3],
                   const double normal[3], double y[3]) {
  double n[3];
  orb_map_surface_at(on, place, y, NULL, n);
  return sqrt(orb_distance2(y, point)) < c->params.part.off && orb_dot(n, normal) > c->params.part.facing;
}

/* Registers the moving shape in space by the landmarks alone. */
static orb_status register_moving(orb_map_run *c) {
  const double *given = c->given_target;
  const int32_t samples = c->samples.count, pairs = c->pairs.count;
  c->given_target = NULL;
  c->samples.count = 0;
  c->pairs.count = anchor_count(c);
  orb_status status = orb_map_register(c, 0);
  c->given_target = given;
  c->samples.count = samples;
  c->pairs.count = pairs;
  return status;
}

/* Marks the vertices that the registration lays onto the fixed shape, and makes their places there the targets. Returns
 * their share. */
static double mark_moving(orb_map_run *c, unsigned char *fits) {
  int32_t count = 0;
  for (int32_t v = 0; v < c->vertex_count; v++) {
    double y[3], *target = c->target + 3 * (size_t)v;
    fits[v] = (unsigned char)fits_at(c, &c->b, &c->target_place[v], target, c->target_normal + 3 * (size_t)v, y);
    count += fits[v];
    memcpy(target, y, sizeof y);
  }
  return (double)count / c->vertex_count;
}

/* Registers the fixed shape to the moving one by the landmarks. lies: where its vertices come to lie, 3 each. */
static orb_status register_fixed(orb_map_run *c, const orb_map_surface *whole, double *lies) {
  const int32_t count = anchor_count(c);
  double off, at[3 * MOST_LANDMARKS];
  for (int32_t i = 0; i < count; i++) {
    memcpy(at + 3 * (size_t)i, c->x + 3 * (size_t)c->pairs.moving[i], sizeof(double[3]));
  }
  const orb_map_anchors anchors = {count, count, c->pairs.fixed, at};
  return orb_map_register_in_space(c->ctx, &c->params, whole, c->b.x, c->b.normal, c->b.vertex_count, &anchors, lies,
                                   &off);
}

/* Vertices of one surface that are to fit on another one. */
typedef struct fitting {
  const orb_map_run *run;
  const orb_map_surface *own, *other;
  const orb_nearest *tree; /* of the other surface */
  unsigned char *fits;     /* of each vertex: it is near to the other surface, and faces alike */
  orb_place *place;        /* of each vertex, on the other surface */
} fitting;

static void fit_range(void *arg, int64_t begin, int64_t end, int thread) {
  const fitting *f = arg;
  (void)thread;
  for (int64_t v = begin; v < end; v++) {
    const double *x = f->own->x + 3 * v;
    double y[3];
    (void)orb_nearest_query(f->tree, x, INFINITY, &f->place[v]);
    f->fits[v] = (unsigned char)fits_at(f->run, f->other, &f->place[v], x, f->own->normal + 3 * v, y);
  }
}

/* Finds the places of one surface's vertices on another one. fits, place: of each vertex. */
static orb_status find_fitting(orb_map_run *c, const orb_map_surface *own, const orb_map_surface *other,
                               unsigned char *fits, orb_place *place) {
  orb_nearest *tree;
  ORB_TRY(orb_nearest_create(c->ctx, other->x, other->triangles, other->triangle_count, &tree));
  fitting f = {c, own, other, tree, fits, place};
  orb_status status = orb_sliced_by(c->ctx, own->vertex_count, SLICE, GRAIN, fit_range, &f);
  orb_nearest_destroy(c->ctx, tree);
  return status;
}

/* Marks the vertices of the moving shape, `whole`, that the registered fixed shape, `part`, covers, and makes its
 * places there their targets. *share: of the part's vertices, those that lie on the whole. */
static orb_status mark_covered(orb_map_run *c, const orb_map_surface *part, const orb_map_surface *whole,
                               unsigned char *fits, double *share) {
  const size_t n = (size_t)part->vertex_count, m = (size_t)whole->vertex_count;
  unsigned char *lies = ORB_NEW(c->ctx, unsigned char, n);
  orb_place *place = ORB_NEW(c->ctx, orb_place, n > m ? n : m);
  orb_status status = lies && place ? ORB_OK : ORB_E_NO_MEMORY;
  int32_t count = 0;
  if (status != ORB_OK) {
    goto done;
  }
  ORB_GO(status, find_fitting(c, part, whole, lies, place), done);
  for (size_t u = 0; u < n; u++) {
    count += lies[u];
  }
  *share = (double)count / part->vertex_count;
  ORB_GO(status, find_fitting(c, whole, part, fits, place), done);
  memset(c->doubted, ORB_MAP_TRUSTED, m);
  for (size_t v = 0; v < m; v++) {
    orb_map_surface_at(&c->b, &place[v], c->target + 3 * v, NULL, NULL);
  }
done:
  orb_free(c->ctx, lies);
  orb_free(c->ctx, place);
  return status;
}

/* Registers the fixed shape, marks the vertices that it covers, and sets their targets. *share: see mark_covered(). */
static orb_status fit_fixed(orb_map_run *c, unsigned char *fits, double *share) {
  orb_context *ctx = c->ctx;
  const orb_mesh *mesh = &c->moving->mesh;
  const orb_map_surface whole = {.vertex_count = mesh->vertex_count,
                                 .triangle_count = mesh->triangle_count,
                                 .triangles = mesh->triangles,
                                 .x = c->x,
                                 .normal = c->normal};
  orb_map_surface part = {.vertex_count = c->b.vertex_count,
                          .triangle_count = c->b.triangle_count,
                          .triangles = c->b.triangles,
                          .x = ORB_NEW(ctx, double, 3 * (size_t)c->b.vertex_count),
                          .normal = ORB_NEW(ctx, double, 3 * (size_t)c->b.vertex_count)};
  orb_status status = part.x && part.normal ? ORB_OK : ORB_E_NO_MEMORY;
  if (status != ORB_OK) {
    goto done;
  }
  ORB_GO(status, register_fixed(c, &whole, part.x), done);
  orb_map_normals(part.x, part.vertex_count, part.triangles, part.triangle_count, part.normal);
  status = mark_covered(c, &part, &whole, fits, share);
done:
  orb_free(ctx, part.x);
  orb_free(ctx, part.normal);
  return status;
}

/* Marks the vertices that fit, and sets their targets. *share: of the part's vertices, those that fit. */
static orb_status fit(orb_map_run *c, orb_map_part part, unsigned char *fits, double *share) {
  if (part == ORB_MAP_PART_IS_FIXED) {
    return fit_fixed(c, fits, share);
  }
  ORB_TRY(register_moving(c));
  *share = mark_moving(c, fits);
  return ORB_OK;
}

orb_status orb_map_fit_part(orb_map_run *c, orb_map_part part) {
  orb_context *ctx = c->ctx;
  double share;
  orb_corner_table s;
  orb_map_level level = {0};
  ORB_TRY(orb_map_take_best(c)); /* a walk before may have set it aside */
  if (!(c->best_energy < INFINITY)) {
    return ORB_OK;
  }
  ORB_TRY(orb_corner_table_create(ctx, &c->moving->mesh, &s));
  unsigned char *fits = ORB_NEW(ctx, unsigned char, c->vertex_count);
  orb_status status = fits ? ORB_OK : ORB_E_NO_MEMORY;
  if (status != ORB_OK) {
    goto done;
  }
  ORB_GO(status, fit(c, part, fits, &share), done);
  if (share < c->params.part.least) {
    goto done;
  }
  ORB_GO(status, orb_map_full_level(c, c->best, &s, &level), done);
  ORB_GO(status, orb_map_draw_whole(c, &level, s.to_mesh, fits, c->params.slide.pull), done);
  c->course.fits_part = orb_map_take_drawn(c, &level, s.to_mesh, c->params.part.most * c->best_energy);
done:
  orb_free(ctx, fits);
  orb_map_level_free(ctx, &level);
  orb_corner_table_free(ctx, &s);
  return status;
}
