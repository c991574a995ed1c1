#include "embed/newton/hierarchy.h"

#include "base/check.h"
#include "base/memory.h"
#include "embed/newton/decimate.h"
#include "embed/newton/multires.h"
#include "embed/newton/vector/loops.h"

orb_status orb_hierarchy_create(orb_context *ctx, const orb_mesh *mesh, const unsigned char *keep, int32_t keep_until,
                                orb_hierarchy **out) {
  orb_hierarchy *h = ORB_NEW0(ctx, orb_hierarchy, 1);
  if (!h) {
    return ORB_E_NO_MEMORY;
  }
  h->loops = orb_vector_loops_of(orb_context_cpu(ctx));
  unsigned char *kept = NULL;
  orb_status status;
  ORB_GO(status, orb_corner_table_create(ctx, mesh, &h->surface), done);
  if (keep) {
    kept = ORB_NEW(ctx, unsigned char, mesh->vertex_count);
    if (!kept) {
      status = ORB_E_NO_MEMORY;
      goto done;
    }
    for (int32_t i = 0; i < mesh->vertex_count; i++) {
      kept[i] = keep[h->surface.to_mesh[i]];
    }
  }
  ORB_GO(status, orb_decimate(ctx, h, kept, keep_until), done);
  *out = h;
  h = NULL;
done:
  orb_free(ctx, kept);
  orb_hierarchy_destroy(ctx, h);
  return status;
}

void orb_hierarchy_destroy(orb_context *ctx, orb_hierarchy *h) {
  if (h) {
    orb_corner_table_free(ctx, &h->surface);
    orb_free(ctx, h->log);
    orb_free(ctx, h->area_log);
    orb_free(ctx, h->round_start);
    orb_free(ctx, h);
  }
}
