#include <string.h>

#include "orbmorph/remesh.h"

void orb_supermesh_free(orb_context *ctx, orb_supermesh *supermesh) {
  orb_free(ctx, supermesh->triangles);
  orb_free(ctx, supermesh->points);
  orb_free(ctx, supermesh->places);
  orb_free(ctx, supermesh->landmark_vertices);
  orb_free(ctx, supermesh->error_bound);
  memset(supermesh, 0, sizeof *supermesh);
}
