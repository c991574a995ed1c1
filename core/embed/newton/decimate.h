/* Decimation of a surface to a tetrahedron. */
#ifndef ORB_EMBED_NEWTON_DECIMATE_H
#define ORB_EMBED_NEWTON_DECIMATE_H

#include "embed/newton/multires.h"

/* Decimates a fresh hierarchy; keep and keep_until as for orb_hierarchy_create(), but with flags in the numbers of the
 * surface. */
ORB_MUST_CHECK orb_status orb_decimate(orb_context *ctx, orb_hierarchy *hierarchy, const unsigned char *keep,
                                       int32_t keep_until);

#endif
