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
#include "base/context.h"
#include "base/memory.h"
#include "mesh/nearest.h"

/* The triangles of an aligned mesh by the given triangle in which they lie. */
typedef struct pieces {
  int32_t *first, *next; /* of each given triangle, and of each aligned one; −1: none */
} pieces;

static void pieces_free(orb_context *ctx, pieces *p) {
  orb_free(ctx, p->first);
  orb_free(ctx, p->next);
}

static orb_status pieces_create(orb_context *ctx, const orb_mesh *given, const orb_aligned_shape *shape, pieces *out) {
  const int32_t count = shape->mesh.triangle_count;
  out->first = ORB_NEW(ctx, int32_t, given->triangle_count);
  out->next = ORB_NEW(ctx, int32_t, count);
  if (!out->first || !out->next) {
    return ORB_E_NO_MEMORY;
  }
  memset(out->first, -1, (size_t)given->triangle_count * sizeof *out->first);
  for (int32_t t = count - 1; t >= 0; t--) {
    out->next[t] = out->first[shape->parent[t]];
    out->first[shape->parent[t]] = t;
  }
  return ORB_OK;
}

/* Does the mesh have this place? orb_align() says what is wrong with one that it does not have. */
static int has_place(const orb_mesh *given, const orb_place *place) {
  return place->triangle >= 0 && place->triangle < given->triangle_count && place->at[0] >= 0 && place->at[1] >= 0 &&
         place->at[2] >= 0;
}

/* The same place on the aligned mesh: in the nearest piece of its triangle, unless that is undivided. */
static void place_on_aligned(const orb_mesh *given, const orb_aligned_shape *shape, const pieces *p,
                             const orb_place *place, orb_place *out) {
  const int32_t first = p->first[place->triangle];
  double x[3], least = INFINITY;
  orb_place_position(given, place, x);
  *out = *place;
  for (int32_t t = p->next[first] < 0 && first == place->triangle ? -1 : first; t >= 0; t = p->next[t]) {
    double corners[9], at[3];
    for (int k = 0; k < 3; k++) {
      const int32_t v = shape->mesh.triangles[3 * (size_t)t + (size_t)k];
      memcpy(corners + 3 * k, shape->mesh.positions + 3 * (size_t)v, sizeof(double[3]));
    }
    const double distance = orb_triangle_nearest(corners, x, at);
    if (distance < least) {
      least = distance;
      out->triangle = t;
      memcpy(out->at, at, sizeof at);
    }
  }
}

/* Moves the landmarks of shape s to its aligned mesh. at: the place of landmark l is at[l * shape_count]. *fine 0: a
 * landmark has no place on the given mesh. */
static orb_status move_landmarks(orb_context *ctx, const orb_mesh *given, const orb_aligned_shape *shape, int32_t s,
                                 const orb_landmark *landmarks, int32_t count, size_t shape_count, orb_place *at,
                                 int *fine) {
  pieces p = {0};
  orb_status status = pieces_create(ctx, given, shape, &p);
  for (int32_t l = 0; l < count && status == ORB_OK && *fine; l++) {
    *fine = has_place(given, &landmarks[l].at[s]) && p.first[landmarks[l].at[s].triangle] >= 0;
    if (*fine) {
      place_on_aligned(given, shape, &p, &landmarks[l].at[s], &at[(size_t)l * shape_count]);
    }
  }
  status = status == ORB_OK ? orb_context_check(ctx) : status;
  pieces_free(ctx, &p);
  return status;
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
  int32_t *unique = ORB_NEW(ctx, int32_t, count), unique_count;
  orb_status status = moved && at && sheets && unique ? ORB_OK : ORB_E_NO_MEMORY;
  *fine = 1;
  for (int32_t l = 0; l < count && status == ORB_OK; l++) {
    moved[l] = landmarks[l];
    moved[l].at = at + (size_t)l * shape_count;
  }
  for (size_t s = 0; s < shape_count && status == ORB_OK && *fine; s++) {
    status =
        move_landmarks(ctx, shapes[s].mesh, &start->shapes[s], (int32_t)s, landmarks, count, shape_count, at + s, fine);
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

/* Puts the shape that has moved second: the energy of a map is that of the triangles that move, so it is low. */
static orb_status put_moved_second(orb_context *ctx, orb_alignment *a, orb_preset preset, int *swapped) {
  double energy[2];
  *swapped = 0;
  for (int32_t s = 0; s < 2 && a->shape_count == 2; s++) {
    ORB_TRY(orb_compose_energy(ctx, &a->shapes[1 - s], &a->shapes[s], preset, &energy[s]));
  }
  if (a->shape_count == 2 && energy[0] < energy[1]) {
    orb_alignment_swap(a);
    *swapped = 1;
  }
  return ORB_OK;
}

/* Follows the start to all later shapes. *followed 0: a map is lost, or is bad, or has got much worse than the start.
 */
static orb_status follow_all(orb_context *ctx, orb_alignment *a, orb_preset preset, int *followed) {
  double sum = 0;
  for (int32_t s = 1; s < a->shape_count && *followed; s++) {
    double before, after;
    ORB_TRY(orb_compose_energy(ctx, &a->shapes[0], &a->shapes[s], preset, &before));
    ORB_TRY(follow_shape(ctx, &a->shapes[0], &a->shapes[s], a->landmark_count, preset, &after, followed));
    *followed = *followed && after <= ORB_AGAIN_MOST && after - 1 <= ORB_AGAIN_TIMES * (before - 1) + ORB_AGAIN_MORE;
    sum += after;
  }
  a->energy = sum / (a->shape_count - 1);
  return ORB_OK;
}

static orb_status follow(orb_context *ctx, const orb_landmark *landmarks, orb_preset preset, orb_alignment *a,
                         int *followed) {
  int swapped;
  ORB_TRY(put_moved_second(ctx, a, preset, &swapped));
  orb_status status = follow_all(ctx, a, preset, followed);
  if (status == ORB_OK && *followed) {
    status = orb_align_soften(ctx, landmarks, a->landmark_count, preset, a);
  }
  if (swapped) {
    orb_alignment_swap(a);
  }
  return status;
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
    status = follow(ctx, landmarks, options->preset, out, followed);
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
