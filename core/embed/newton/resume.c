#include "embed/newton/resume.h"

#include "base/check.h"
#include "base/memory.h"
#include "embed/newton/multires.h"
#include "embed/newton/vector/loops.h"

orb_status orb_refiner_resume(orb_context *ctx, const orb_mesh *mesh, const double *points,
                              const orb_embed_options *options, orb_hierarchy **hierarchy, orb_refiner **out) {
  orb_refiner *r = NULL;
  orb_hierarchy *h = ORB_NEW0(ctx, orb_hierarchy, 1);
  if (!h) {
    return ORB_E_NO_MEMORY;
  }
  h->loops = orb_vector_loops_of(orb_context_cpu(ctx));
  orb_status status;
  ORB_GO(status, orb_corner_table_create(ctx, mesh, &h->surface), done);
  const orb_corner_table *s = &h->surface;
  /* The four vertices around an edge serve as the base: every position is set below. */
  int32_t c = s->vertex_corner[0];
  h->base[0] = s->corner[c];
  h->base[1] = s->corner[orb_corner_next(c)];
  h->base[2] = s->corner[orb_corner_prev(c)];
  h->base[3] = s->corner[s->opposite[c]];
  ORB_GO(status, orb_refiner_create(ctx, h, options, &r), done);
  for (int32_t v = 0; v < s->vertex_count; v++) {
    r->alive[v] = 1;
    memcpy(r->point + 4 * (int64_t)v, points + 3 * (int64_t)s->to_mesh[v], 3 * sizeof(double));
  }
  r->live = s->vertex_count;
  *out = r;
  *hierarchy = h;
  return ORB_OK;
done:
  orb_hierarchy_destroy(ctx, h);
  return status;
}
