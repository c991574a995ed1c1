/* The methods behind orb_align(), on working copies with the landmarks as vertices. `landmarks` lists those that are
 * distinct, by index of the request. */
#ifndef ORB_ALIGN_METHODS_H
#define ORB_ALIGN_METHODS_H

#include "align/compose.h"
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
 * clear, 0 to 1: how far behind other correspondences are (guess.h). See found.c. */
ORB_MUST_CHECK orb_status orb_align_find(orb_context *ctx, orb_alignment *alignment, double clear);

/* 1/E of the linear map from triangle p to triangle q, E = (|J|² + |J⁻¹|²)/4: 1 for a rigid motion, 0 where it is
 * degenerate. *area: of p. */
double orb_triangle_likeness(double p[3][3], double q[3][3], double *area);

/* orb_align() without what `auto` does beyond it: the rotation search, and what was found. */
ORB_MUST_CHECK orb_status orb_align_given(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                                          const orb_landmark *landmarks, int32_t landmark_count,
                                          const orb_align_options *options, orb_alignment *out);

/* Improves the maps from the first shape to the others, see orb_compose(), and fills alignment->energy. */
ORB_MUST_CHECK orb_status orb_compose_all(orb_context *ctx, orb_alignment *alignment, cm_from from, orb_preset preset);

/* Method `auto` without landmarks, see auto.c. */
ORB_MUST_CHECK orb_status orb_align_auto(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                                         const orb_align_options *options, orb_alignment *out);

#endif
