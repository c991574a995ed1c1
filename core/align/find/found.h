/* The found landmarks of an alignment, and their confidence. */
#ifndef ORB_ALIGN_FIND_FOUND_H
#define ORB_ALIGN_FIND_FOUND_H

#include "orbmorph/alignment.h"

/* Fills found, found_points and confidence of an alignment made without landmarks; its meshes are the given ones,
 * unsplit. clear, 0 to 1: how far other candidates are behind (match.h). found.c describes the method. */
ORB_MUST_CHECK orb_status orb_align_find(orb_context *ctx, orb_alignment *alignment, double clear);

#endif
