#include "transfer/holes.h"

#include <stdio.h>

#include "base/check.h"
#include "mesh/dropped.h"

int orb_has_holes(const orb_mesh *mesh) {
  for (int32_t t = 0; mesh->source_triangle && t < mesh->triangle_count; t++) {
    if (mesh->source_triangle[t] == ORB_MADE_FILL) {
      return 1;
    }
  }
  return 0;
}

orb_status orb_dropped_holes(orb_context *ctx, const orb_supermesh *supermesh, const orb_aligned_shape *shapes,
                             const orb_asset_options *options, int is_file, orb_dropped **list, int32_t *count) {
  const int first = orb_has_holes(&shapes[0].mesh);
  const int is_open = first && (is_file || (options->holes == ORB_HOLES_REOPEN && supermesh->has_rims));
  if (first && !is_open && options->holes == ORB_HOLES_REOPEN) {
    ORB_TRY(orb_dropped_add(ctx, list, count, "holes", "shapes[0]",
                            "Their rims could not be made edges, so they stay filled; the methods overlay and template "
                            "always reopen them."));
  }
  for (int32_t s = 1; s < supermesh->shape_count; s++) {
    char where[32];
    (void)snprintf(where, sizeof where, "shapes[%d]", s);
    const int has = orb_has_holes(&shapes[s].mesh);
    if (has && !is_open) {
      ORB_TRY(orb_dropped_add(ctx, list, count, "holes", where,
                              "Only holes of the first shape can be open, so those of this shape stay filled."));
    } else if (!has && is_open) {
      ORB_TRY(orb_dropped_add(ctx, list, count, "surface", where,
                              "The first shape has holes and this shape has none, so what lies there is left out."));
    }
  }
  return ORB_OK;
}
