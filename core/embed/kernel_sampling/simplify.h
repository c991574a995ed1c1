/* Simplification of `kernel-sampling`: section 4 of Peng & Timalsena 2016. */
#ifndef ORB_EMBED_KERNEL_SAMPLING_SIMPLIFY_H
#define ORB_EMBED_KERNEL_SAMPLING_SIMPLIFY_H

#include "embed/kernel_sampling/mesh.h"

/* Collapses down to a tetrahedron by Eq. 1; by quadric errors first while more than qem_until vertices live.
 * O(n log n) for bounded valences. */
ORB_MUST_CHECK orb_status orb_ks_simplify(orb_context *ctx, orb_ks_mesh *m, int32_t qem_until);

#endif
