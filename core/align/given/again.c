/* An alignment begins again where an earlier one has ended, after landmarks were moved or added. The earlier map has
 * the limbs where they belong, so nothing is searched and no sphere is embedded anew: its spheres get the landmarks as
 * vertices, and the map is composed from there. The landmarks are pinned at once, and the flips that this makes are
 * cleared on a coarse level. Then the map is relaxed. */
#include <math.h>
#include <string.h>

#include "align/find/params.h"
#include "align/methods.h"
#include "align/sheet/landmarks.h"
#include "align/sheet/sheet.h"
#include "base/check.h"
#include "base/memory.h"
#include "numeric/vec3.h"

/* Coordinates of x in a triangle, as if it lay in its plane; returns the least, −INFINITY for one without area. */
static double coordinates_in(const orb_mesh *mesh, int32_t triangle, const double x[3], double out[3]) {
  const double *p[3];
  double edge[2][3], away[3], n[3];
  for (int k = 0; k < 3; k++) {
    p[k] = mesh->positions + 3 * (size_t)mesh->triangles[3 * (size_t)triangle + (size_t)k];
  }
  orb_sub(p[1], p[0], edge[0]);
  orb_sub(p[2], p[0], edge[1]);
  orb_sub(x, p[0], away);
  orb_cross(edge[0], edge[1], n);
  const double squared = orb_dot(n, n);
  if (!(squared > 0)) {
    return -INFINITY;
  }
  double across[3];
  orb_cross(away, edge[1], across);
  out[1] = orb_dot(across, n) / squared;
  orb_cross(edge[0], away, across);
  out[2] = orb_dot(across, n) / squared;
  out[0] = 1 - out[1] - out[2];
  return fmin(out[0], fmin(out[1], out[2]));
}

/* The same place on the aligned mesh, whose triangles divide those of the given one. *found 0: its pieces are too thin
 * to tell. O(triangles), unless nothing is divided. */
static void place_on_aligned(const orb_mesh *given, const orb_aligned_shape *shape, const orb_place *place,
                             orb_place *out, int *found) {
  double x[3], at[3], best = -INFINITY;
  *out = *place;
  *found = shape->mesh.vertex_count == given->vertex_count;
  if (*found || place->triangle < 0 || place->triangle >= given->triangle_count) {
    return;
  }
  orb_place_position(given, place, x);
  for (int32_t t = 0; t < shape->mesh.triangle_count; t++) {
    const double least = shape->parent[t] == place->triangle ? coordinates_in(&shape->mesh, t, x, at) : -INFINITY;
    if (least > best) {
      best = least;
      out->triangle = t;
      memcpy(out->at, at, sizeof at);
    }
  }
  *found = best > -INFINITY;
  double sum = 0;
  for (int k = 0; k < 3; k++) {
    out->at[k] = fmax(0, out->at[k]);
    sum += out->at[k];
  }
  for (int k = 0; k < 3 && *found; k++) {
    out->at[k] /= sum;
  }
}

/* Shape s of the start with the landmarks, which are on its mesh, as vertices. Its triangles lie in those of the given
 * mesh. */
static orb_status insert(orb_context *ctx, const orb_aligned_shape *start, int32_t s, const orb_landmark *moved,
                         int32_t count, orb_sheet *sheet) {
  ORB_TRY(orb_sheet_create(ctx, &start->mesh, start->points, sheet));
  ORB_TRY(orb_sheet_insert_landmarks(ctx, sheet, moved, count, s));
  orb_aligned_shape *shape = &sheet->shape;
  for (int32_t t = 0; t < shape->mesh.triangle_count; t++) {
    shape->parent[t] = start->parent[shape->parent[t]];
  }
  return orb_certify(ctx, shape->points, shape->mesh.vertex_count, shape->mesh.triangles, shape->mesh.triangle_count,
                     &shape->certificate);
}

/* The shapes of the start with the landmarks as vertices. *fine 0: a landmark has no place there, or a sphere no room
 * for it. */
