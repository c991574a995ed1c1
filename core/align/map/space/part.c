/* If a head is mapped onto a bust, a map of least energy spreads the head over the chest, since it stretches all places
 * alike. Landmarks on the face hold only their own places. But they tell how large the head is, and where: the
 * similarity that they agree on puts it onto the head of the bust, and a registration in space fits it closely. Then
 * the places that fit are drawn to where they lie, and the rest of the map stretches to cover the chest. */
#include "align/map/space/part.h"

#include <math.h>
#include <stdlib.h>

#include "align/map/space/drawn.h"
#include "align/map/starts/place.h"
#include "base/check.h"
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

/* The distances between landmarks on the fixed shape, over those on the moving one, sorted. Returns how many. */
static int32_t measure_ratios(const orb_map_run *c, int32_t landmarks, double *ratio) {
  int32_t count = 0;
  for (int32_t i = 0; i < landmarks; i++) {
    for (int32_t j = 0; j < i; j++) {
      const orb_map_pairs *p = &c->pairs;
      const double moving = orb_distance2(c->x + 3 * (size_t)p->moving[i], c->x + 3 * (size_t)p->moving[j]);
      const double fixed = orb_distance2(c->b.x + 3 * (size_t)p->fixed[i], c->b.x + 3 * (size_t)p->fixed[j]);
      if (moving > 0 && fixed > 0) {
        ratio[count++] = sqrt(fixed / moving);
      }
    }
  }
  qsort(ratio, (size_t)count, sizeof *ratio, by_value);
  return count;
}

orb_status orb_map_is_part(orb_map_run *c, int *is_part) {
  const int32_t landmarks = c->pairs.landmarks < MOST_LANDMARKS ? c->pairs.landmarks : MOST_LANDMARKS;
  const double scale = c->params.part.scale;
  *is_part = 0;
  if (landmarks < LEAST_LANDMARKS) {
    return ORB_OK;
  }
  double *ratio = ORB_NEW(c->ctx, double, (size_t)landmarks *(size_t)(landmarks - 1) / 2);
  if (!ratio) {
    return ORB_E_NO_MEMORY;
  }
  const int32_t count = measure_ratios(c, landmarks, ratio);
  if (count > 0) {
    const double low = ratio[count / 4], high = ratio[count - 1 - count / 4];
    *is_part = (low > scale || high < 1 / scale) && high < c->params.part.spread * low;
  }
  orb_free(c->ctx, ratio);
  return ORB_OK;
}

/* Registers the moving shape in space by the landmarks alone. */
static orb_status register_by_landmarks(orb_map_run *c) {
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
static double mark_fitting(orb_map_run *c, unsigned char *fits) {
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

orb_status orb_map_fit_part(orb_map_run *c) {
  orb_context *ctx = c->ctx;
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
  ORB_GO(status, register_by_landmarks(c), done);
  if (mark_fitting(c, fits) < c->params.part.least) {
    goto done;
  }
  ORB_GO(status, orb_map_full_level(c, c->best, &s, &level), done);
  ORB_GO(status, orb_map_draw_whole(c, &level, s.to_mesh, fits), done);
  c->course.fits_part = orb_map_take_drawn(c, &level, s.to_mesh, c->params.part.most * c->best_energy);
done:
  orb_free(ctx, fits);
  orb_map_level_free(ctx, &level);
  orb_corner_table_free(ctx, &s);
  return status;
}
