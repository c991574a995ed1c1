#include "remesh/overlay/build.h"

#include <string.h>

#include "base/check.h"
#include "remesh/overlay/faces.h"
#include "remesh/overlay/trace.h"

void orb_overlay_free(orb_context *ctx, orb_overlay *overlay) {
  for (int l = 0; l < 2; l++) {
    orb_layer *layer = &overlay->layer[l];
    orb_free(ctx, layer->spot);
    orb_free(ctx, layer->id);
    orb_free(ctx, layer->edge);
    orb_free(ctx, layer->half);
    orb_free(ctx, layer->begin);
    orb_free(ctx, layer->event);
    orb_free(ctx, layer->event_id);
  }
  orb_free(ctx, overlay->lone);
  orb_free(ctx, overlay->cross);
  orb_free(ctx, overlay->points);
  orb_free(ctx, overlay->places);
  orb_free(ctx, overlay->triangles);
  orb_free(ctx, overlay->parent);
  orb_free(ctx, overlay->merged);
  memset(overlay, 0, sizeof *overlay);
}

orb_status orb_overlay_build(orb_context *ctx, orb_overlay *overlay) {
  ORB_TRY(orb_overlay_trace(ctx, overlay));
  return orb_overlay_faces(ctx, overlay);
}
