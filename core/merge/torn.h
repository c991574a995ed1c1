/* Where a repair has split vertices of a template, whose asset has them whole. */
#ifndef ORB_MERGE_TORN_H
#define ORB_MERGE_TORN_H

#include "orbmorph/merge.h"

/* For the method template: moves the copies of each vertex that a repair has split to where the asset has that vertex.
 * repaired: the first shape as it was aligned. positions: of the supermesh on a later shape, 3 per vertex. *moved: the
 * longest way. O(V). */
void orb_torn_close(const orb_mesh *repaired, const orb_supermesh *supermesh, double *positions, double *moved);

/* For the method template: raises the proved bounds in out->shapes from those of the supermesh to those of the asset,
 * which has split vertices whole, and no covers of what a repair has opened. Needs out->alignment, supermesh and
 * shapes. O(V + F) a shape. */
ORB_MUST_CHECK orb_status orb_report_torn(orb_context *ctx, const orb_mesh *repaired, orb_merge_result *out);

#endif
