/* Maps of which only the landmark walks are made at first, so that several can be compared. */
#ifndef ORB_ALIGN_MAP_DRAFT_H
#define ORB_ALIGN_MAP_DRAFT_H

#include "orbmorph/alignment.h"

/* A map of two shapes towards spatial targets of which only the landmark walks are made, on a coarse level. Several
 * drafts of the same shapes may be made side by side, and the best one finished. */
typedef struct orb_map_draft orb_map_draft;

/* As orb_compose() with a target, `both` and walks_first, on spheres that keep angles, up to the walks. known: the
 * least energy of other maps, or INFINITY; with it, fewer walks are tried. *energy: that of the best walk; INFINITY if
 * none leads to a map. The shapes stay as they are, and must until orb_map_draft_take() or orb_map_draft_free(), as
 * must the target. Free the draft in any case. */
ORB_MUST_CHECK orb_status orb_map_draft_create(orb_context *ctx, orb_aligned_shape *fixed, orb_aligned_shape *moving,
                                               int32_t landmark_count, const double *target, double known,
                                               orb_preset preset, orb_map_draft **out, double *energy);
/* Makes the map of a draft with all vertices, once, on any context of the same root. *energy: of the map, or that of
 * the shapes as they are if it is no better. The shapes stay as they are. */
ORB_MUST_CHECK orb_status orb_map_draft_finish(orb_context *ctx, orb_map_draft *draft, double *energy);
/* Fits a finished draft in space where that may help, and writes its map to the shapes, as orb_compose() does. Without
 * landmarks no limb is untwisted: of 46 pairs of unlike shapes that lowered the energy of one, by 0.005, for a tenth of
 * the time of all. *energy: of the map afterwards. *loose: before it is fitted; INFINITY if the shapes stay as they
 * are. */
ORB_MUST_CHECK orb_status orb_map_draft_take(orb_context *ctx, orb_map_draft *draft, double *energy, double *loose);
void orb_map_draft_free(orb_context *ctx, orb_map_draft *draft);

#endif
