// C++ for one reason: the exception that meshoptimizer throws when memory is exhausted must not pass through C.
#include "transfer/order.h"

#include <meshoptimizer.h>

#include <new>

extern "C" {
#include "base/error.h"
}

orb_status orb_order_for_cache(orb_context *ctx, uint32_t *indices, size_t index_count, size_t vertex_count,
                               uint32_t *remap) {
  try {
    meshopt_optimizeVertexCache(indices, indices, index_count, vertex_count);
    meshopt_optimizeVertexFetchRemap(remap, indices, index_count, vertex_count);
  } catch (const std::bad_alloc &) {
    return orb_fail(ctx, ORB_E_NO_MEMORY, "There is not enough memory to order the triangles.");
  }
  return ORB_OK;
}