static orb_status open_shapes(orb_context *ctx, const orb_align_shape *shapes, const orb_landmark *landmarks,
                              int32_t count, const orb_alignment *start, orb_alignment *out, int *fine) {
  const size_t shape_count = (size_t)start->shape_count;
  orb_landmark *moved = ORB_NEW(ctx, orb_landmark, count);
  orb_place *at = ORB_NEW(ctx, orb_place, (size_t)count * shape_count);
  orb_sheet *sheets = ORB_NEW0(ctx, orb_sheet, shape_count);
  int32_t unique_count, *unique = ORB_NEW(ctx, int32_t, count);
  orb_status status = moved && at && sheets && unique ? ORB_OK : ORB_E_NO_MEMORY;
  *fine = 1;
  for (size_t i = 0; i < (size_t)count * shape_count && status == ORB_OK && *fine; i++) {
    const size_t l = i / shape_count, s = i % shape_count;
    moved[l] = landmarks[l];
    moved[l].at = at + l * shape_count;
    place_on_aligned(shapes[s].mesh, &start->shapes[s], &landmarks[l].at[s], &at[i], fine);
  }
  for (size_t s = 0; s < shape_count && status == ORB_OK && *fine; s++) {
    status = insert(ctx, &start->shapes[s], (int32_t)s, moved, count, &sheets[s]);
    *fine = sheets[s].shape.certificate.valid;
  }
  if (status == ORB_OK && *fine) {
    status = orb_landmarks_distinct(ctx, sheets, (int32_t)shape_count, count, unique, &unique_count);
  }
  for (size_t s = 0; sheets && s < shape_count; s++) {
    if (status == ORB_OK && *fine) {
      orb_sheet_release(ctx, &sheets[s], &out->shapes[s]);
    }
    orb_sheet_free(ctx, &sheets[s]);
  }
  orb_free(ctx, moved);
  orb_free(ctx, at);
  orb_free(ctx, sheets);
  orb_free(ctx, unique);
  return status;
}

/* Pins the landmarks of a shape and of the first one where the map takes them, and relaxes the map. */
static orb_status follow_shape(orb_context *ctx, orb_aligned_shape *fixed, orb_aligned_shape *moving, int32_t count,
                               orb_preset preset, double *energy, int *followed) {
  orb_map_guide guide = {.from = ORB_MAP_FROM_SPRINGS};
  double energies[2];
  int relaxed;
  ORB_TRY(orb_compose(ctx, fixed, moving, 0, count, &guide, preset, energies, followed));
  *energy = energies[1];
  if (*followed) {
    guide.from = ORB_MAP_FROM_PINS;
    guide.slides = 1;
    ORB_TRY(orb_compose(ctx, fixed, moving, 0, count, &guide, preset, energies, &relaxed));
    *energy = relaxed ? energies[1] : *energy;
  }
  return ORB_OK;
}

/* Which of two shapes has moved: the energy is that of its triangles, so it is low. before: that energy. */
static orb_status find_moving(orb_context *ctx, orb_alignment *a, orb_preset preset, int32_t *moving, double *before) {
  double energy[2];
  for (int32_t s = 0; s < 2; s++) {
    ORB_TRY(orb_compose_energy(ctx, &a->shapes[1 - s], &a->shapes[s], preset, &energy[s]));
  }
  *moving = energy[0] < energy[1] ? 0 : 1;
  *before = energy[*moving];
  return ORB_OK;
}

/* Follows the start to all later shapes. *followed 0: a map is lost, or has got much worse than the start. */
static orb_status follow_all(orb_context *ctx, orb_alignment *a, orb_preset preset, int *followed) {
  double sum = 0;
  for (int32_t s = 1; s < a->shape_count && *followed; s++) {
    int32_t moving = s;
    double before, after;
    if (a->shape_count == 2) {
      ORB_TRY(find_moving(ctx, a, preset, &moving, &before));
    } else {
      ORB_TRY(orb_compose_energy(ctx, &a->shapes[0], &a->shapes[s], preset, &before));
    }
    ORB_TRY(follow_shape(ctx, &a->shapes[moving == 0 ? s : 0], &a->shapes[moving], a->landmark_count, preset, &after,
                         followed));
    *followed = *followed && after - 1 <= ORB_AGAIN_TIMES * (before - 1) + ORB_AGAIN_MORE;
    sum += after;
  }
  a->energy = sum / (a->shape_count - 1);
  return ORB_OK;
}

orb_status orb_align_follow(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                            const orb_landmark *landmarks, int32_t landmark_count, const orb_align_options *options,
                            const orb_alignment *start, orb_alignment *out, int *followed) {
  memset(out, 0, sizeof *out);
  *followed = 0;
  out->shapes = ORB_NEW0(ctx, orb_aligned_shape, shape_count);
  if (!out->shapes) {
    return ORB_E_NO_MEMORY;
  }
  out->shape_count = shape_count;
  out->landmark_count = landmark_count;
  orb_status status = open_shapes(ctx, shapes, landmarks, landmark_count, start, out, followed);
  if (status == ORB_OK && *followed) {
    status = follow_all(ctx, out, options->preset, followed);
  }
  if (status == ORB_OK && *followed) {
    status = orb_align_soften(ctx, landmarks, landmark_count, options->preset, out);
  }
  if (orb_alignment_lacks_room(ctx, status)) {
    status = ORB_OK;
    *followed = 0;
  }
  if (status != ORB_OK || !*followed) {
    orb_alignment_free(ctx, out);
  }
  return status;
}
