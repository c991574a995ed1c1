/* The methods behind orb_align(), on working copies with the landmarks as vertices. `landmarks` lists those that are
 * distinct, by index of the request. */
#ifndef ORB_ALIGN_METHODS_H
#define ORB_ALIGN_METHODS_H

#include "align/sheet.h"

/* Which landmarks are distinct: one that shares its vertex with an earlier one on every shape is merged with it; on
 * some shapes only it contradicts: ORB_E_BAD_LANDMARKS names both. */
ORB_MUST_CHECK orb_status orb_landmarks_distinct(orb_context *ctx, const orb_sheet *sheets, int32_t shape_count,
                                                 int32_t landmark_count, int32_t *unique, int32_t *unique_count);

/* Their present sphere points, shape-major, 3 a landmark; the caller frees them. */
ORB_MUST_CHECK orb_status orb_landmark_points(orb_context *ctx, const orb_sheet *sheets, int32_t shape_count,
                                              const int32_t *landmarks, int32_t count, double **out);

/* Generalised Procrustes, applied to the spheres. */
ORB_MUST_CHECK orb_status orb_rotate_by_landmarks(orb_context *ctx, orb_sheet *sheets, int32_t shape_count,
                                                  const int32_t *landmarks, int32_t count);

/* Landmarks as constraints of the embeddings: bit-equal points afterwards. */
ORB_MUST_CHECK orb_status orb_align_pin(orb_context *ctx, orb_sheet *sheets, int32_t shape_count,
                                        const int32_t *landmarks, int32_t count, const orb_align_options *options);

/* The warp by radial basis functions of Peng & Timalsena 2016, section 7.2. */
ORB_MUST_CHECK orb_status orb_align_rbf(orb_context *ctx, orb_sheet *sheets, int32_t shape_count,
                                        const orb_landmark *given, const int32_t *landmarks, int32_t count,
                                        const orb_align_options *options);

/* Fills found, found_points and confidence of an alignment made without landmarks: its meshes are those given, unsplit.
 * See found.c. */
ORB_MUST_CHECK orb_status orb_align_find(orb_context *ctx, orb_alignment *alignment);

#endif
