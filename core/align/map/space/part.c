/* If a head is mapped onto a bust, a map of least energy spreads the head over the chest, since it stretches all places
 * alike. Landmarks on the face hold only their own places. But they tell how large the head is, and where: a
 * registration in space through them lays it onto the head of the bust, and fits it closely. Then the places that fit
 * are drawn to where they lie, and the rest of the map stretches to cover the chest. It is always the part that is
 * registered, whichever shape moves: all of it has somewhere to go, while a chest would be drawn to the nearest place
 * of the head. */
#include "align/map/space/part.h"

#include <math.h>
#include <stdlib.h>

#include "align/map/space/drawn.h"
#include "align/map/starts/place.h"
#include "align/map/starts/registration.h"
#include "base/check.h"
#include "base/context.h"
#include "base/memory.h"
#include "numeric/vec3.h"

enum {
  LEAST_LANDMARKS = 5,
  MOST_LANDMARKS = 256 /* those that come after do not count: room grows with their square, time with their cube */
};

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

/* Registers the moving shape in space by the landmarks alone. */
static orb_status register_moving(orb_map_run *c) {
  const double *given = c->given_target;
  const int32_t samples = c->samples.count, pairs = c->pairs.count;
  c->given_target = NULL;
  c->samples.count = 0;
  c->pairs.count = c->pairs.landmarks < MOST_LANDMARKS ? c->pairs.landmarks : MOST_LANDMARKS;
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
    double place[3], normal[3], *target = c->target + 3 * (size_t)v;
    orb_map_surface_at(&c->b, &c->target_place[v], place, NULL, normal);
    const double off = sqrt(orb_distance2(place, target));
    fits[v] = off < c->params.part.off && orb_dot(normal, c->target_normal + 3 * (size_t)v) > c->params.part.facing;
    count += fits[v];
    for (int k = 0; k < 3; k++) {
      target[k] = place[k];
    }
  }
  return (double)count / c->vertex_count;
}

/* Registers the fixed shape to the moving one by the landmarks. lies: where its vertices come to lie, 3 each. */
static orb_status register_fixed(orb_map_run *c, const orb_map_surface *whole, double *lies) {
  const int32_t count = c->pairs.landmarks < MOST_LANDMARKS ? c->pairs.landmarks : MOST_LANDMARKS;
  double off, at[3 * MOST_LANDMARKS];
  for (int32_t i = 0; i < count; i++) {
    memcpy(at + 3 * (size_t)i, c->x + 3 * (size_t)c->pairs.moving[i], sizeof(double[3]));
  }
  const orb_map_anchors anchors = {count, count, c->pairs.fixed, at};
  return orb_map_register_in_space(c->ctx, &c->params, whole, c->b.x, c->b.normal, c->b.vertex_count, &anchors, lies,
                                   &off);
}

/* Finds the place of a surface that is nearest to a point. Returns whether it fits: it is near, and faces alike. */
static int find_fitting(const orb_map_run *c, const orb_map_surface *on, const orb_nearest *tree, const double point[3],
                        const double normal[3], orb_place *place) {
  double y[3], n[3];
  (void)orb_nearest_query(tree, point, INFINITY, place);
  orb_map_surface_at(on, place, y, NULL, n);
  return sqrt(orb_distance2(y, point)) < c->params.part.off && orb_dot(n, normal) > c->params.part.facing;
}

/* Marks the vertices that the registered fixed shape, `part`, covers, and makes its places there their targets. Returns
 * the share of its vertices that lie on the moving shape, `whole`. */
static double mark_covered(orb_map_run *c, const orb_map_surface surface[2], orb_nearest *const tree[2],
                           unsigned char *fits) {
  const orb_map_surface *part = &surface[0], *whole = &surface[1];
  orb_place place;
  int32_t count = 0;
  for (int32_t u = 0; u < part->vertex_count; u++) {
    count += find_fitting(c, whole, tree[1], part->x + 3 * (size_t)u, part->normal + 3 * (size_t)u, &place);
  }
  memset(c->doubted, 0, (size_t)c->vertex_count);
  for (int32_t v = 0; v < whole->vertex_count; v++) {
    fits[v] =
        (unsigned char)find_fitting(c, part, tree[0], whole->x + 3 * (size_t)v, whole->normal + 3 * (size_t)v, &place);
    orb_map_surface_at(&c->b, &place, c->target + 3 * (size_t)v, NULL, NULL);
  }
  return (double)count / part->vertex_count;
}

/* Registers the fixed shape, marks the vertices that it covers, and sets their targets. *share: see mark_covered(). */
static orb_status fit_fixed(orb_map_run *c, unsigned char *fits, double *share) {
  orb_context *ctx = c->ctx;
  const orb_mesh *mesh = &c->moving->mesh;
  orb_map_surface surface[2] = {{.vertex_count = c->b.vertex_count,
                                 .triangle_count = c->b.triangle_count,
                                 .triangles = c->b.triangles,
                                 .x = ORB_NEW(ctx, double, 3 * (size_t)c->b.vertex_count),
                                 .normal = ORB_NEW(ctx, double, 3 * (size_t)c->b.vertex_count)},
                                {.vertex_count = mesh->vertex_count,
                                 .triangle_count = mesh->triangle_count,
                                 .triangles = mesh->triangles,
                                 .x = c->x,
                                 .normal = c->normal}};
  orb_nearest *tree[2] = {NULL, NULL};
  orb_status status = surface[0].x && surface[0].normal ? ORB_OK : ORB_E_NO_MEMORY;
  if (status != ORB_OK) {
    goto done;
  }
  ORB_GO(status, register_fixed(c, &surface[1], surface[0].x), done);
  orb_map_normals(surface[0].x, c->b.vertex_count, c->b.triangles, c->b.triangle_count, surface[0].normal);
  for (int i = 0; i < 2; i++) {
    ORB_GO(status, orb_nearest_create(ctx, surface[i].x, surface[i].triangles, surface[i].triangle_count, &tree[i]),
           done);
  }
  ORB_GO(status, orb_context_check(ctx), done);
  *share = mark_covered(c, surface, tree, fits);
done:
  orb_nearest_destroy(ctx, tree[0]);
  orb_nearest_destroy(ctx, tree[1]);
  orb_free(ctx, surface[0].x);
  orb_free(ctx, surface[0].normal);
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
