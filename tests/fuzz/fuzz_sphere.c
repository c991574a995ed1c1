/* A stored embedding: two bytes each for the counts of vertices and triangles, then the object as stored on the disk.
 * An accepted embedding has every point on the sphere; the object is also read as the PLY file that callers get. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "orbmorph/format.h"
#include "worker/sphere.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  if (size < 4) {
    return 0;
  }
  int32_t vertices = data[0] | data[1] << 8, triangles = data[2] | data[3] << 8;
  unsigned char *object =
      malloc(size - 4 + (size == 4)); /* exactly this size, so that the sanitizer sees a byte beyond */
  if (!object) {
    return 0;
  }
  memcpy(object, data + 4, size - 4);
  const unsigned char *first = sphere_points(object, size - 4, vertices, triangles);
  for (int32_t v = 0; first && v < vertices; v++) {
    double p[3];
    memcpy(p, first + (size_t)v * SPHERE_STRIDE, sizeof p);
    if (!(fabs(p[0] * p[0] + p[1] * p[1] + p[2] * p[2] - 1) < 1e-8)) {
      abort();
    }
  }
  orb_context_options options = {.threads = 1};
  orb_context *ctx;
  if (orb_context_create(&options, &ctx) == ORB_OK) {
    orb_mesh mesh;
    if (orb_mesh_read(ctx, object, size - 4, ORB_FORMAT_PLY, &mesh, NULL) == ORB_OK) {
      orb_mesh_free(ctx, &mesh);
    }
    orb_context_destroy(ctx);
  }
  free(object);
  return 0;
}
