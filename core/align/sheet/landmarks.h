/* Landmarks as vertices of working copies. */
#ifndef ORB_ALIGN_SHEET_LANDMARKS_H
#define ORB_ALIGN_SHEET_LANDMARKS_H

#include "align/sheet/sheet.h"

/* Does a spring hold the landmark instead of a pin? */
static inline int orb_landmark_is_soft(const orb_landmark *landmark) {
  return landmark->weight > 0 && landmark->weight < 1;
}

static inline int32_t orb_landmarks_soft(const orb_landmark *landmarks, int32_t count) {
  int32_t soft = 0;
  for (int32_t l = 0; l < count; l++) {
    soft += orb_landmark_is_soft(&landmarks[l]);
  }
  return soft;
}

/* Makes each landmark a vertex: splits the triangle or edge in which it lies if it is not a vertex yet. Places are on
 * the mesh from which the (unsplit) sheet was made; a coordinate below 2e-7 counts as zero. Fills landmark_vertices,
 * which the shape owns. shape_index is for the error. ORB_E_BAD_LANDMARKS names places that are out of range, or for
 * which the sphere has no room: every triangle of a split is exactly positive on it. */
ORB_MUST_CHECK orb_status orb_sheet_insert_landmarks(orb_context *ctx, orb_sheet *sheet, const orb_landmark *landmarks,
                                                     int32_t landmark_count, int32_t shape_index);

/* Which landmarks are distinct. A landmark that shares its vertex with an earlier one on every shape is merged with it;
 * if it shares the vertex on some shapes only, ORB_E_BAD_LANDMARKS names both. */
ORB_MUST_CHECK orb_status orb_landmarks_distinct(orb_context *ctx, const orb_sheet *sheets, int32_t shape_count,
                                                 int32_t landmark_count, int32_t *unique, int32_t *unique_count);

/* The current sphere points of landmarks, shape-major, 3 per landmark. The caller frees them. */
ORB_MUST_CHECK orb_status orb_landmark_points(orb_context *ctx, const orb_sheet *sheets, int32_t shape_count,
                                              const int32_t *landmarks, int32_t count, double **out);

#endif
