#include "align/sheet/copy.h"

#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "embed/newton/advance.h"
#include "embed/newton/hierarchy.h"

void orb_coarse_copy_free(orb_context *ctx, orb_coarse_copy *copy) {
  orb_mesh_free(ctx, &copy->mesh);
  orb_free(ctx, copy->points);
  orb_free(ctx, copy->vertex);
  memset(copy, 0, sizeof *copy);
}

/* Reads the refiner's level as a compact mesh. number: room for a number of each vertex of the given mesh. */
static orb_status read_level(orb_context *ctx, const orb_mesh *mesh, const orb_refiner *refiner, int32_t *number,
                             orb_coarse_copy *out) {
  ORB_TRY(orb_refiner_level(ctx, refiner, &out->vertex, &out->mesh.vertex_count, &out->mesh.triangles,
                            &out->mesh.triangle_count));
  out->mesh.positions = ORB_NEW(ctx, double, 3 * (size_t)out->mesh.vertex_count);
  out->points = ORB_NEW(ctx, double, 3 * (size_t)out->mesh.vertex_count);
  if (!out->mesh.positions || !out->points) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t i = 0; i < out->mesh.vertex_count; i++) {
    int32_t v = out->vertex[i];
    number[v] = i;
    memcpy(out->mesh.positions + 3 * (size_t)i, mesh->positions + 3 * (size_t)v, sizeof(double[3]));
    orb_refiner_point(refiner, v, out->points + 3 * (size_t)i);
  }
  for (int32_t h = 0; h < 3 * out->mesh.triangle_count; h++) {
    out->mesh.triangles[h] = number[out->mesh.triangles[h]];
  }
  return ORB_OK;
}

orb_status orb_coarse_copy_level(orb_context *ctx, const orb_mesh *mesh, const unsigned char *keep, int32_t keep_until,
                                 int32_t size, orb_preset preset, orb_hierarchy **hierarchy, orb_coarse_copy *out) {
  orb_status status = ORB_E_NO_MEMORY;
  orb_refiner *refiner = NULL;
  orb_embed_options options;
  int32_t n = mesh->vertex_count, *number = ORB_NEW(ctx, int32_t, n);
  memset(out, 0, sizeof *out);
  *hierarchy = NULL;
  orb_embed_defaults(&options);
  options.preset = preset;
  if (!number) {
    goto end;
  }
  ORB_GO(status, orb_hierarchy_create(ctx, mesh, keep, keep_until, hierarchy), end);
  ORB_GO(status, orb_refiner_create(ctx, *hierarchy, &options, &refiner), end);
  ORB_GO(status, orb_refiner_advance(ctx, refiner, n < size ? n : size), end);
  status = read_level(ctx, mesh, refiner, number, out);
end:
  orb_refiner_destroy(ctx, refiner);
  orb_free(ctx, number);
  return status;
}

orb_status orb_coarse_copy_create(orb_context *ctx, const orb_mesh *mesh, int32_t size, orb_coarse_copy *out) {
  orb_hierarchy *hierarchy;
  orb_status status = orb_coarse_copy_level(ctx, mesh, NULL, 4, size, ORB_PRESET_FAST, &hierarchy, out);
  orb_hierarchy_destroy(ctx, hierarchy);
  return status;
}
