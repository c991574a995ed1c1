/* Feeds bytes to one reader and what it makes of them to the repairs, with a bound on memory: nothing may crash, hang,
 * or take more than a small multiple of the file. */
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include "orbmorph/format.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  orb_context_options options = {.threads = 1};
  orb_context *ctx;
  if (orb_context_create(&options, &ctx) != ORB_OK) {
    return 0;
  }
  (void)orb_format_detect(data, size);
  orb_mesh mesh;
  if (orb_mesh_read(ctx, data, size, FUZZ_FORMAT, &mesh, NULL) == ORB_OK) {
    orb_topology topology;
    orb_mesh copy;
    if (orb_mesh_topology(ctx, &mesh, &topology) != ORB_OK) {
      abort();
    }
    static const unsigned repairs[] = {ORB_REPAIR_NONE, ORB_REPAIR_SAFE,
                                       ORB_REPAIR_FILL_HOLES | ORB_REPAIR_LARGEST_COMPONENT,
                                       ORB_REPAIR_FILL_HOLES | ORB_REPAIR_PART | ORB_REPAIR_CLOSE_HANDLES,
                                       ORB_REPAIR_SPLIT | ORB_REPAIR_LARGEST_COMPONENT};
    for (int i = 0; i < 5; i++) {
      if (orb_mesh_copy(ctx, &mesh, &copy) != ORB_OK) {
        abort();
      }
      if (orb_mesh_repair_with(ctx, &copy, &(orb_repair_options){.repair = repairs[i], .handle_size = 10}) == ORB_OK &&
          (orb_mesh_topology(ctx, &copy, &topology) != ORB_OK || topology.components != 1 || topology.genus != 0 ||
           topology.boundary_edges || topology.nonmanifold_edges || topology.nonmanifold_vertices ||
           !topology.consistent || copy.triangle_count < 4)) {
        abort(); /* accepted, and yet not a sphere */
      }
      orb_mesh_free(ctx, &copy);
    }
    orb_mesh_free(ctx, &mesh);
  }
  if (orb_memory_peak(ctx) > 400 * size + (2u << 20)) {
    abort();
  }
  orb_context_destroy(ctx);
  return 0;
}
