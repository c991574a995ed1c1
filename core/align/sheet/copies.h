/* Decimated copies of the later shapes of an alignment, which are aligned in their place.
 *
 * An alignment moves every vertex of a shape many times, but where each limb goes is decided by a few thousand of them.
 * So copies of large shapes are aligned, and the whole shapes follow (map/lifted.h). A copy is a level of the whole
 * shape, and has its landmarks as vertices. */
#ifndef ORB_ALIGN_SHEET_COPIES_H
#define ORB_ALIGN_SHEET_COPIES_H

#include "align/sheet/copy.h"
#include "orbmorph/align.h"

/* A later shape and its copy. */
typedef struct orb_copied_shape {
  orb_aligned_shape whole; /* with the landmarks as vertices, on its own embedding, not certified */
  orb_coarse_copy copy;
  orb_hierarchy *hierarchy; /* of whole.mesh: the copy is one of its levels */
} orb_copied_shape;

typedef struct orb_copies {
  int32_t shape_count, landmark_count;
  orb_copied_shape *of;    /* shape_count; the first is empty */
  orb_align_shape *shapes; /* what is to be aligned: the first shape, and the copies of the later ones */
  orb_landmark *landmarks; /* on these; the soft ones are pinned too, until the whole shapes follow */
  orb_place *at;           /* the places of the landmarks */
} orb_copies;

/* Copies all later shapes. size: vertices of a copy, or few more; copies of smaller shapes have all vertices.
 * keep_until: as in copy.h. ORB_E_BAD_LANDMARKS as orb_sheet_insert_landmarks(). Free `out` in any case. O(n log n). */
ORB_MUST_CHECK orb_status orb_copies_create(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                                            const orb_landmark *landmarks, int32_t landmark_count, int32_t size,
                                            int32_t keep_until, orb_copies *out);
void orb_copies_free(orb_context *ctx, orb_copies *copies);

/* Turns a place at a vertex of copies->shapes[shape] into the place of that vertex on the whole shape. */
ORB_MUST_CHECK orb_status orb_copies_lift_vertex(orb_context *ctx, const orb_copies *copies, int32_t shape,
                                                 orb_place *place);

#endif
