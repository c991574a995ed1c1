#include "align/given/part.h"

#include <math.h>
#include <string.h>

#include "align/find/params.h"
#include "align/sheet/sheet.h"
#include "base/check.h"
#include "base/memory.h"
#include "numeric/vec3.h"

/* The radius of a ball of the shape's area. */
static double radius_of(const orb_mesh *mesh) {
  orb_extent extent;
  orb_mesh_extent(mesh, &extent);
  return sqrt(extent.area / (4 * M_PI));
}

/* Is a vertex of shape s far from all of the first landmarks? */
static int is_free(const orb_align_shape *shape, const orb_part_landmarks *all, int32_t landmark_count, int s,
                   int32_t vertex, double least) {
  const double *p = shape->mesh->positions + 3 * (size_t)vertex;
  for (int32_t l = 0; l < landmark_count; l++) {
    double at[3];
    orb_place_position(shape->mesh, &all->at[2 * l + s], at);
    if (orb_distance2(p, at) < least * least) {
      return 0;
    }
  }
  return 1;
}

orb_status orb_part_landmarks_create(orb_context *ctx, const orb_align_shape shapes[2], const orb_landmark *landmarks,
                                     int32_t landmark_count, const orb_inset *inset, orb_part_landmarks *out) {
  const size_t most = (size_t)landmark_count + (size_t)inset->count;
  const double least[2] = {ORB_FIND_INSET_APART * radius_of(shapes[0].mesh),
                           ORB_FIND_INSET_APART * radius_of(shapes[1].mesh)};
  *out = (orb_part_landmarks){landmark_count, ORB_NEW0(ctx, orb_landmark, most), ORB_NEW(ctx, orb_place, 2 * most)};
  if (!out->landmark || !out->at) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t l = 0; l < landmark_count; l++) {
    out->landmark[l] = landmarks[l];
    out->landmark[l].at = memcpy(out->at + 2 * l, landmarks[l].at, 2 * sizeof *out->at);
  }
  for (int32_t i = 0; i < inset->count; i++) {
    int fits = 1;
    for (int s = 0; s < 2 && fits; s++) {
      const int32_t v = inset->vertex[s][i];
      fits = v < shapes[s].mesh->vertex_count && is_free(&shapes[s], out, landmark_count, s, v, least[s]);
    }
    if (fits) {
      orb_landmark *one = &out->landmark[out->count];
      orb_place *at = out->at + 2 * out->count++;
      one->at = at;
      ORB_TRY(orb_place_of_vertex(ctx, shapes[0].mesh, inset->vertex[0][i], &at[0]));
      ORB_TRY(orb_place_of_vertex(ctx, shapes[1].mesh, inset->vertex[1][i], &at[1]));
    }
  }
  if (out->count - landmark_count < ORB_FIND_INSET_FEWEST) {
    out->count = landmark_count;
  }
  return ORB_OK;
}

void orb_part_landmarks_free(orb_context *ctx, orb_part_landmarks *landmarks) {
  orb_free(ctx, landmarks->landmark);
  orb_free(ctx, landmarks->at);
}
