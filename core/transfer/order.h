/* The order of a draft's triangles and vertices, by meshoptimizer. */
#ifndef ORB_TRANSFER_ORDER_H
#define ORB_TRANSFER_ORDER_H

#include "orbmorph/context.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Reorders the triangles for the vertex cache, in place, and computes remap: for each vertex its number in the order of
 * first use. The indices keep the old numbers. ORB_E_NO_MEMORY. */
ORB_MUST_CHECK orb_status orb_order_for_cache(orb_context *ctx, uint32_t *indices, size_t index_count,
                                              size_t vertex_count, uint32_t *remap);

#ifdef __cplusplus
}
#endif
#endif
